"""From what is there to what a camera records: exposure and grain of colour, and the faults of a Kinect's depth."""

import cv2
import numpy as np
import numpy.typing as npt

from stsem.errors import UsageError
from stsem.frame import Depth, Image
from stsem.synth.mesh import F32

NOISES = ("kinect", "none")
_GAMMA = 1 / 2.2
_GRAIN = 1.0
_NEAREST_M, _FARTHEST_M = 0.45, 8.0
_BASELINE_M = 0.075
_DISPARITY_STEPS = 8.0
_REFERENCE_FOCAL = 585.0 / 640.0
_GRAZING = 0.10
_EDGE_JUMP = 0.04


def check_noise(noise: str) -> None:
    """Raise UsageError unless `noise` is one of NOISES."""
    if noise not in NOISES:
        raise UsageError(f"There is no depth noise {noise!r}; give {' or '.join(NOISES)}.")


def expose(radiance: F32, gain: float, rng: np.random.Generator | None) -> Image:
    """(H, W, 3) uint8 RGB from linear radiance; `rng` adds grain, in proportion to the square root of the signal."""
    linear = np.clip(radiance * np.float32(gain), 0.0, 1.0)
    levels = 255 * linear**_GAMMA
    if rng is not None:
        levels += rng.standard_normal(levels.shape, np.float32) * np.float32(_GRAIN)
    return np.asarray(np.clip(np.rint(levels), 0, 255), np.uint8)


def millimetres(depth: Depth) -> npt.NDArray[np.uint16]:
    """(H, W) uint16 from metres; 0 where unknown or beyond 65 m."""
    known = np.isfinite(depth) & (depth > 0) & (depth < 65.0)
    return np.where(known, np.rint(np.where(known, depth, 0) * 1000), 0).astype(np.uint16)


def kinect(depth: Depth, focal_px: float, rng: np.random.Generator) -> Depth:
    """Depth (H, W) as a structured-light camera would measure it, metres, NaN unknown.

    Axial noise sigma(z) = 0.0012 + 0.0019 (z - 0.4)^2 (Nguyen, Izadi, Lovell 2012, equation 3), mixed depths at edges
    ("flying pixels"), disparity in eighths of a pixel, and holes: out of range, at grazing incidence, and where the
    projector, 7.5 cm to the side, is hidden.
    """
    height, width = depth.shape
    z = depth.astype(np.float32)
    hidden = _projector_hidden(z, focal_px) | _grazing(z, focal_px)
    z = _flying(z, rng)
    sigma = 0.0012 + 0.0019 * (z - 0.4) ** 2
    z = z + sigma * _correlated(width, height, rng)
    scale = np.float32(_REFERENCE_FOCAL * 640 * _BASELINE_M * _DISPARITY_STEPS)
    z = np.asarray(scale / np.maximum(np.rint(scale / np.maximum(z, 0.1)), 1), np.float32)
    bad = hidden | (z < _NEAREST_M) | (z > _FARTHEST_M)
    return np.where(bad, np.float32(np.nan), z).astype(np.float32)


def _correlated(width: int, height: int, rng: np.random.Generator) -> F32:
    """(H, W) noise of unit variance that neighbours share, as the camera's matching windows do."""
    coarse = rng.standard_normal((height // 4 + 1, width // 4 + 1), np.float32)
    fine = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(fine * np.float32(1.49), np.float32)


def _projector_hidden(z: F32, focal_px: float) -> npt.NDArray[np.bool_]:
    """Pixels that a nearer surface to their left hides from the projector: its column shifts by f b / z."""
    columns = np.arange(z.shape[1], dtype=np.float32)[None, :] + np.float32(focal_px * _BASELINE_M) / z
    reached = np.maximum.accumulate(columns, axis=1)
    return np.asarray(columns < reached - 1.0)


def _grazing(z: F32, focal_px: float) -> npt.NDArray[np.bool_]:
    """Pixels whose surface is seen at less than about six degrees.

    The slope is the smaller one of the two towards the neighbours, so that an edge does not count as a slope.
    """
    slope_x, slope_y = (_slope(z, axis) * focal_px / z for axis in (1, 0))
    return np.asarray(1 / np.sqrt(1 + slope_x**2 + slope_y**2) < _GRAZING)


def _slope(z: F32, axis: int) -> F32:
    """(H, W) smaller of the two differences to the neighbours along `axis`, metres a pixel."""
    step = np.abs(np.diff(z, axis=axis))
    pad = ((1, 0), (0, 0)) if axis == 0 else ((0, 0), (1, 0))
    back = ((0, 1), (0, 0)) if axis == 0 else ((0, 0), (0, 1))
    return np.asarray(np.minimum(np.pad(step, pad, mode="edge"), np.pad(step, back, mode="edge")), np.float32)


def _flying(z: F32, rng: np.random.Generator) -> F32:
    """At every third edge pixel the depth of a point somewhere between the two surfaces."""
    result = z.copy()
    for axis in (0, 1):
        other = np.roll(z, 1, axis)
        edge = np.abs(z - other) > _EDGE_JUMP * np.minimum(z, other)
        index = (slice(0, 1), slice(None)) if axis == 0 else (slice(None), slice(0, 1))
        edge[index] = False
        mixed = edge & (rng.random(z.shape, np.float32) < 1 / 3)
        share = rng.random(z.shape, np.float32)
        result = np.where(mixed, share * z + (1 - share) * other, result)
    return result
