"""RGB-D frames of the inside of a textured box, cast analytically: exact depth, exact poses."""

import cv2
import numpy as np

from stsem.camera import Camera
from stsem.chance import generator
from stsem.frame import Frame
from stsem.pose import Pose

CAMERA = Camera(320, 240, 260.0, 260.0, 159.5, 119.5)
HALF = np.array([2.0, 1.3, 2.5])
_TEXTURE = cv2.resize(generator(1, "texture").integers(0, 256, (6, 96, 96), np.uint8).transpose(1, 2, 0), (512, 512),
                      interpolation=cv2.INTER_CUBIC)  # fmt: skip


def pose(x: float, y: float, z: float, pan_deg: float = 0.0, tilt_deg: float = 0.0) -> Pose:
    """T_WC of a camera in the box."""
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.radians([0, pan_deg, 0.0]))[0] @ cv2.Rodrigues(np.radians([tilt_deg, 0.0, 0]))[0]
    T[:3, 3] = x, y, z
    return T


def frame(index: int, T_WC: Pose, noise: float = 0.0) -> Frame:
    """What the camera sees; `noise` is the standard deviation of the inverse depth, 1/m."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    rays = np.stack([(u - CAMERA.cx) / CAMERA.fx, (v - CAMERA.cy) / CAMERA.fy, np.ones(u.shape)], axis=-1)
    rays = rays @ T_WC[:3, :3].T
    with np.errstate(divide="ignore"):
        reach = np.where(rays > 0, HALF - T_WC[:3, 3], -HALF - T_WC[:3, 3]) / rays
    axis = np.argmin(reach, axis=-1)
    depth = np.min(reach, axis=-1)
    point = (T_WC[:3, 3] + rays * depth[..., None]) / HALF
    wall = 2 * axis + (np.take_along_axis(rays, axis[..., None], -1)[..., 0] > 0)
    across = np.where(axis == 0, point[..., 1], point[..., 0])
    down = np.where(axis == 2, point[..., 1], point[..., 2])
    grey = _TEXTURE[((down + 1) * 255).clip(0, 511).astype(int), ((across + 1) * 255).clip(0, 511).astype(int), wall]
    inverse_depth = 1 / depth + noise * generator(2, index).standard_normal(depth.shape)
    return Frame(
        index, index * 33_000_000, np.repeat(grey[..., None], 3, axis=2), depth=(1 / inverse_depth).astype(np.float32)
    )


def dark(index: int) -> Frame:
    """What a covered camera sees."""
    size = (CAMERA.height, CAMERA.width)
    return Frame(index, index * 33_000_000, np.zeros((*size, 3), np.uint8), depth=np.full(size, np.nan, np.float32))
