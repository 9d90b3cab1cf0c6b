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
    """(..., 4) x y z w with w >= 0 of (..., 4, 4), by the largest-component method (Shepperd 1978)."""
    m = np.moveaxis(pose[..., :3, :3], (-2, -1), (0, 1))
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    x, y, z = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    xy, xz, yz = m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] + m[1, 2]
    by_component = np.array([
        [1 - trace + 2 * m[0, 0], xy, xz, x],
        [xy, 1 - trace + 2 * m[1, 1], yz, y],
        [xz, yz, 1 - trace + 2 * m[2, 2], z],
        [x, y, z, 1 + trace],
    ])  # fmt: skip
    largest = np.array([m[0, 0], m[1, 1], m[2, 2], trace]).argmax(axis=0)
    q: npt.NDArray[np.float64] = np.moveaxis(np.take_along_axis(by_component, largest[None, None], axis=0)[0], 0, -1)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., 3:] < 0, -q, q)


def inverse(pose: Pose) -> Pose:
    """T_BA (..., 4, 4) from T_AB."""
    result = np.zeros_like(pose)
    turned = np.swapaxes(pose[..., :3, :3], -2, -1)
    result[..., :3, :3] = turned
    result[..., :3, 3] = -(turned @ pose[..., :3, 3:])[..., 0]
    result[..., 3, 3] = 1
    return result


def interpolate(a: Pose, b: Pose, share: npt.ArrayLike) -> Pose:
    """Poses (..., 4, 4) at `share` (...) in [0, 1] of the way from `a` to `b`: linear translation, slerp rotation."""
    part = np.asarray(share, np.float64)[..., None]
    qa, qb = to_quaternion(a), to_quaternion(b)
    cosine = (qa * qb).sum(axis=-1, keepdims=True)
    qb = np.where(cosine < 0, -qb, qb)
    angle = np.arccos(np.minimum(np.abs(cosine), 1.0))
    small = angle < 1e-6
    sine = np.where(small, 1.0, np.sin(angle))
    of_a = np.where(small, 1 - part, np.sin((1 - part) * angle) / sine)
    of_b = np.where(small, part, np.sin(part * angle) / sine)
    q = of_a * qa + of_b * qb
    result = np.zeros_like(a)
    result[..., :3, :3] = rotation(q / np.linalg.norm(q, axis=-1, keepdims=True))
    result[..., :3, 3] = (1 - part) * a[..., :3, 3] + part * b[..., :3, 3]
    result[..., 3, 3] = 1
    return result


@dataclass(frozen=True)
class PoseSample:
    """A pose looked up in a trajectory; `later` is the index of the later of the samples that made it."""

    T_WC: Pose
    later: int


@dataclass(frozen=True)
class Brackets:
    """For each of n stamps the samples around it; (n,) each.

    Args:
        known: bool: whether there are any, close enough together, and nothing broken between them.
        earlier, later: int64 rows; equal at a sample's own stamp. Without meaning where not known.
    """

    known: npt.NDArray[np.bool_]
    earlier: npt.NDArray[np.int64]
    later: npt.NDArray[np.int64]


@dataclass(frozen=True)
class Trajectory:
    """Poses of the camera over time.

    Args:
        stamps_ns: (n,) int64, strictly ascending.
        poses: (n, 4, 4) float64, T_WC.
        broken: (n - 1,) bool: steps that are no motion (the pose jumps) and are not bridged; None without.
    """

    stamps_ns: npt.NDArray[np.int64]
    poses: npt.NDArray[np.float64]
    broken: npt.NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def brackets(self, stamps_ns: npt.NDArray[np.int64], max_gap_ns: int) -> Brackets:
        """The samples around each of `stamps_ns` (n,), at most `max_gap_ns` apart; no extrapolation."""
        last = len(self) - 1
        if last < 0:
            none = np.zeros(len(stamps_ns), np.int64)
            return Brackets(none.astype(np.bool_), none, none)
        found = np.searchsorted(self.stamps_ns, stamps_ns)
        later = np.minimum(found, last)
        exact = self.stamps_ns[later] == stamps_ns
        earlier = np.where(exact, later, np.maximum(later - 1, 0))
        near = self.stamps_ns[later] - self.stamps_ns[earlier] <= max_gap_ns
        if self.broken is not None and last > 0:
            near &= ~self.broken[np.minimum(earlier, last - 1)]
        return Brackets(exact | ((found > 0) & (found <= last) & near), earlier, later)

    def between(
        self, stamps_ns: npt.NDArray[np.int64], earlier: npt.NDArray[np.int64], later: npt.NDArray[np.int64]
    ) -> Pose:
        """(n, 4, 4) poses at `stamps_ns` (n,) interpolated between the rows `earlier` and `later`."""
        start, length = self.stamps_ns[earlier], self.stamps_ns[later] - self.stamps_ns[earlier]
        poses = self.poses[later].copy()
        apart = length > 0
        share = (stamps_ns - start)[apart] / length[apart]
        poses[apart] = interpolate(self.poses[earlier[apart]], poses[apart], share)
        return poses

    def at(self, stamp_ns: int, max_gap_ns: int) -> PoseSample | None:
        """Pose at `stamp_ns` between samples at most `max_gap_ns` apart; None outside them: no extrapolation."""
        stamps = np.array([stamp_ns], np.int64)
        found = self.brackets(stamps, max_gap_ns)
        if not found.known[0]:
            return None
        return PoseSample(self.between(stamps, found.earlier, found.later)[0], int(found.later[0]))
