"""Rigid transforms and trajectories. T_AB maps points of frame B into frame A; quaternions are x, y, z, w."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Pose = npt.NDArray[np.float64]
"""(4, 4) float64 homogeneous transform; `T_WC` is world from camera, metres, optical axes."""


def from_quaternion(translation: npt.ArrayLike, quaternion: npt.ArrayLike) -> Pose:
    """T (4, 4) from a translation (3,) in metres and a quaternion (4,) x y z w of any non-zero length.

    Raises:
        ValueError: a value is not finite, or the quaternion is zero.
    """
    t, q = np.asarray(translation, np.float64), np.asarray(quaternion, np.float64)
    norm = float(np.linalg.norm(q))
    if not (np.isfinite(t).all() and np.isfinite(norm)) or norm < 1e-9:
        raise ValueError(f"not a pose: translation {t.tolist()}, quaternion {q.tolist()}")
    pose = np.eye(4)
    pose[:3, :3] = rotation(q / norm)
    pose[:3, 3] = t
    return pose


def rotation(quaternion: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """R (..., 3, 3) of unit quaternions (..., 4) x y z w."""
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def to_quaternion(pose: Pose) -> npt.NDArray[np.float64]:
    """(4,) x y z w with w >= 0, by the largest-component method (Shepperd 1978)."""
    m = pose[:3, :3]
    candidates = np.array([m[0, 0], m[1, 1], m[2, 2], np.trace(m)])
    k = int(candidates.argmax())
    q = np.empty(4)
    if k == 3:
        q[:] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1 + candidates[3]
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q[k] = 1 - candidates[3] + 2 * m[k, k]
        q[i], q[j] = m[i, k] + m[k, i], m[j, k] + m[k, j]
        q[3] = m[j, i] - m[i, j]
    q /= np.linalg.norm(q)
    return -q if q[3] < 0 else q


def inverse(pose: Pose) -> Pose:
    """T_BA from T_AB."""
    result = np.eye(4)
    result[:3, :3] = pose[:3, :3].T
    result[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return result


def interpolate(a: Pose, b: Pose, share: float) -> Pose:
    """Pose at `share` in [0, 1] of the way from `a` to `b`: linear translation, slerp rotation."""
    qa, qb = to_quaternion(a), to_quaternion(b)
    cosine = float(qa @ qb)
    if cosine < 0:
        qb, cosine = -qb, -cosine
    angle = np.arccos(min(cosine, 1.0))
    if angle < 1e-6:
        q = (1 - share) * qa + share * qb
    else:
        q = (np.sin((1 - share) * angle) * qa + np.sin(share * angle) * qb) / np.sin(angle)
    return from_quaternion((1 - share) * a[:3, 3] + share * b[:3, 3], q)


@dataclass(frozen=True)
class PoseSample:
    """A pose looked up in a trajectory; `later` is the index of the later of the samples that made it."""

    T_WC: Pose
    later: int


@dataclass(frozen=True)
class Trajectory:
    """Poses of the camera over time.

    Args:
        stamps_ns: (n,) int64, strictly ascending.
        poses: (n, 4, 4) float64, T_WC.
    """

    stamps_ns: npt.NDArray[np.int64]
    poses: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def at(self, stamp_ns: int, max_gap_ns: int) -> PoseSample | None:
        """Pose at `stamp_ns` between samples at most `max_gap_ns` apart; None outside them: no extrapolation."""
        i = int(np.searchsorted(self.stamps_ns, stamp_ns))
        if i < len(self) and self.stamps_ns[i] == stamp_ns:
            return PoseSample(self.poses[i], i)
        if i == 0 or i == len(self):
            return None
        before, after = int(self.stamps_ns[i - 1]), int(self.stamps_ns[i])
        if after - before > max_gap_ns:
            return None
        share = (stamp_ns - before) / (after - before)
        return PoseSample(interpolate(self.poses[i - 1], self.poses[i], share), i)
