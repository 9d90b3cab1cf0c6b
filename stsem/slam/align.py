"""Alignment of depth to depth: projective point-to-plane ICP (Chen and Medioni 1992; Newcombe et al. 2011, eq. 16-22).

The unknown is the pose T_WC of the camera; a step moves it in its own axes, T <- T exp(xi), xi = (translation,
rotation). So several keyframes add up in one system, and the matrix is the information of an edge to this camera.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from stsem.pose import Pose, inverse
from stsem.slam.planes import F32, PlaneGrid, transformed
from stsem.slam.rotations import exponential, logarithm

F64 = npt.NDArray[np.float64]

SIGMA = 0.01
"""Largest standard deviation of a cell's inverse depth, 1/m: noise, quantisation and what calibration leaves."""
FLOOR_M = 0.0005
"""Added to the standard deviation of the distance to a plane: without it those seen edge-on outweigh all others."""
TUKEY = 4.685
"""Residuals, in standard deviations as found, from which a point does not count: people walk, doors move."""
FINEST = 0.1
"""The least standard deviation that is believed, as a share of SIGMA."""
USUAL = 0.3
"""The standard deviation of most, as a share of SIGMA, with which points and depth are weighed against each other."""
HELD = 0.5
"""Information of a direction that outliers may take with them before they are left out."""
GATE = 0.05
"""Relative difference of inverse depth up to which a point may belong to a plane."""
CORRELATED = 2.0
"""Points, of every second cell, whose errors are one and the same: neighbours share the camera's distortion."""
SETTLED = 1e-4
"""Metres and radians below which a step is the last."""
SLICE = 256
"""Points per matrix product: small enough that BLAS never splits one between threads."""


@dataclass(frozen=True, eq=False)
class Reference:
    """What a camera is aligned to.

    Args:
        T_WC: (4, 4), its pose.
        grid: its planes.
    """

    T_WC: Pose
    grid: PlaneGrid


class Opinion(Protocol):
    """What else than depth says where the camera is."""

    def system(self, T_WC: Pose) -> tuple[F64, F64]:
        """Information (6, 6) and gradient (6,) at a pose, as those of `Agreement`."""


@dataclass(frozen=True, eq=False)
class Prior:
    """A pose already known, and its information (6, 6) in the axes of the camera."""

    T_WC: Pose
    information: F64

    def system(self, T_WC: Pose) -> tuple[F64, F64]:
        """Information (6, 6) and gradient (6,) at a pose."""
        return self.information, self.information @ difference(self.T_WC, T_WC)


@dataclass(frozen=True, eq=False)
class Agreement:
    """How points agree with the planes of one reference at one pose.

    Args:
        information: (6, 6) of the pose, in the axes of the camera: 1/m^2 and 1/rad^2.
        gradient: (6,) information times the step that would undo the residuals, negated.
        share: of the points that met a plane near them, 0..1.
        residual: median distance of those, in standard deviations; inf without any.
    """

    information: F64
    gradient: F64
    share: float
    residual: float


@dataclass(frozen=True, eq=False)
class Aligned:
    """A pose, and how it agrees with each of the references (before the last step, which is small)."""

    T_WC: Pose
    agreements: tuple[Agreement, ...]

    @property
    def agreement(self) -> Agreement:
        """That with the first reference."""
        return self.agreements[0]


def align(
    points: Sequence[tuple[F32, int]], references: Sequence[Reference], start: Pose, opinion: Opinion | None = None
) -> Aligned:
    """The pose at which points lie on the planes of the references.

    Args:
        points: rounds from coarse to fine, ((n, 3) points in the camera, largest number of steps) each; at least one.
        references: at least one.
        start: (4, 4) T_WC to begin at.
        opinion: counts where the planes do not say, as along a wall.
    """
    pose, found = start, list[Agreement]()
    for xyz, steps in points:
        for _ in range(steps):
            found = [agreement(xyz, reference, pose) for reference in references]
            information = np.sum([one.information for one in found], axis=0)
            gradient = np.sum([one.gradient for one in found], axis=0)
            if opinion is not None:
                more = opinion.system(pose)
                information, gradient = information + more[0], gradient + more[1]
            step = -np.linalg.solve(information + np.eye(6), gradient)
            pose = moved(pose, step)
            if np.abs(step).max() < SETTLED:
                break
    return Aligned(pose, tuple(found))


def shared(xyz: F32, reference: Reference, T_WC: Pose) -> float:
    """Share of the points (n, 3) of a camera at `T_WC` that meet a plane of the reference near them, 0..1."""
    return len(_met(xyz, reference, T_WC)[0]) / max(1, len(xyz))


