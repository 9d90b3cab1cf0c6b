"""Labels by depth and pose from several keyframes, and by flow: each fills in what those before it left open.

A pixel asks the newest keyframe that saw its point; then earlier ones, newest first. Classes that move by themselves
(`moving`) are never carried by geometry, which would leave them where they stood: they come by flow.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stsem.classes import NO_LABEL, ClassSet, Labels, normalised
from stsem.geometry.carried import Bools, Draft
from stsem.geometry.flow import Traced
from stsem.geometry.packed import Rows
from stsem.geometry.reproject import DEFAULT_AGREEMENT, Agreement, Correspondence, View, among, correspond, in_image
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

    def lit(self) -> "Source":
        """The same keyframe with depth in the shadows of the projector, by guess."""
        return Source(self.view.lit(), self.labels, self.confidence)

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
    draft: Draft, current: View, sources: Sequence[Source], *, max_earlier: int = 8,
    agreement: Agreement = DEFAULT_AGREEMENT,
) -> None:  # fmt: skip
    """Fill in what `sources` saw: evidence.

    Args:
        draft: of the size of `current`, still open everywhere.
        current: the frame to label.
        sources: keyframes, the newest first, `without` the moving classes; none is allowed.
        max_earlier: how many keyframes after the first are asked for what is still missing. Those that would add less
            than MIN_GAIN of the image are passed over and do not count.
        agreement: the test against occlusion.
    """
    for source in sources[:1]:
        _write(source, correspond(current, source.view, agreement=agreement), draft)
    carry_more(draft, current, sources[1:], at_most=max_earlier, agreement=agreement)
    draft.covered |= ~draft.open


def carry_more(
    draft: Draft, current: View, sources: Sequence[Source], *, at_most: int = 8,
    agreement: Agreement = DEFAULT_AGREEMENT,
) -> None:  # fmt: skip
    """Fill in what `sources` say of what is open, the newest first, without calling it evidence; see `carry`.

    Args:
        draft: of the size of `current`.
        current: the frame to label.
        sources: keyframes as for `carry`.
        at_most: how many of them are asked.
        agreement: the test against occlusion.
    """
    if not sources:
        return
    asked, flat = 0, draft.labels.reshape(-1)
    left = draft.left()
    rows = left[current.depth.reshape(-1).take(left) > 0]
    inside = in_image(current, [source.view for source in sources], rows[:: max(1, len(rows) // SAMPLES)])
    for source, possible in zip(sources, inside, strict=True):
        if asked == at_most:
            return
        if not possible:
            continue
        sample = rows[:: max(1, len(rows) // SAMPLES)]
        hits = np.count_nonzero(among(current, source.view, sample, agreement=agreement).found)
        if hits * len(rows) > MIN_GAIN * flat.size * len(sample):
            _write(source, among(current, source.view, rows, agreement=agreement), draft)
            asked, rows = asked + 1, rows[flat.take(rows) == NO_LABEL]


def follow(draft: Draft, traced: Traced, *, moving: Bools) -> None:
    """Fill in what flow covers of the classes that move by themselves: evidence, too.

    Args:
        draft: open at the pixels that were `traced`.
        traced: by flow.
        moving: (256,) bool, as `moving_classes` gives them.
    """
    sure = traced.covered & moving[traced.labels]
    _put(traced, np.flatnonzero(sure), draft)
    draft.covered.reshape(-1)[traced.rows[sure]] = True


def settle(draft: Draft, traced: Traced) -> None:
    """Fill in what flow says wherever `draft` is still open at the pixels that were `traced`: no evidence."""
    _put(traced, np.flatnonzero(draft.labels.reshape(-1).take(traced.rows) == NO_LABEL), draft)


def _put(traced: Traced, some: Rows, draft: Draft) -> None:
    """`some` (n,) of the pixels `traced` into `draft`."""
    at = traced.rows[some]
    draft.labels.reshape(-1)[at] = traced.labels[some]
    if draft.confidence is not None and traced.confidence is not None:
        draft.confidence.reshape(-1)[at] = traced.confidence[some]


def _write(source: Source, pairs: Correspondence, draft: Draft) -> None:
    """What `source` says of the pixels of `pairs`."""
    pairs.fetch(source.labels, draft.labels)
    if draft.confidence is not None and source.confidence is not None:
        pairs.fetch(source.confidence, draft.confidence)
