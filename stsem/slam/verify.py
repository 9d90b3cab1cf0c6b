"""Whether two views show the same place, and from where: points matched, pose solved, depth compared everywhere."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.pose import Pose, inverse
from stsem.slam.align import Prior, Reference, align
from stsem.slam.landmarks import Landmarks
from stsem.slam.planes import F32, PlaneGrid
from stsem.slam.posegraph import moved
from stsem.slam.rotations import F64, skew

MAX_RATIO = 0.85
MIN_INLIERS = 25
MIN_INLIER_SHARE = 0.3
REPROJECTION_PX = 4.0
PIXEL_SIGMA = 1.5
ICP_STEPS = 8
GRID_STEP = 3
"""Every third cell of the grid, across and down, is compared."""
MIN_OVERLAP = 0.25
MIN_AGREEMENT = 0.7
DEPTH_TOLERANCE = 0.04
TRANSLATION_FLOOR_M, ROTATION_FLOOR_RAD = 0.005, 0.003
"""Errors that more points do not average away: calibration, delays, the mean of the depth's noise."""


@dataclass(frozen=True, eq=False)
class View:
    """What a keyframe keeps to be found again.

    Args:
        landmarks: its points.
        grid: its depth.
        camera: of both, without distortion.
    """

    landmarks: Landmarks
    grid: PlaneGrid
    camera: Camera


@dataclass(frozen=True, eq=False)
class Match:
    """A place recognised.

    Args:
        T: (4, 4) pose of the current view in the earlier one.
        information: (6, 6) of T as a pose-graph edge from the earlier to the current view.
        inliers: points that agree.
        overlap: share of the earlier view's depth that falls on depth of the current one.
        agreement: share of it where both measure the same surface.
    """

    T: Pose
    information: F64
    inliers: int
    overlap: float
    agreement: float


def verify(earlier: View, current: View, *, seed: int) -> Match | None:
    """The pose of `current` in `earlier`, if points and depth leave no doubt; None otherwise.

    Args:
        earlier, current: two views with depth.
        seed: of this job, 0 to 2^31 - 1 (`chance.hash31`).
    """
    before, now = earlier.landmarks, current.landmarks
    rows, partners = _matches(before.descriptors, now.descriptors)
    known = np.isfinite(before.xyz[rows, 2])
    rows, partners = rows[known], partners[known]
    if len(rows) < MIN_INLIERS:
        return None
    solved = _solve(before.xyz[rows].astype(np.float64), now.xy[partners], current.camera, seed)
    if solved is None or len(solved[1]) < max(MIN_INLIERS, MIN_INLIER_SHARE * len(rows)):
        return None
    rows, partners = rows[solved[1]], partners[solved[1]]
    source, target, seen = before.xyz[rows].astype(np.float64), now.xyz[partners].astype(np.float64), now.xy[partners]
    T = _refined_on_depth(earlier, current, *_refined(solved[0], source, target, seen, current.camera))
    overlap, agreement = depth_agreement(earlier.grid, current.grid, T[0])
    if overlap < MIN_OVERLAP or agreement < MIN_AGREEMENT:
        return None
    return Match(*T, len(rows), overlap, agreement)


def depth_agreement(earlier: PlaneGrid, current: PlaneGrid, T: Pose) -> tuple[float, float]:
    """Overlap and agreement of two views' depth, T (4, 4) the pose of `current` in `earlier`.

    Overlap: points of `earlier` that fall on known depth of `current`, over all its points. Agreement: those of them
    whose inverse depth is what `current` measured there; a nearer surface (it hides the point) and a farther one (the
    point is gone) both count against it.
    """
    points = earlier.points(GRID_STEP)
    back = inverse(T)
    there = (points @ back[:3, :3].T + back[:3, 3]).astype(np.float32)
    rows, cells = current.cells(there)
    seen = current.planes[cells, 4]
    rows, seen = rows[seen > 0], seen[seen > 0]
    if not len(rows):
        return 0.0, 0.0
    same = np.abs(seen * there[rows, 2] - 1) <= DEPTH_TOLERANCE
    return float(len(rows) / len(points)), float(same.mean())


def _refined_on_depth(earlier: View, current: View, T: Pose, information: F64) -> tuple[Pose, F64]:
    """The pose of an edge and its information, after alignment of depth to depth; the points' fit is the prior."""
    rounds: list[tuple[F32, int]] = [(current.grid.points(step), ICP_STEPS) for step in (4, 2)]
    found = align(rounds, [Reference(np.eye(4), earlier.grid)], T, Prior(T, information))
    floor = np.diag([TRANSLATION_FLOOR_M**2] * 3 + [ROTATION_FLOOR_RAD**2] * 3)
    total = np.linalg.inv(np.linalg.inv(found.agreement.information + information) + floor)
    return found.T_WC, np.asarray((total + total.T) / 2)


