"""Depth: the exact warp by depth and pose from the keyframes that saw each point; the rest by likeness and flow."""

from dataclasses import dataclass, replace

import numpy as np

from stsem.classes import ClassSet
from stsem.frame import Frame, Segmentation
from stsem.geometry.carried import Draft
from stsem.geometry.carry import Source, carry, carry_more, follow, moving_classes, settle
from stsem.geometry.cells import described
from stsem.geometry.flow import Traced
from stsem.geometry.likeness import Examples, Movers, guess, remembered
from stsem.geometry.packed import Rows
from stsem.geometry.reproject import View, among
from stsem.stages.keyframe import Keyframe, view_of
from stsem.stages.propagation.flow import Flow
from stsem.stages.propagation.hold import uncovered
from stsem.stages.propagation.method import Needs, Predicted
from stsem.stages.register import Registration

KEPT = 32
"""Keyframes remembered: up to 9 bytes a pixel each, 180 MB in all at 960x540 with what they look like."""
LIT = 8
"""Of them, those that are asked what lies in shadows, by depth that is a guess."""
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
    lit: Source | None
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
        lit = source.lit()
        new = _Memory(keyframe.stamp_ns, source, lit, Examples.of(described(lit.view, image), answer.labels))
        self._memory = _with(new, self._memory)
        self._likeness = remembered([memory.examples for memory in self._memory])

    def forgotten(self, index: int) -> None:
        """Its chain is let go; its depth and labels stay."""
        self._flow.forgotten(index)

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """By depth where a keyframe saw the point; persons by flow; the rest by depth in shadows, likeness, flow."""
        view = view_of(frame)
        if view is None or not (view.depth > 0).any():
            return Predicted(self._flow.predict(source, frame, registration).answer, source.index, NO_SPACE)
        answer, lit = source.segmentation, view.lit()
        draft = Draft.blank(view.depth.shape, sure=answer.confidence is not None)
        carry(draft, view, [memory.source for memory in self._memory])
        follow(draft, self._traced(self._perhaps_moving(draft, source), source, view), moving=self._moving)
        carry_more(draft, lit, [memory.lit for memory in self._memory if memory.lit is not None])
        self._guessed(draft, lit, frame)
        settle(draft, self._traced(draft.left(), source, view))
        return Predicted(Segmentation(draft.labels, draft.confidence, covered=draft.covered), source.index)

    def _perhaps_moving(self, draft: Draft, source: Keyframe) -> Rows:
        """(n,) the open pixels that flow may lead to a class that moves."""
        chain, (height, width) = self._flow.chain(source.index), draft.labels.shape
        if chain is None or not self._moving.any():
            return np.empty(0, np.intp)
        near, left = chain.leads_to(self._moving, source.segmentation.labels, (width, height)), draft.left()
        return left[near.reshape(-1).take(left)]

    def _traced(self, rows: Rows, source: Keyframe, view: View) -> Traced:
        """What flow says of the pixels `rows`; without a chain, what the keyframe has there, and nothing covered."""
        chain, answer = self._flow.chain(source.index), source.segmentation
        if not len(rows):
            return Traced(rows, np.empty(0, np.uint8), None, np.empty(0, np.bool_))
        if chain is not None and source.view is not None:
            depths = view.depth, source.view.depth
            return chain.trace(rows, answer.labels, answer.confidence, depths, within_m=STRIDE_M)
        size = view.camera.width, view.camera.height
        kept = uncovered(answer, size) if chain is None else chain.carry(answer.labels, answer.confidence, size)
        sure = None if kept.confidence is None else kept.confidence.reshape(-1)[rows]
        return Traced(rows, kept.labels.reshape(-1)[rows], sure, np.zeros(len(rows), np.bool_))

    def _guessed(self, draft: Draft, view: View, frame: Frame) -> None:
        """Guesses by likeness for what is open."""
        newest = self._memory[0].source.view if self._memory else None
        guess(draft, described(view, frame.image), self._likeness, Movers(self._moving, newest))

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


def _with(new: _Memory, memory: tuple[_Memory, ...]) -> tuple[_Memory, ...]:
    """`memory` with `new`, the newest first: what older ones show of the same places is let go, of the oldest all."""
    newer = [one for one in memory if one.stamp_ns >= new.stamp_ns]
    for one in newer:
        new = replace(new, examples=new.examples.without(one.examples))
    older = [replace(one, examples=one.examples.without(new.examples)) for one in memory[len(newer) :]]
    kept = [*newer, new, *older][:KEPT]
    return (*kept[:LIT], *(replace(one, lit=None) for one in kept[LIT:]))


def _spread(size: int) -> Rows:
    """SAMPLES of `size` pixels, spread by the golden ratio: a grid would fall into step with the rows of the image."""
    return (np.arange(SAMPLES) * 0.6180339887498949 % 1 * size).astype(np.intp)