def agreement(xyz: F32, reference: Reference, T_WC: Pose) -> Agreement:
    """How points (n, 3) of a camera at `T_WC` agree with the planes of a reference."""
    rows, planes, there, T = _met(xyz, reference, T_WC)
    if not len(rows):
        return Agreement(np.zeros((6, 6)), np.zeros(6), 0.0, np.inf)
    nx, ny, nz, d = (planes[:, k] for k in range(4))
    qx, qy, z = (there[:, k].take(rows) for k in range(3))
    sigma = np.float32(SIGMA) * d * z + np.float32(FLOOR_M)
    residual = nx * qx + ny * qy + nz * z - d
    size = np.abs(residual) / sigma
    typical = float(np.partition(size, len(size) // 2)[len(size) // 2])
    weight = np.float32(1) / (sigma * sigma * np.float32(CORRELATED * USUAL**2))
    normal = [nx * T[0, k] + ny * T[1, k] + nz * T[2, k] for k in range(3)]
    equations = _equations([xyz[:, k].take(rows) for k in range(3)], normal, residual)
    system, robust = _summed(equations, weight), _summed(equations, weight * _biweight(size, typical))
    if _leans_on_outliers(system[:6, :6], robust[:6, :6]):
        system = robust
    return Agreement(system[:6, :6], system[:6, 6], len(rows) / len(xyz), typical)


def moved(pose: Pose, step: F64) -> Pose:
    """T exp(step), with the rotation exact and the translation of first order."""
    result = pose.copy()
    result[:3, 3] += pose[:3, :3] @ step[:3]
    R = pose[:3, :3] @ exponential(step[None, 3:])[0]
    # A step of Newton to the nearest rotation: predictions square what rounding leaves, frame after frame.
    result[:3, :3] = R @ (1.5 * np.eye(3) - 0.5 * R.T @ R)
    return result


def difference(origin: Pose, pose: Pose) -> F64:
    """(6,) the step in the axes of `pose` that leads from `origin` to it; the inverse of `moved` for small ones."""
    turn = origin[:3, :3].T @ pose[:3, :3]
    return np.concatenate([pose[:3, :3].T @ (pose[:3, 3] - origin[:3, 3]), logarithm(turn[None])[0]])


def _met(xyz: F32, reference: Reference, T_WC: Pose) -> tuple[npt.NDArray[np.intp], F32, F32, F32]:
    """(rows of points that meet a plane (m,), the planes (m, 5), all points in the reference (n, 3), T (4, 4))."""
    T = (inverse(reference.T_WC) @ T_WC).astype(np.float32)
    there = transformed(xyz, T)
    rows, cells = reference.grid.cells(there)
    inverse_depth = reference.grid.planes[:, 4].take(cells)
    near = np.flatnonzero((inverse_depth > 0) & (np.abs(inverse_depth * there[:, 2].take(rows) - 1) < GATE))
    planes = reference.grid.planes.take(cells.take(near), axis=0)
    return rows.take(near), np.asarray(planes.T.copy().T), there, T


def _biweight(size: F32, typical: float) -> F32:
    """Tukey's biweight of residuals in units of SIGMA; their scale is that of the median."""
    scale = np.float32(np.clip(1.4826 * typical, FINEST, 1.0))
    inside = np.maximum(np.float32(0), 1 - np.square(size / (np.float32(TUKEY) * scale)))
    return np.asarray(inside * inside, np.float32)


def _leans_on_outliers(whole: F64, robust: F64) -> bool:
    """Whether some direction of the pose loses so much of its information with the outliers.

    A person who walks along a corridor is then all that holds the camera. Elsewhere every point counts: tails that are
    the sensor's own distortion pull to all sides, and leaving them out puts drift in their place.
    """
    try:
        np.linalg.cholesky(robust - HELD * whole + np.eye(6))  # exists where every direction keeps more than HELD
    except np.linalg.LinAlgError:
        return True
    return False


def _equations(p: list[F32], n: list[F32], residual: F32) -> F32:
    """(slices, 7, SLICE) J^T = (n, p x n, residual) of the points, filled up with zeros."""
    slices = -(-len(residual) // SLICE)
    J = np.zeros((7, slices * SLICE), np.float32)
    columns = J[:, : len(residual)]
    columns[:3] = n
    columns[3] = p[1] * n[2] - p[2] * n[1]
    columns[4] = p[2] * n[0] - p[0] * n[2]
    columns[5] = p[0] * n[1] - p[1] * n[0]
    columns[6] = residual
    return J.reshape(7, slices, SLICE).swapaxes(0, 1)


def _summed(equations: F32, weight: F32) -> F64:
    """(7, 7) J^T W J, summed in slices in a fixed order."""
    slices = len(equations)
    weights = np.zeros((slices, 1, SLICE), np.float32)
    weights.reshape(-1)[: len(weight)] = weight
    products = (equations * weights) @ equations.swapaxes(1, 2)
    total: F64 = products.astype(np.float64).sum(axis=0)
    return total
