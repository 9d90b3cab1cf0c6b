"""Depth: the exact warp by depth and pose from the keyframes that saw each point; the rest by likeness and flow."""

from dataclasses import dataclass

import numpy as np

from stsem.classes import ClassSet
from stsem.frame import Frame, Segmentation
from stsem.geometry.carried import Carried
from stsem.geometry.carry import Source, carry, moving_classes
from stsem.geometry.likeness import Examples, completed, described, remembered
from stsem.geometry.reproject import Rows, View, among
from stsem.stages.keyframe import Keyframe, view_of
from stsem.stages.propagation.flow import Flow
from stsem.stages.propagation.method import Needs, Predicted
from stsem.stages.register import Registration

KEPT = 32
"""Keyframes remembered: up to 9 bytes a pixel each, 152 MB in all at 960x540 with what they look like."""
LIKENED = 16
"""Of them, those whose points serve as examples: 32 are no better on the whole, and their search tree takes 30 ms."""
SAMPLES = 2048
"""Pixels by which the coverage of a frame is foretold."""
FLOW_SIDE = 320
"""Longer side, in pixels, of the images between which flow is sought: most pixels come by depth."""
STRIDE_M = 0.5
"""How much nearer or farther a person may have come since the keyframe, so that what flow says of them is believed."""
NO_SPACE = "no depth or pose: by flow"


@dataclass(frozen=True, eq=False)
class _Memory:
    """What is kept of a finished keyframe: its place in time, its pixels in space, and what they look like."""

    stamp_ns: int
    source: Source
    examples: Examples


class DepthWarp:
    """Asks up to `KEPT` finished keyframes, the newest first; persons come by flow, where their distance agrees.

    What neither covers gets the label of the most similar points of those keyframes, and where its own depth is
    unknown, what flow says. A frame without depth, pose or camera is predicted by flow alone; a keyframe without them
    is not asked.

    Args:
        classes: of the labels: which of them move by themselves is told by name.
    """

    needs = Needs(follows=True, space=True)

    def __init__(self, classes: ClassSet) -> None:
        self._moving = moving_classes(classes)
        self._flow = Flow(side=FLOW_SIDE)
        self._memory: tuple[_Memory, ...] = ()
        self._likeness = remembered(())
        self._selected: View | None = None

    def see(self, frame: Frame, registration: Registration) -> None:
        """See `Flow.see`."""
        self._flow.see(frame, registration)

    def selected(self, frame: Frame, registration: Registration | None) -> None:
        """See `Flow.selected`."""
        self._flow.selected(frame, registration)
        self._selected = view_of(frame)

    def finished(self, keyframe: Keyframe) -> None:
        """Remembered with its depth; the oldest one makes room."""
        view, image, answer = keyframe.view, keyframe.image, keyframe.segmentation
        if view is None or image is None:
            return
        source = Source(view, answer.labels, answer.confidence).without(self._moving)
        new = _Memory(keyframe.stamp_ns, source, Examples.of(described(view, image), answer.labels))
        self._memory = tuple(sorted([new, *self._memory], key=lambda memory: -memory.stamp_ns)[:KEPT])
        self._likeness = remembered([memory.examples for memory in self._memory[:LIKENED]])

    def forgotten(self, index: int) -> None:
        """Its chain is let go; its depth and labels stay."""
        self._flow.forgotten(index)

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """By depth where a keyframe saw the point; persons by flow; the rest by likeness."""
        by_flow, view = self._flow.predict(source, frame, registration), view_of(frame)
        if view is None or not (view.depth > 0).any():
            return Predicted(by_flow.answer, source.index, NO_SPACE)
        rest = self._followed(by_flow.answer, source, view)
        seen = carry(view, [memory.source for memory in self._memory], rest, moving=self._moving)
        found = self._completed(seen, view, frame)
        return Predicted(Segmentation(found.labels, found.confidence, covered=found.covered), source.index)

    def _followed(self, answer: Segmentation, source: Keyframe, view: View) -> Carried:
        """What flow says; covered where the frame is still about as far away as the keyframe was."""
        chain = self._flow.chain(source.index)
        if answer.covered is None or chain is None or source.view is None:
            return Carried(answer.labels, answer.confidence, np.zeros(answer.labels.shape, np.bool_))
        stays = chain.stays(view.depth, source.view.depth, within_m=STRIDE_M)
        return Carried(answer.labels, answer.confidence, answer.covered & stays)

    def _completed(self, seen: Carried, view: View, frame: Frame) -> Carried:
        """`seen` with guesses by likeness for what is not covered."""
        return completed(seen, described(view, frame.image), self._likeness)

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        """The share of some pixels with depth that any keyframe saw, persons or not; by flow for a frame without depth.

        What has no depth is left out: a keyframe more would not change that.
        """
        view = view_of(frame)
        if view is None:
            return self._flow.expected_coverage(frame, registration)
        rows = _spread(view.depth.size)
        known = rows[view.depth.reshape(-1)[rows] > 0]
        if not len(known):
            return self._flow.expected_coverage(frame, registration)
        return self._seen(view, known) / len(known)

    def _seen(self, view: View, rows: Rows) -> int:
        """How many of the pixels `rows` a keyframe saw."""
        left, selected = rows, () if self._selected is None else (self._selected,)
        for keyframe in (*selected, *(memory.source.view for memory in self._memory)):
            if not len(left):
                break
            pairs = among(view, keyframe, left)
            left = left[~pairs.found.reshape(-1)[: len(left)]]
        return len(rows) - len(left)


def _spread(size: int) -> Rows:
    """SAMPLES of `size` pixels, spread by the golden ratio: a grid would fall into step with the rows of the image."""
    return (np.arange(SAMPLES) * 0.6180339887498949 % 1 * size).astype(np.intp)
