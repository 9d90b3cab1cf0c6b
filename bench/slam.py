"""SLAM on a log with poses: python -m bench.slam LOG [--frames N] [--black FIRST COUNT] [--no-loops].

Prints ATE (Umeyama without scale) of the poses given at once and of the final trajectory, RPE a metre and a second,
the share of frames tracked, loops closed, and CPU time per frame by part.
Threads: run with OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1; OpenCV is set to one here.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.frame import Frame
from stsem.log.log import open_log
from stsem.metrics.trajectory import absolute_errors, relative_errors_per_metre, relative_errors_per_second
from stsem.pose import Pose, inverse
from stsem.slam import loops, system, tracker
from stsem.slam.system import Slam
from stsem.slam.tracker import Tracked

F64 = npt.NDArray[np.float64]
PARTS = (
    (tracker, "find_landmarks"), (tracker, "plane_grid"), (tracker, "resect"), (tracker, "align"),
    (tracker.Tracker, "_promote"), (tracker, "most_alike"), (loops, "verify"), (loops.Loops, "add"), (system, "relax"),
)  # fmt: skip


def main() -> None:
    """Track every frame with depth, then compare with the log's poses."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", type=Path)
    parser.add_argument("--frames", type=int, default=None, help="only the first so many")
    parser.add_argument("--black", type=int, nargs=2, default=(0, 0), metavar=("FIRST", "COUNT"))
    parser.add_argument("--no-loops", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    if arguments.no_loops:
        loops.MIN_KEYFRAMES_BETWEEN = 1 << 30
    spent = {name: _timed(owner, name) for owner, name in PARTS}
    _track(arguments)
    for name, seconds in spent.items():
        total = 1e3 * sum(seconds)
        print(
            f"  {name:15s} {total / max(1, len(seconds)):7.2f} ms a call, {len(seconds)} calls, {total:.0f} ms in all"
        )


def _track(arguments: argparse.Namespace) -> None:
    slam, answers, times = None, {}, []
    truth: dict[int, tuple[int, Pose | None]] = {}
    for camera, frame in _frames(arguments):
        slam = slam or Slam(camera, arguments.seed)
        truth[frame.index] = (frame.stamp_ns, frame.T_WC)
        start = process_time()
        answers[frame.index] = slam.track(frame)
        times.append(1e3 * (process_time() - start))
    if slam is None:
        raise SystemExit(f"{arguments.log} has no frame with depth")
    statuses = dict(Counter(str(one.status) for one in answers.values()))
    print(f"frames with depth {len(answers)}, lost {slam.lost}, {statuses}, loops closed {slam.closed}")
    live = {index: one.T_WC for index, one in answers.items() if one.T_WC is not None}
    _compare("live", live, truth)
    _compare("final", {one.index: one.T_WC for one in slam.trajectory()}, truth)
    if arguments.black[1]:
        _around(answers, truth, *arguments.black)
    print(
        f"CPU ms a frame: median {np.median(times):.1f}, p95 {np.percentile(times, 95):.1f}, mean {np.mean(times):.1f}"
    )


def _frames(arguments: argparse.Namespace) -> Iterator[tuple[Camera, Frame]]:
    first, count = arguments.black
    with open_log([arguments.log]) as log:
        if log.camera is None:
            raise SystemExit(f"{arguments.log} states no camera; SLAM needs its intrinsics")
        for loaded in log.frames(range(len(log.plans))[: arguments.frames], depth=True, previous=False, truth=False):
            frame = loaded.frame
            if frame is None or frame.depth is None:
                continue
            if first <= frame.index < first + count:
                frame = replace(frame, image=np.zeros_like(frame.image), depth=np.full_like(frame.depth, np.nan))
            yield log.camera, frame


def _compare(name: str, found: dict[int, Pose], truth: dict[int, tuple[int, Pose | None]]) -> None:
    both = [(truth[index][0], T, truth[index][1]) for index, T in found.items() if truth[index][1] is not None]
    stamps, estimate, true = (np.array(side) for side in zip(*both, strict=True))
    errors = absolute_errors(estimate, true)
    metre = relative_errors_per_metre(estimate, true).translation_m.rmse
    second = relative_errors_per_second(stamps, estimate, true).translation_m.rmse
    print(
        f"{name:6s} ATE RMSE {100 * errors.rmse:.2f} cm, max {100 * errors.max:.2f};"
        f" RPE {100 * metre:.2f} cm a metre, {100 * second:.2f} cm a second; {len(both)} poses"
    )


def _around(answers: dict[int, Tracked], truth: dict[int, tuple[int, Pose | None]], first: int, count: int) -> None:
    """The error against the first frame, before the black frames, and after them from the first one tracked."""
    after = next((i for i in answers if i >= first + count and answers[i].T_WC is not None), None)
    start = next(iter(answers))
    for name, index in (("before", first - 1), ("after", after)):
        if index is None or (found := answers[index].T_WC) is None:
            print(f"{name} the black frames: lost")
            continue
        whole = inverse(_true(truth, start)) @ _true(truth, index)
        off = inverse(whole) @ inverse(_found(answers, start)) @ found
        print(f"{name} the black frames: frame {index}, {100 * np.linalg.norm(off[:3, 3]):.2f} cm from the truth")


def _true(truth: dict[int, tuple[int, Pose | None]], index: int) -> Pose:
    pose = truth[index][1]
    assert pose is not None
    return pose


def _found(answers: dict[int, Tracked], index: int) -> Pose:
    pose = answers[index].T_WC
    assert pose is not None
    return pose


def _timed(owner: Any, name: str) -> list[float]:
    """Replaces a function that SLAM calls by one that notes its CPU time."""
    function: Callable[..., Any] = getattr(owner, name)
    seconds: list[float] = []

    def timed(*args: Any, **kwargs: Any) -> Any:
        start = process_time()
        try:
            return function(*args, **kwargs)
        finally:
            seconds.append(process_time() - start)

    setattr(owner, name, timed)
    return seconds


if __name__ == "__main__":
    main()
