"""How fast the camera turns: on rendered walks, and in logs with poses.

    python -m bench.turning [LOG ...]

Prints degrees per second (mean, median, 90 %) and the shares above 40 and below 5: over 0.1 s of twelve walks of a
minute for each speed profile, and from frame to frame of each LOG.
"""

import sys
from functools import cache
from pathlib import Path

import numpy as np

from stsem import chance
from stsem.log.log import open_log
from stsem.pose import Pose
from stsem.synth.office import build_office
from stsem.synth.path import PROFILES, pose_at, profile, walk

furnished = cache(build_office)


def rates(poses: list[Pose], times_s: np.ndarray) -> np.ndarray:
    """(n - 1,) degrees per second between neighbours, by the trace of the rotation."""
    turns = np.stack(poses)[:, :3, :3]
    trace = np.einsum("nij,nij->n", turns[:-1], turns[1:])
    return np.asarray(np.degrees(np.arccos(((trace - 1) / 2).clip(-1, 1))) / np.diff(times_s))


def walked(name: str) -> np.ndarray:
    found = []
    for seed in range(12):
        layout, times = 100 + seed, np.arange(0, 60, 0.1)
        states = walk(furnished(layout), chance.hash31(seed, "walk", layout), 60, profile(name))
        found.append(rates([pose_at(states, float(time)) for time in times], times))
    return np.concatenate(found)


def recorded(path: Path) -> np.ndarray:
    with open_log([path]) as log:
        frames = [log.frame(i, depth=False, previous=False) for i in range(len(log.plans))]
    known = [(frame.T_WC, frame.stamp_ns * 1e-9) for frame in frames if frame.T_WC is not None]
    return rates([pose for pose, _ in known], np.array([time for _, time in known]))


def line(name: str, found: np.ndarray) -> str:
    return (
        f"{name}: mean {found.mean():.1f}, median {np.median(found):.1f}, 90 % {np.percentile(found, 90):.1f}, "
        f"above 40 {100 * (found > 40).mean():.0f} %, below 5 {100 * (found < 5).mean():.0f} %"
    )


def main() -> None:
    for name in PROFILES:
        print(line(name, walked(name)))
    for path in sys.argv[1:]:
        print(line(path, recorded(Path(path))))


if __name__ == "__main__":
    main()
