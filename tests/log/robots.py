"""A robot in good health, whose log the doctor has nothing to say about; tests change one thing at a time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from encoders_ros import LEVEL, Array, Link
from made_up_logs import BASE_NS, PERIOD_NS, ROS, Recorder, label_picture, picture

MS = 1_000_000
FRAMES = 24
WIDTH, HEIGHT = 32, 24
K = (30.0, 0, 15.5, 0, 30, 11.5, 0, 0, 1)
IMAGE, INFO, TF = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage"
POSE, ODOMETRY, LABELS = "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Odometry", "vision_msgs/msg/LabelInfo"
NAMES = {0: "wall", 1: "floor", 2: "door"}
Put = Callable[[Recorder], None]


def depth_picture(i: int) -> Array:
    """(H, W) millimetres, with a few holes."""
    depth = np.full((HEIGHT, WIDTH), 1000 + i, "<u2")
    depth[0, :2] = 0, 65535
    return depth


def stamp_of(i: int) -> int:
    """10 Hz."""
    return BASE_NS + i * PERIOD_NS


def info(stamp_ns: int, **changes: Any) -> bytes:
    """A calibration."""
    given = {"width": WIDTH, "height": HEIGHT, "k": K} | changes
    payload: bytes = ROS.camera_info(stamp_ns, **given)
    return payload


def drive(parent: str = "world", child: str = "base", at: Callable[[float], float] = lambda x: x) -> Put:
    """Transforms at 20 Hz, 0.2 m/s along y."""

    def put(log: Recorder) -> None:
        for j in range(-1, 2 * FRAMES + 1):
            stamp = BASE_NS + j * PERIOD_NS // 2
            link: Link = (parent, child, (0.0, at(0.01 * j), 0.0), LEVEL)
            log.ros("/tf", TF, ROS.tf(stamp, [link]), stamp + 2 * MS)

    return put


def mount(parent: str = "base", child: str = "camera") -> Put:
    """The static transform to the camera."""
    return lambda log: log.ros("/tf_static", TF, ROS.tf(BASE_NS, [(parent, child, (0.0, 0.0, 0.5), LEVEL)]), BASE_NS)


def nothing(_: Recorder) -> None:
    """No messages."""


@dataclass(frozen=True)
class Robot:
    """What is recorded: images and stamps by the number of the frame; None for no message.

    Args:
        stamp, color_stamp, color_log: of the colour image: when it was taken, its stamp, its log time.
        poses, others: put whole channels.
    """

    stamp: Callable[[int], int] = stamp_of
    color: Callable[[int], Array] = picture
    color_frame: str = "camera"
    color_stamp: Callable[[int], int] = lambda stamp: stamp
    color_log: Callable[[int], int] = lambda stamp: stamp + 5 * MS
    depth: Callable[[int], Array | None] = depth_picture
    depth_stamp: Callable[[int], int] = lambda stamp: stamp + 3 * MS
    depth_encoding: str = "16UC1"
    depth_frame: str = "camera"
    depth_size: tuple[int, int] | None = None
    info: Callable[[int], bytes | None] = info
    info_topic: str = "/cam/color/camera_info"
    labels: Callable[[int], Array | None] = label_picture
    labels_frame: str = "camera"
    labels_stamp: Callable[[int], int] = lambda stamp: stamp
    tables: Sequence[dict[int, str]] = (NAMES,)
    poses: Put = field(default_factory=drive)
    static: Put = field(default_factory=mount)
    others: Put = nothing

    def record(self, path: Path, **options: Any) -> Path:
        """Write the log, each message at its log time."""
        log = Recorder(path, **options)
        for k, names in enumerate(self.tables):
            log.ros("/gt/label_info", LABELS, ROS.label_info(BASE_NS, names), BASE_NS + k)
        for put in (self.static, self.poses, self.others):
            put(log)
        for i in range(FRAMES):
            self._frame(log, i)
        return log.close()

    def _frame(self, log: Recorder, i: int) -> None:
        stamp = self.stamp(i)
        if (payload := self.info(stamp)) is not None:
            log.ros(self.info_topic, INFO, payload, stamp + 4 * MS)
        color = ROS.image(self.color_stamp(stamp), self.color(i), "rgb8", frame_id=self.color_frame)
        log.ros("/cam/color/image_raw", IMAGE, color, self.color_log(stamp))
        if (depth := self.depth(i)) is not None:
            encoded = ROS.image(
                self.depth_stamp(stamp), depth, self.depth_encoding, frame_id=self.depth_frame, size=self.depth_size
            )
            log.ros("/cam/depth/image_raw", IMAGE, encoded, stamp + 9 * MS)
        if (labels := self.labels(i)) is not None:
            encoded = ROS.image(self.labels_stamp(stamp), labels, "mono8", frame_id=self.labels_frame)
            log.ros("/gt/labels", IMAGE, encoded, stamp + 20 * MS)


def pose_channel(topic: str, frame_of: Callable[[int], str] = lambda i: "world", q_of: Any = lambda i: LEVEL) -> Put:
    """Stamped poses at 20 Hz."""

    def put(log: Recorder) -> None:
        for j in range(-1, 2 * FRAMES + 1):
            stamp = BASE_NS + j * PERIOD_NS // 2
            log.ros(topic, POSE, ROS.pose(stamp, (0.0, 0.01 * j, 0.0), q_of(j), frame_of(j)), stamp + MS)

    return put


def odometry(child: str) -> Put:
    """Odometry at 20 Hz."""

    def put(log: Recorder) -> None:
        for j in range(-1, 2 * FRAMES + 1):
            stamp = BASE_NS + j * PERIOD_NS // 2
            log.ros("/odom", ODOMETRY, ROS.odometry(stamp, (0.01 * j, 0.0, 0.0), child=child), stamp + MS)

    return put


def both(*puts: Put) -> Put:
    """All of them."""

    def put(log: Recorder) -> None:
        for one in puts:
            one(log)

    return put
