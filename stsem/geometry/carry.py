"""Labels by depth and pose from several keyframes, the rest by flow: what each of them can answer best.

A pixel asks the newest keyframe that saw its point; then earlier ones, newest first; then the chained flow. Classes
that move by themselves (`moving`) are never carried by geometry, which would leave them where they stood.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from stsem.classes import NO_LABEL, ClassSet, Labels, normalised
from stsem.geometry.carried import Bools, Carried
from stsem.geometry.reproject import DEFAULT_AGREEMENT, Agreement, Correspondence, View, among, correspond
from stsem.uncertainty import Confidence

MOVING = frozenset(map(normalised, (
    "person", "pedestrian", "rider", "human", "people", "bicyclist", "cyclist", "motorcyclist", "animal", "dog", "cat",
    "car", "truck", "bus", "train", "motorcycle", "motorbike", "bicycle", "vehicle", "caravan", "trailer",
)))  # fmt: skip
"""Names of classes that move by themselves, as `normalised` writes them."""

SAMPLES = 512
"""Pixels by which an earlier keyframe is tried before all are asked."""
MIN_GAIN = 0.005
"""An earlier keyframe that would cover less of the image than this is not asked."""


@dataclass(frozen=True, eq=False)
class Source:
    """A keyframe with the place of its pixels in space.

    Args:
        view: its depth, pose and camera.
        labels: (H, W) uint8 of the size of its depth.
        confidence: (H, W) float32, or None.
    """

    view: View
    labels: Labels
    confidence: Confidence | None = None

    def without(self, moving: Bools) -> "Source":
        """The same keyframe with NO_LABEL for the classes that `moving` (256,) names."""
        labels = np.where(moving[self.labels], np.uint8(NO_LABEL), self.labels)
        return Source(self.view, labels, self.confidence)


def moving_classes(classes: ClassSet) -> Bools:
    """(256,) bool: the ids of `classes` that are never carried by geometry."""
    table = np.zeros(256, np.bool_)
    table[: len(classes)] = [normalised(name) in MOVING for name in classes.names]
    return table


def carry(
    current: View, sources: Sequence[Source], rest: Carried, *, moving: Bools, max_earlier: int = 8,
    agreement: Agreement = DEFAULT_AGREEMENT,
) -> Carried:  # fmt: skip
    """Labels for `current` from `sources`, and `rest` where none of them saw the point.

    Covered is what depth covers, and what flow covers of the classes that move.

    Args:
        current: the frame to label.
        sources: keyframes, the newest first, `without` the moving classes; none is allowed.
        rest: by flow, of the size of `current`.
        moving: (256,) bool, as `moving_classes` gives them.
        max_earlier: how many keyframes after the first are asked for what is still missing. Those that would add less
            than MIN_GAIN of the image are passed over and do not count.
        agreement: the test against occlusion.
    """
    labels = np.full(current.depth.shape, NO_LABEL, np.uint8)
    confidence = None if rest.confidence is None else rest.confidence.copy()
    for source, pairs in _asked(current, sources, labels, max_earlier, agreement):
        pairs.fetch(source.labels, labels)
        if confidence is not None and source.confidence is not None:
            pairs.fetch(source.confidence, confidence)
    holes = labels == NO_LABEL
    cv2.copyTo(rest.labels, holes.view(np.uint8), labels)
    if confidence is not None and rest.confidence is not None:
        cv2.copyTo(rest.confidence, holes.view(np.uint8), confidence)
    return Carried(labels, confidence, ~holes | (rest.covered & _looked_up(moving, rest.labels)))


def _looked_up(table: Bools, labels: Labels) -> Bools:
    """`table[labels]`, five times as fast."""
    return np.asarray(cv2.LUT(labels, table.view(np.uint8)), np.uint8).view(np.bool_)


def _asked(
    current: View, sources: Sequence[Source], labels: Labels, max_earlier: int, agreement: Agreement
) -> Iterator[tuple[Source, Correspondence]]:
    """Each source with its pairs: of all pixels for the first, then of those that `labels` still lacks."""
    for source in sources[:1]:
        yield source, correspond(current, source.view, agreement=agreement)
    if len(sources) < 2:
        return
    asked, flat = 0, labels.reshape(-1)
    rows = np.flatnonzero((labels == NO_LABEL) & (current.depth > 0))
    for source in sources[1:]:
        if asked == max_earlier:
            return
        sample = rows[:: max(1, len(rows) // SAMPLES)]
        hits = np.count_nonzero(among(current, source.view, sample, agreement=agreement).found)
        if hits * len(rows) > MIN_GAIN * labels.size * len(sample):
            yield source, among(current, source.view, rows, agreement=agreement)
            asked, rows = asked + 1, rows[flat.take(rows) == NO_LABEL]
