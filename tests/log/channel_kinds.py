"""Logs of a few messages on any topics: each topic with one of a few kinds of messages."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from made_up_logs import BASE_NS, LEVEL, PERIOD_NS, ROS, Recorder, label_picture, picture

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
K = [30.0, 0, 15.5, 0, 30.0, 11.5, 0, 0, 1]
DEPTH = np.full((24, 32), 1000, "<u2")
Message = tuple[str, Callable[[int, int, str], bytes]]


def odometry(stamp_ns: int, parent: str, child: str, position: tuple[float, float, float]) -> bytes:
    x, y, z = (float(v) for v in position)
    still = ROS("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    level = ROS("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    pose = ROS("geometry_msgs/msg/Pose", position=ROS("geometry_msgs/msg/Point", x=x, y=y, z=z), orientation=level)
    twist = ROS("geometry_msgs/msg/Twist", linear=still, angular=still)
    unknown = np.zeros(36)
    return ROS.encode(
        ROS(
            "nav_msgs/msg/Odometry", header=ROS.header(stamp_ns, parent), child_frame_id=child,
            pose=ROS("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=unknown),
            twist=ROS("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
        )
    )  # fmt: skip


def jpeg(i: int) -> bytes:
    return bytes(cv2.imencode(".jpg", picture(i))[1])


def png(pixels: Any) -> bytes:
    return bytes(cv2.imencode(".png", pixels)[1])


def raw(encoding: str, pixels: Callable[[int], Any]) -> Message:
    return IMAGE, lambda stamp, i, frame: ROS.image(stamp, pixels(i), encoding, frame_id=frame)


MESSAGES: dict[str, Message] = {
    "rgb": raw("rgb8", picture),
    "mono": raw("mono8", label_picture),
    "labels": raw("mono8", label_picture),
    "odd": raw("tetrachrome", picture),
    "small": raw("rgb8", lambda i: picture(i, 16, 12)),
    "bayer": raw("bayer_rggb8", label_picture),
    "depth.png": (
        COMPRESSED,
        lambda stamp, _, frame: ROS.compressed(stamp, png(DEPTH), "16UC1; png compressed", frame),
    ),
    "depth.packed": (
        COMPRESSED,
        lambda stamp, _, frame: ROS.compressed(stamp, bytes(12) + png(DEPTH), "16UC1; compressedDepth png", frame),
    ),
    "depth": raw("16UC1", lambda _: DEPTH),
    "jpeg": (COMPRESSED, lambda stamp, i, frame: ROS.compressed(stamp, jpeg(i), "jpeg", frame)),
    "h264": (COMPRESSED, lambda stamp, _, frame: ROS.compressed(stamp, b"\0\0\0\1g", "h264", frame)),
    "info": ("sensor_msgs/msg/CameraInfo", lambda stamp, _, frame: ROS.camera_info(stamp, 32, 24, K, frame)),
    "pose": ("geometry_msgs/msg/PoseStamped", lambda stamp, _, __: ROS.pose(stamp, (0, 0, 0))),
    "odometry": ("nav_msgs/msg/Odometry", lambda stamp, i, frame: odometry(stamp, "odom", frame, (float(i), 0, 0))),
    "tf": (
        "tf2_msgs/msg/TFMessage",
        lambda stamp, i, frame: ROS.tf(stamp, [("world", frame, (float(i), 0.0, 0.0), LEVEL)]),
    ),
    "names": ("vision_msgs/msg/LabelInfo", lambda stamp, _, __: ROS.label_info(stamp, {0: "a", 1: "b", 2: "c"})),
}
"""kind -> (schema, payload of (stamp, number of the frame, frame_id))."""


def record(path: Path, topics: dict[str, str], frames: int = 3) -> Path:
    """A log with the given topics, each of one of a few kinds of messages: KIND, or KIND@FRAME_ID."""
    log = Recorder(path)
    for i in range(frames):
        stamp = BASE_NS + i * PERIOD_NS
        for topic, asked in topics.items():
            kind, _, frame = asked.partition("@")
            schema, payload = MESSAGES[kind]
            log.ros(topic, schema, payload(stamp, i, frame or "camera"), stamp)
    return log.close()
