"""Trajectories as text in the format of the TUM RGB-D benchmark: stamp in seconds, position, quaternion x y z w."""

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from stsem.pose import Pose, Trajectory, from_quaternion, to_quaternion

HEADER = "# timestamp tx ty tz qx qy qz qw\n"


def lines(stamps_ns: npt.NDArray[np.int64], poses: Pose) -> Iterator[str]:
    """One line for each stamp (n,) and its pose (n, 4, 4); stamps exact, numbers to nine digits."""
    numbers = np.concatenate([poses[:, :3, 3], to_quaternion(poses)], axis=1)
    for stamp_ns, row in zip(stamps_ns.tolist(), numbers.tolist(), strict=True):
        seconds, rest = divmod(stamp_ns, 10**9)
        yield f"{seconds}.{rest:09d} " + " ".join(f"{number:.9g}" for number in row) + "\n"


def parse(text: Iterable[str]) -> Trajectory:
    """The trajectory of a file's lines; comments (#) and empty lines are left out.

    Raises:
        ValueError: a line is not eight numbers, its quaternion is zero, or stamps do not ascend.
    """
    stamps_ns: list[int] = []
    poses: list[Pose] = []
    for number, line in enumerate(text, start=1):
        words = line.split("#")[0].split()
        if not words:
            continue
        if len(words) != 8:
            raise ValueError(f"line {number}: a pose has eight numbers, but {len(words)} came")
        seconds, _, rest = words[0].partition(".")
        stamps_ns.append(int(seconds) * 10**9 + int(rest[:9].ljust(9, "0")))
        values = [float(word) for word in words[1:]]
        poses.append(from_quaternion(values[:3], values[3:]))
    stamps = np.array(stamps_ns, np.int64)
    if (np.diff(stamps) <= 0).any():
        raise ValueError("the stamps of a trajectory must ascend")
    return Trajectory(stamps, np.array(poses, np.float64).reshape(-1, 4, 4))
