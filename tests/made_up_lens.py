"""Scenes of known colour, labels and depth, as a real lens and as a camera beside it see them, by OpenCV."""

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.pose import Pose, from_quaternion

Array = npt.NDArray[np.float64]
DEPTH = Camera(160, 120, 130.0, 130.0, 79.5, 59.5)
WIDE = Camera(320, 240, 240.0, 241.0, 158.0, 121.0)
SAME = Camera(160, 120, 120.0, 120.5, 80.2, 58.8)
SMALL = Camera(80, 60, 55.0, 55.0, 39.5, 29.5)
RIG = from_quaternion((0.05, -0.01, 0.004), (0.01, -0.015, 0.02, 1.0))
PLANES = (((0.1, -0.05, 1.0), 2.5), ((-0.4, 0.1, 1.0), 2.8), ((0.0, -0.9, 0.6), 1.4))
"""(normal n, d) in the depth camera: n.X = d; what is seen is the nearest."""
PINHOLE = Camera(160, 120, 110.0, 112.0, 81.3, 58.2)
LENSES = [
    ("plumb_bob", (-0.28, 0.09, 0.001, -0.002)),
    ("plumb_bob", (0.12, -0.2, 0.001, -0.0005, 0.05)),
    ("rational_polynomial", (0.6, -2.4, 0.001, -0.0005, 1.4, 0.5, -2.2, 1.35)),
    ("rational_polynomial", (-0.1, 0.02, 0.0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.002, 0.0, -0.001, 0.0)),
    ("rational_polynomial", (-0.1, 0.02, 0.0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.002, 0.0, -0.001, 0.0, 0.01, -0.02)),
    ("equidistant", (-0.02, 0.01, -0.004, 0.0005)),
    ("equidistant", (0.0, 0.0, 0.0, 0.0)),
]


def lens(model: str, d: tuple[float, ...]) -> Camera:
    return replace(PINHOLE, model=model, distortion=d)


def rays_of(camera: Camera) -> Array:
    """(H, W, 2) x/z and y/z that each pixel of a distorted camera sees, by OpenCV's inverse."""
    y, x = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    pixels = np.stack([x, y], axis=-1).reshape(-1, 1, 2)
    d = np.array(camera.distortion)
    if camera.model == "equidistant":
        rays = cv2.fisheye.undistortPoints(pixels, camera.K, d)
    else:
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
        rays = cv2.undistortPoints(pixels, camera.K, d, criteria=criteria)
    return np.asarray(rays).reshape(camera.height, camera.width, 2)


def projected(camera: Camera, rays: Array) -> Array:
    """(..., 2) pixels of rays, by OpenCV's forward model."""
    points = np.concatenate([rays, np.ones((*rays.shape[:-1], 1))], axis=-1).reshape(-1, 1, 3)
    project = cv2.fisheye.projectPoints if camera.model == "equidistant" else None
    zero, d = np.zeros(3), np.array(camera.distortion)
    if project:
        pixels, _ = project(points, zero, zero, camera.K, d)
    else:
        pixels, _ = cv2.projectPoints(points, zero, zero, camera.K, d)
    return np.asarray(pixels).reshape(rays.shape)


def scene(rays: Array) -> tuple[Array, npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
    """(smooth colour, labels in squares, depth of a slanted plane) that rays (..., 2) see."""
    x, y = rays[..., 0], rays[..., 1]
    colour = np.stack([127 + 120 * np.sin(9 * x), 127 + 120 * np.cos(7 * y), 127 + 100 * np.sin(5 * (x + y))], -1)
    labels = (np.floor(x * 8) + 3 * np.floor(y * 8)) % 7
    return colour, labels.astype(np.uint8), (2 / (1 - 0.3 * x - 0.2 * y)).astype(np.float32)


def pinhole_rays(camera: Camera) -> Array:
    y, x = np.mgrid[: camera.height, : camera.width]
    return np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy], axis=-1)


def steady(labels: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    """(H, W) pixels more than a pixel away from a border between labels."""
    shifts = ((0, 1), (1, 0), (0, -1), (-1, 0))
    return np.asarray(np.all([np.roll(labels, shift, (0, 1)) == labels for shift in shifts], axis=0))


def planes_seen(camera: Camera, T_camera_depth: Pose) -> Array:
    """(H, W) analytic depth of the nearest of PLANES in front of a camera."""
    y, x = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones(x.shape)], axis=-1)
    depths = []
    for normal, distance in PLANES:
        n = T_camera_depth[:3, :3] @ np.array(normal)
        with np.errstate(divide="ignore"):
            z = (distance + n @ T_camera_depth[:3, 3]) / (rays @ n)
        depths.append(np.where(z > 0, z, np.inf))
    return np.asarray(np.min(depths, axis=0))
