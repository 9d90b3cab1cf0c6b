"""A room of planes seen by a camera that moves and turns evenly: colours, labels, depth and poses by formula.

World: x east, y north, z up, metres. Everything follows from the intersection of rays with planes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
import numpy.typing as npt
from encoders_ros import NS

from stsem.camera import Camera
from stsem.classes import NO_LABEL
from stsem.pose import Pose, to_quaternion
from tests.made_up_lens import rays_of

Array = npt.NDArray[np.float64]
Link = tuple[str, str, tuple[float, float, float], tuple[float, float, float, float]]

CLASSES = ("wall", "floor", "ceiling", "door", "window", "cabinet")
WALL, FLOOR, CEILING, DOOR, WINDOW, CABINET = range(6)
COLOURS = ((205, 200, 190), (140, 110, 85), (225, 225, 230), (150, 95, 60), (165, 190, 215), (95, 120, 135))
"""Of the label images that are colours, and about what the surfaces look like."""
START_NS = 1_700_000_000 * NS
PERIOD_NS = 100_000_000
HALF_NS = PERIOD_NS // 2

ROOM = np.array([[-0.013, -0.017, 0.0], [4.031, 3.529, 2.513]])
BOX = np.array([[1.71, 2.33, 0.0], [2.47, 2.91, 1.13]])
"""Two opposite corners each: of the room, and of the cabinet in it."""
CAMERA = Camera(64, 48, 58.0, 57.5, 32.2, 23.1)
SPEED = np.array([0.35, 0.12, 0.0])
TURN_RATE = -0.35
"""m/s and rad/s, about the vertical."""
BASE_CAMERA: Pose = np.array(
    [[0.0, -np.sin(0.25), np.cos(0.25), 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -np.cos(0.25), -np.sin(0.25), 1.21],
     [0.0, 0.0, 0.0, 1.0]]
)  # fmt: skip
"""T_base_camera: 1.21 m above the floor, looking ahead and a little down; optical axes."""


@dataclass(frozen=True, eq=False)
class View:
    """What a camera sees.

    Args:
        rgb: (H, W, 3) uint8.
        mm: (H, W) uint16 along the optical axis; 0 unknown: nothing comes back from the window.
        labels: (H, W) uint8 in CLASSES; 255 on the poster, which nobody labelled.
    """

    rgb: npt.NDArray[np.uint8]
    mm: npt.NDArray[np.uint16]
    labels: npt.NDArray[np.uint8]

    @property
    def metres(self) -> npt.NDArray[np.float32]:
        """(H, W), NaN unknown."""
        return np.where(self.mm > 0, self.mm / 1000.0, np.nan).astype(np.float32)


@dataclass(frozen=True)
class Scene:
    """The recorded walk.

    Args:
        camera: of the images; its lens, where it has one, bends what it sees.
        start_ns: stamp of the first image.
        frames: at 10 Hz.
        pause_ns: that the recorder makes in the middle, while nothing moves on.
        labelled: log indices of the frames with truth; None for all.
        poster: whether a part of the wall is not labelled.
    """

    camera: Camera = CAMERA
    start_ns: int = START_NS
    frames: int = 12
    pause_ns: int = 0
    labelled: tuple[int, ...] | None = None
    poster: bool = True

    def stamp_ns(self, i: int) -> int:
        """Stamp of image `i`."""
        return self.start_ns + i * PERIOD_NS + (self.pause_ns if 2 * i >= self.frames else 0)

    def has_truth(self, i: int) -> bool:
        """Whether image `i` is labelled."""
        return self.labelled is None or i in self.labelled

    @property
    def views(self) -> tuple[View, ...]:
        """Of every image."""
        return _views(self.camera, self.frames, self.poster)

    @property
    def straight(self) -> "Scene":
        """The same without a lens."""
        return replace(self, camera=replace(self.camera, distortion=(), model=""))

    @cached_property
    def samples(self) -> tuple[tuple[int, Pose], ...]:
        """(stamp, T_W_base) half a period before and behind every image: linear motion interpolates exactly."""
        found = {self.stamp_ns(i) + k * HALF_NS: i + 0.5 * k for i in range(self.frames) for k in (-1, 1)}
        return tuple((stamp, base_pose(time)) for stamp, time in sorted(found.items()))


@cache
def _views(camera: Camera, frames: int, poster: bool) -> tuple[View, ...]:
    return tuple(seen(camera, camera_pose(i), poster) for i in range(frames))


def base_pose(i: float) -> Pose:
    """T_W_base at `i` periods from the first image."""
    seconds = i * PERIOD_NS / NS
    angle = 1.31 + TURN_RATE * seconds
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    pose[:3, 3] = np.array([1.213, 0.417, 0.0]) + SPEED * seconds
    return pose


def camera_pose(i: float) -> Pose:
    """T_WC at `i` periods from the first image."""
    return base_pose(i) @ BASE_CAMERA


def link(parent: str, child: str, pose: Pose) -> Link:
    """A transform as the encoders take it."""
    x, y, z = pose[:3, 3].tolist()
    a, b, c, w = to_quaternion(pose).tolist()
    return parent, child, (x, y, z), (a, b, c, w)


def seen(camera: Camera, T_WC: Pose, poster: bool = True) -> View:
    """What `camera` sees from `T_WC`."""
    x, y = np.moveaxis(rays_of(camera), -1, 0) if camera.is_distorted else _pinhole(camera)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ T_WC[:3, :3].T
    origin = T_WC[:3, 3]
    depth, axis = _room(origin, rays)
    cabinet = _cabinet(origin, rays)
    in_front = cabinet < depth
    depth = np.where(in_front, cabinet, depth)
    points = origin + depth[..., None] * rays
    labels = np.where(in_front, CABINET, _on_room(points, axis)).astype(np.uint8)
    mm = np.where(labels == WINDOW, 0, np.rint(1000 * depth)).astype(np.uint16)
    truth = np.where(_on_poster(points, axis) & ~in_front & poster, NO_LABEL, labels).astype(np.uint8)
    return View(_painted(points, labels), mm, truth)


def _pinhole(camera: Camera) -> Array:
    v, u = np.mgrid[: camera.height, : camera.width]
    return np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy])


def _room(origin: Array, rays: Array) -> tuple[Array, npt.NDArray[np.intp]]:
    """((H, W) depth of the room's walls from inside, the axis that the wall hit stands on)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = np.where(rays > 0, ROOM[1] - origin, ROOM[0] - origin) / rays
    depths = np.where(np.isfinite(depths), depths, np.inf)
    return depths.min(axis=-1), depths.argmin(axis=-1)


def _cabinet(origin: Array, rays: Array) -> Array:
    """(H, W) depth of the cabinet from outside; infinite beside it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (BOX[0] - origin) / rays, (BOX[1] - origin) / rays
    enter, leave = np.minimum(low, high).max(axis=-1), np.maximum(low, high).min(axis=-1)
    return np.where((enter < leave) & (enter > 0), enter, np.inf)


def _on_room(points: Array, axis: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
    x, y, z = np.moveaxis(points, -1, 0)
    north, east = (axis == 1) & (y > 2), (axis == 0) & (x > 2)
    on_door = north & (x > 0.4) & (x < 1.3) & (z < 2.05)
    on_window = east & (y > 1.6) & (y < 2.9) & (z > 0.9) & (z < 1.9)
    level = np.where(z < 1, FLOOR, CEILING)
    return np.select([on_door, on_window, axis == 2], [DOOR, WINDOW, level], WALL)


def _on_poster(points: Array, axis: npt.NDArray[np.intp]) -> npt.NDArray[np.bool_]:
    x, y, z = np.moveaxis(points, -1, 0)
    return (axis == 1) & (y > 3.4) & (x > 2.6) & (x < 3.2) & (z > 1.2) & (z < 1.8)


def _painted(points: Array, labels: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Each class in its colour, under waves long enough for 4:2:0, mosaics and jpeg."""
    x, y, z = np.moveaxis(points, -1, 0)
    waves: Sequence[Array] = [np.sin(4.1 * x + 2.3 * z), np.cos(3.7 * y - 2.9 * z), np.sin(3.1 * (x + y) + 1.9 * z)]
    colours = np.array(COLOURS, np.float64)[labels] + 20 * np.stack(waves, axis=-1)
    return np.asarray(np.rint(colours.clip(20, 235)), np.uint8)
