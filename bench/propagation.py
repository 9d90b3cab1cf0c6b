"""Accuracy and cost of the warps between keyframes, without the replay.

    python -m bench.propagation LOG [--every 10] [--frames N] [--methods hold,homography,flow,bare,carry,depth]

Every Nth frame gives its true labels; the frames between are labelled from them by each method, as the offline pass of
a replay would with the oracle. Prints mIoU and pixel accuracy (means over the distances), the share covered, the score
there, the score if the rest were right (what more evidence could bring), the processor time of one thread per frame
(median), and mIoU by distance.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from stsem.classes import NO_LABEL, Labels
from stsem.frame import Frame
from stsem.geometry import carry, flow, likeness
from stsem.geometry.carried import Carried
from stsem.geometry.features import Features, extract
from stsem.geometry.homography import estimate
from stsem.geometry.reproject import View, correspond
from stsem.geometry.warp import warp_extended
from stsem.log.log import Log, open_log
from stsem.metrics.confusion import confusion
from stsem.metrics.scores import scores
from stsem.stages.register import pair_seed

KEPT = 32
"""Keyframes that `depth` remembers."""


class Walk:
    """What the methods remember between frames; one method's run over a log uses its own.

    Args:
        log: opened.
    """

    def __init__(self, log: Log) -> None:
        assert log.classes is not None, "the log has no labels"
        self.moving = carry.moving_classes(log.classes)
        self.key: tuple[Frame, Labels] | None = None
        self.features: Features | None = None
        self.sources: list[carry.Source] = []
        self.examples: list[likeness.Examples] = []
        self.likeness = likeness.remembered([])
        self.chain: flow.Chain | None = None
        self.grey: flow.Grey | None = None

    def flowed(self, frame: Frame) -> Carried:
        """By chained flow from the keyframe."""
        assert self.key is not None
        assert self.chain is not None
        assert self.grey is not None
        grey = flow.working_grey(frame.image)
        self.chain = self.chain.extended(flow.backward_flow(grey, self.grey))
        self.grey = grey
        return self.chain.carry(self.key[1], None, frame.size)

    def restart(self, frame: Frame, truth: Labels) -> None:
        """`frame` is a keyframe."""
        self.key, self.features = (frame, truth), None
        self.grey = flow.working_grey(frame.image)
        self.chain = flow.Chain.start(self.grey)
        if frame.depth is not None and frame.T_WC is not None and frame.camera is not None:
            view = View(frame.depth, frame.T_WC, frame.camera)
            self.sources = [carry.Source(view, truth).without(self.moving), *self.sources[: KEPT - 1]]
            examples = likeness.Examples.of(likeness.described(view, frame.image), truth)
            self.examples = [examples, *self.examples[: KEPT - 1]]
            self.likeness = likeness.remembered(self.examples)


def hold(walk: Walk, frame: Frame) -> Carried:
    assert walk.key
    return Carried(walk.key[1], None, np.ones(walk.key[1].shape, np.bool_))


def homography(walk: Walk, frame: Frame) -> Carried:
    assert walk.key
    key, truth = walk.key
    walk.features = walk.features or extract(key.image)
    found = estimate(walk.features, extract(frame.image), seed=pair_seed(0, key.index, frame.index))
    covered = np.ones(truth.shape, np.uint8)
    if found is None:
        return Carried(truth, None, covered.view(np.bool_))
    seen = cv2.warpPerspective(covered, found.H, frame.size, flags=cv2.INTER_NEAREST)
    return Carried(warp_extended(truth, found.H, frame.size), None, np.asarray(seen, np.uint8).view(np.bool_))


def flowed(walk: Walk, frame: Frame) -> Carried:
    return walk.flowed(frame)


def bare(walk: Walk, frame: Frame) -> Carried:
    """From one keyframe, all classes alike, holes left as they are."""
    assert walk.key
    labels = np.full(walk.key[1].shape, NO_LABEL, np.uint8)
    if walk.sources and (view := _view(frame)):
        correspond(view, walk.sources[0].view).fetch(walk.key[1], labels)
    return Carried(labels, None, labels != NO_LABEL)


def carried(walk: Walk, frame: Frame) -> Carried:
    rest, view = walk.flowed(frame), _view(frame)
    return rest if view is None else carry.carry(view, walk.sources, rest, moving=walk.moving)


def depth(walk: Walk, frame: Frame) -> Carried:
    answer, view = carried(walk, frame), _view(frame)
    return answer if view is None else likeness.completed(answer, likeness.described(view, frame.image), walk.likeness)


def _view(frame: Frame) -> View | None:
    if frame.depth is None or frame.T_WC is None or frame.camera is None:
        return None
    return View(frame.depth, frame.T_WC, frame.camera)


METHODS: dict[str, Callable[[Walk, Frame], Carried]] = {
    "hold": hold, "homography": homography, "flow": flowed, "bare": bare, "carry": carried,
    "depth": depth,
}  # fmt: skip


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
            f"{name:11s} mIoU {_mean(found, 'miou')}  pixel accuracy {_mean(found, 'pixel_accuracy')}  "
            f"covered {100 * np.mean(self.shares):5.1f} %: {_mean(there, 'miou')} {_mean(there, 'pixel_accuracy')}  "
            f"were the rest right: {_mean(best, 'miou')}  "
            f"{1e3 * np.median(self.seconds):5.1f} ms  by distance "
            + " ".join(f"{100 * one.miou:.1f}" for one in found),
            f"{'':11s} IoU by class "
            + " ".join(f"{100 * x:.0f}" for x in scores(sum(self.by_distance.values())).iou)
            + "  covered "
            + " ".join(f"{100 * x:.1f}" for x in scores(sum(self.covered.values())).iou),
        ]


def _mean(found: list, name: str) -> str:
    return f"{100 * np.mean([getattr(one, name) for one in found]):5.2f}"


def measure(log: Log, methods: list[str], every: int, frames: int) -> dict[str, Tally]:
    """The tallies of the methods over the first `frames` frames of `log`."""
    assert log.classes is not None
    walks = {name: Walk(log) for name in methods}
    tallies = {name: Tally(len(log.classes)) for name in methods}
    for i in range(min(frames, len(log.plans))):
        frame, truth = log.frame(i, depth=True, previous=False), log.truth(i)
        for name in methods:
            if i % every == 0:
                assert truth is not None, "the keyframes need truth"
                walks[name].restart(frame, truth)
                continue
            start = time.thread_time()
            answer = METHODS[name](walks[name], frame)
            tallies[name].seconds.append(time.thread_time() - start)
            if truth is not None:
                tallies[name].add(i % every, truth, answer)
    return tallies


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--methods", default=",".join(METHODS))
    given = parser.parse_args()
    cv2.setNumThreads(1)
    with open_log([given.log]) as log:
        for name, tally in measure(log, given.methods.split(","), given.every, given.frames).items():
            if not tally.by_distance:
                raise SystemExit("No frame between the keyframes has truth: nothing can be scored.")
            print(*tally.lines(name), sep="\n")


if __name__ == "__main__":
    main()