def _matches(a: npt.NDArray[np.uint8], b: npt.NDArray[np.uint8]) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Rows of `a` and of `b` that are each other's nearest, and clearly nearer than the second (Lowe 2004)."""
    if len(a) < 2 or len(b) < 2:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    distance, nearest = cv2.batchDistance(a, b, dtype=cv2.CV_32S, normType=cv2.NORM_HAMMING, K=2)
    good = np.flatnonzero(distance[:, 0] < MAX_RATIO * distance[:, 1])
    partners = nearest[good, 0].astype(np.intp)
    if not len(good):
        return good, partners
    _, back = cv2.batchDistance(b[partners], a, dtype=cv2.CV_32S, normType=cv2.NORM_HAMMING, K=1)
    mutual = back[:, 0] == good
    return good[mutual], partners[mutual]


def _solve(
    points: F64, xy: npt.NDArray[np.float32], camera: Camera, seed: int
) -> tuple[Pose, npt.NDArray[np.intp]] | None:
    """Pose (4, 4) of the points' frame in the camera by PnP in random samples, and the rows that agree."""
    params = cv2.UsacParams()
    params.confidence, params.maxIterations, params.threshold = 0.999, 500, REPROJECTION_PX
    params.isParallel, params.randomGeneratorState = False, seed
    params.sampler, params.score = cv2.SAMPLING_UNIFORM, cv2.SCORE_METHOD_MSAC
    params.loMethod = cv2.LOCAL_OPTIM_INNER_LO
    try:
        found, _, rotation, translation, inliers = cv2.solvePnPRansac(
            points, xy.astype(np.float64), camera.K, None, params=params
        )
    except cv2.error:  # degenerate points
        return None
    if not found or inliers is None or not (np.isfinite(rotation).all() and np.isfinite(translation).all()):
        return None
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = cv2.Rodrigues(rotation)[0], translation.ravel()
    return T, inliers.ravel().astype(np.intp)


def _refined(T: Pose, source: F64, target: F64, xy: npt.NDArray[np.float32], camera: Camera) -> tuple[Pose, F64]:
    """The pose of the current view in the earlier one after Gauss-Newton on pixels and depth, and its information.

    Args:
        T: earlier in current, to start from.
        source: (n, 3) points of the earlier view.
        target: (n, 3) the same as the current view measures them, NaN without depth.
        xy: (n, 2) pixels of the current view.
        camera: of the current view.
    """
    sigma_z = 0.0012 + 0.0019 * (target[:, 2] - 0.4) ** 2  # Nguyen, Izadi, Lovell 2012, equation 3
    weight_z = np.where(np.isfinite(target[:, 2]), 1 / np.hypot(np.nan_to_num(sigma_z, nan=1.0), 0.005), 0.0)
    wanted = np.column_stack([xy / PIXEL_SIGMA, np.nan_to_num(target[:, 2]) * weight_z])
    hessian = np.eye(6)
    for _ in range(6):
        p = source @ T[:3, :3].T + T[:3, 3]
        z = np.maximum(p[:, 2], 0.1)
        pixel = np.column_stack([camera.fx * p[:, 0] / z + camera.cx, camera.fy * p[:, 1] / z + camera.cy])
        r = np.column_stack([pixel / PIXEL_SIGMA, p[:, 2] * weight_z]) - wanted
        of_point = np.zeros((len(p), 3, 3))
        of_point[:, 0, 0], of_point[:, 0, 2] = camera.fx / z, -camera.fx * p[:, 0] / z**2
        of_point[:, 1, 1], of_point[:, 1, 2] = camera.fy / z, -camera.fy * p[:, 1] / z**2
        of_point[:, :2] /= PIXEL_SIGMA
        of_point[:, 2, 2] = weight_z
        turned = of_point @ T[:3, :3]
        J = np.concatenate([turned, -turned @ skew(source)], axis=2)  # steps t + R d, R exp(w)
        size = np.sqrt((r * r).sum(axis=1))
        robust = np.minimum(1.0, 3.0 / np.maximum(size, 1e-12))  # Huber
        weighted = J * robust[:, None, None]
        hessian = np.einsum("nki,nkj->ij", weighted, J) + 1e-6 * np.eye(6)
        step = -np.linalg.solve(hessian, np.einsum("nki,nk->i", weighted, r))
        T = moved(T[None], step[None])[0]
        if np.abs(step).max() < 1e-6:
            break
    return _as_edge(T, hessian)


def _as_edge(T: Pose, hessian: F64) -> tuple[Pose, F64]:
    """T^-1 and its information (6, 6), from T and the Hessian of its steps.

    A step of T moves its inverse from the other side, so that the adjoint of T brings it into the axes of the edge.
    """
    R = T[:3, :3]
    adjoint = np.block([[R, skew(T[:3, 3]) @ R], [np.zeros((3, 3)), R]])
    information = np.linalg.inv(adjoint @ np.linalg.inv(hessian) @ adjoint.T)
    return inverse(T), np.asarray((information + information.T) / 2)
