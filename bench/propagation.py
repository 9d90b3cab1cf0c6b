"""Accuracy and cost of predicting labels between keyframes, through the replay's own stages, without its clock.

    python -m bench.propagation LOG [--every 10] [--frames N] [--methods hold,homography,...] [--parts]

Every Nth frame gives its true labels; the frames between are labelled from them by each method, as the offline pass of
a replay would with the oracle. Prints mIoU and pixel accuracy (means over the distances), the share covered, the score
there, the score if the rest were right (what more evidence could bring), the processor time of one thread per frame
(register and predict; median and mean), and mIoU by distance. `--parts` adds what the frame's time went into.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from bench.propagation_parts import Parts
from stsem.classes import NO_LABEL, ClassSet, Labels
from stsem.frame import Frame, Segmentation
from stsem.geometry.carried import Carried, Draft
from stsem.geometry.flow import Search
from stsem.geometry.reproject import View, correspond
from stsem.log.log import Log, open_log
from stsem.metrics.confusion import confusion
from stsem.metrics.scores import scores
from stsem.stages.keyframe import Keyframe, view_of
from stsem.stages.propagate import PROPAGATIONS
from stsem.stages.propagation.depth import DepthWarp
from stsem.stages.propagation.flow import Flow
from stsem.stages.propagation.method import Memoryless, Needs, Predicted, Propagation
from stsem.stages.register import Anchor, Register, Registration

SEED = 0
PRESETS = {
    "ultrafast": cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST,
    "fast": cv2.DISOPTICAL_FLOW_PRESET_FAST,
    "medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
}
"""Of dense inverse search; `flow:fast,1,480` is the second one down to level 1 of images of 480 pixels."""


class Bare(Memoryless):
    """By depth and pose from one keyframe, all classes alike, holes left as they are."""

    needs = Needs(space=True)

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        labels = np.full(source.segmentation.labels.shape, NO_LABEL, np.uint8)
        view = view_of(frame)
        if view is not None and source.view is not None:
            correspond(view, source.view).fetch(source.segmentation.labels, labels)
        return Predicted(Segmentation(labels, None, covered=labels != NO_LABEL), source.index)

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        return None


class Carry(DepthWarp):
    """`depth` without likeness: what no keyframe saw comes by flow."""

    def _guessed(self, draft: Draft, view: View, frame: Frame) -> None:
        pass


def _flow(search: Search, side: int, classes: ClassSet) -> Flow:
    return Flow(search, side)


METHODS: dict[str, Callable[[ClassSet], Propagation]] = {
    **{name: lambda classes, make=row.make: make(classes, SEED) for name, row in PROPAGATIONS.items()},
    "bare": lambda classes: Bare(),
    "carry": Carry,
    **{
        f"flow:{name},{finest},{side}": partial(_flow, Search(preset, finest), side)
        for name, preset in PRESETS.items()
        for finest in (0, 1, 2)
        for side in (320, 400, 480, 640, 800, 960)
    },
}
"""Those of a replay, and what docs/propagation.md compares them with."""


class Run:
    """One method over one log, in the order in which a replay would call it.

    Args:
        method: asked for nothing else.
    """

    def __init__(self, method: Propagation) -> None:
        self.method = method
        follower = method if method.needs.follows else None
        self.register = Register(SEED, points=method.needs.points, follower=follower)
        self.source: Keyframe | None = None

    def keyframe(self, frame: Frame, truth: Labels) -> None:
        """`frame` is a keyframe, finished at once."""
        registration, old = self.register(frame, self._anchors()), self.source
        self.method.selected(frame, registration)
        labelled, view = Segmentation(truth, None), view_of(frame)
        self.source = Keyframe(frame.index, frame.stamp_ns, labelled, registration.features, view, frame.image)
        self.method.finished(self.source)
        if old is not None:
            self.method.forgotten(old.index)

    def predict(self, frame: Frame) -> Carried:
        """Labels of `frame` from the keyframes so far."""
        assert self.source is not None
        answer = self.method.predict(self.source, frame, self.register(frame, self._anchors())).answer
        covered = np.ones(answer.labels.shape, np.bool_) if answer.covered is None else answer.covered
        return Carried(answer.labels, None, covered)

    def _anchors(self) -> tuple[Anchor, ...]:
        source = self.source
        return () if source is None or source.features is None else (Anchor(source.index, source.features),)


@dataclass
class Tally:
    """Of one method: matrices by distance, what was covered, and what it cost."""

    classes: int
    by_distance: dict[int, np.ndarray] = field(default_factory=dict)
    covered: dict[int, np.ndarray] = field(default_factory=dict)
    best: dict[int, np.ndarray] = field(default_factory=dict)
    shares: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def add(self, distance: int, truth: Labels, answer: Carried) -> None:
        zero = np.zeros((self.classes, self.classes + 1), np.int64)
        only = np.where(answer.covered, truth, np.uint8(NO_LABEL))
        self.by_distance[distance] = self.by_distance.get(distance, zero) + confusion(
            truth, answer.labels, self.classes
        )
        self.covered[distance] = self.covered.get(distance, zero) + confusion(only, answer.labels, self.classes)
        best = np.where(answer.covered, answer.labels, truth)
        self.best[distance] = self.best.get(distance, zero) + confusion(truth, best, self.classes)
        self.shares.append(answer.coverage)

    def lines(self, name: str) -> list[str]:
        every = (self.by_distance, self.covered, self.best)
        found, there, best = ([scores(matrices[d]) for d in sorted(matrices)] for matrices in every)
        return [
            f"{name:14s} mIoU {_mean(found, 'miou')}  pixel accuracy {_mean(found, 'pixel_accuracy')}  "
            f"covered {100 * np.mean(self.shares):5.1f} %: {_mean(there, 'miou')} {_mean(there, 'pixel_accuracy')}  "
            f"were the rest right: {_mean(best, 'miou')}  "
            f"{1e3 * np.median(self.seconds):5.1f} ms (mean {1e3 * np.mean(self.seconds):.1f})  by distance "
            + " ".join(f"{100 * one.miou:.1f}" for one in found),
            f"{'':14s} IoU by class "
            + " ".join(f"{100 * x:.0f}" for x in scores(sum(self.by_distance.values())).iou)
            + "  covered "
            + " ".join(f"{100 * x:.1f}" for x in scores(sum(self.covered.values())).iou),
        ]


def _mean(found: list, name: str) -> str:
    return f"{100 * np.mean([getattr(one, name) for one in found]):5.2f}"


def measure(log: Log, methods: list[str], every: int, frames: int, parts: Parts) -> dict[str, Tally]:
    """The tallies of the methods over the first `frames` frames of `log`."""
    assert log.classes is not None, "the log has no labels"
    runs = {name: Run(METHODS[name](log.classes)) for name in methods}
    tallies = {name: Tally(len(log.classes)) for name in methods}
    for i in range(min(frames, len(log.plans))):
        frame, truth = log.frame(i, depth=True, previous=False), log.truth(i)
        for name, run in runs.items():
            if i % every == 0:
                assert truth is not None, "the keyframes need truth"
                run.keyframe(frame, truth)
                continue
            start = time.thread_time()
            with parts.of(name):
                answer = run.predict(frame)
            tallies[name].seconds.append(time.thread_time() - start)
            if truth is not None:
                tallies[name].add(i % every, truth, answer)
    return tallies


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--methods", default=",".join(PROPAGATIONS))
    parser.add_argument("--parts", action="store_true")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    parts = Parts(wanted=given.parts)
    with open_log([given.log]) as log:
        for name, tally in measure(log, given.methods.split(","), given.every, given.frames, parts).items():
            if not tally.by_distance:
                raise SystemExit("No frame between the keyframes has truth: nothing can be scored.")
            print(*tally.lines(name), *parts.lines(name), sep="\n")


if __name__ == "__main__":
    main()
