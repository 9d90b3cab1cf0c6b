"""Odometry on a log with poses: python -m bench.slam LOG [--frames N] [--black FIRST COUNT].

Prints ATE (Umeyama without scale), RPE over a second, the share of frames tracked, and CPU time per frame by part.
Threads: run with OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1; OpenCV is set to one here.
"""

import argparse
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stsem.frame import Frame
from stsem.log.log import open_log
from stsem.pose import inverse
from stsem.slam import tracker as front
from stsem.slam.tracker import Tracked, Tracker

F64 = npt.NDArray[np.float64]
PARTS = ("find_landmarks", "plane_grid", "resect", "align", "most_alike")


def main() -> None:
    """Track every frame with depth, then compare with the log's poses."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", type=Path)
    parser.add_argument("--frames", type=int, default=None, help="only the first so many")
    parser.add_argument("--black", type=int, nargs=2, default=(0, 0), metavar=("FIRST", "COUNT"))
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    spent = {name: _timed(name) for name in PARTS}
    answers, frames, times = _run(arguments)
    _report(answers, frames, times)
    for name, seconds in spent.items():
        print(f"  {name:15s} {1e3 * sum(seconds) / max(1, len(answers)):6.2f} ms a frame, mean")


def _run(arguments: argparse.Namespace) -> tuple[list[Tracked], list[Frame], list[float]]:
    answers: list[Tracked] = []
    frames: list[Frame] = []
    times: list[float] = []
    first, count = arguments.black
    with open_log([arguments.log]) as log:
        if log.camera is None:
            raise SystemExit(f"{arguments.log} states no camera; SLAM needs its intrinsics")
        tracker = Tracker(log.camera, arguments.seed)
        for loaded in log.frames(range(len(log.plans))[: arguments.frames], depth=True, previous=False, truth=False):
            frame = loaded.frame
            if frame is None or frame.depth is None:
                continue
            if first <= frame.index < first + count:
                frame = replace(frame, image=np.zeros_like(frame.image), depth=np.full_like(frame.depth, np.nan))
            start = process_time()
            answers.append(tracker.track(frame))
            times.append(1e3 * (process_time() - start))
            frames.append(replace(frame, image=frame.image[:1, :1], depth=None))
    return answers, frames, times


def _report(answers: list[Tracked], frames: list[Frame], times: list[float]) -> None:
    both = [(a.T_WC, f.T_WC) for a, f in zip(answers, frames, strict=True) if a.T_WC is not None and f.T_WC is not None]
    estimated, true = (np.array(side) for side in zip(*both, strict=True))
    errors = _ate(estimated, true)
    step = max(1, round(1e9 / np.median(np.diff([frame.stamp_ns for frame in frames]))))
    relative = inverse(inverse(true[:-step]) @ true[step:]) @ (inverse(estimated[:-step]) @ estimated[step:])
    drift = np.linalg.norm(relative[:, :3, 3], axis=1)
    print(f"frames with depth {len(answers)}, tracked {sum(a.T_WC is not None for a in answers)}", end="  ")
    print(dict(Counter(str(answer.status) for answer in answers)))
    print(
        f"ATE RMSE {100 * _rms(errors):.2f} cm, max {100 * errors.max():.2f}; RPE 1 s RMSE {100 * _rms(drift):.2f} cm"
    )
    print(
        f"CPU ms a frame: median {np.median(times):.1f}, p95 {np.percentile(times, 95):.1f}, mean {np.mean(times):.1f}"
    )


def _ate(estimated: F64, true: F64) -> F64:
    """Distances after the best rigid motion (Umeyama 1991, no scale)."""
    a, b = estimated[:, :3, 3] - estimated[:, :3, 3].mean(axis=0), true[:, :3, 3] - true[:, :3, 3].mean(axis=0)
    U, _, Vt = np.linalg.svd(b.T @ a)
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return np.asarray(np.linalg.norm(a @ R.T - b, axis=1))


def _rms(values: F64) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _timed(name: str) -> list[float]:
    """Replaces a function that the tracker calls by one that notes its CPU time."""
    function: Callable[..., Any] = getattr(front, name)
    seconds: list[float] = []

    def timed(*args: Any, **kwargs: Any) -> Any:
        start = process_time()
        try:
            return function(*args, **kwargs)
        finally:
            seconds.append(process_time() - start)

    setattr(front, name, timed)
    return seconds


if __name__ == "__main__":
    main()
