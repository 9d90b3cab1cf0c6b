"""Whether a matrix from a file is a pose."""

import numpy as np

from stsem.pose import Pose


def is_rigid(pose: Pose, tolerance: float = 1e-2) -> bool:
    """Whether a (4, 4) matrix is finite and its upper left part a rotation, but for rounding."""
    R = pose[:3, :3]
    if not np.isfinite(pose).all() or abs(R).max() > 2:
        return False
    return bool(abs(R @ R.T - np.eye(3)).max() < tolerance and np.linalg.det(R) > 0)
