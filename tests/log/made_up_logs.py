"""Small logs made by others' encoders: payloads by rosbags and foxglove-sdk, containers by mcap."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from encoders_ros import LEVEL, NS, Array, Encoded, Link, Ros
from mcap.writer import CompressionType, Writer

BASE_NS = 1_700_000_000 * NS
PERIOD_NS = 100_000_000


class Recorder:
    """An MCAP file in the making; the defaults are those of a ROS 2 recorder with small chunks."""

    def __init__(self, path: Path, **options: Any) -> None:
        self.path = path
        self._stream = path.open("wb")
        self.writer = Writer(self._stream, **({"compression": CompressionType.ZSTD, "chunk_size": 4096} | options))
        self.writer.start("ros2", "test")
        self._schemas: dict[tuple[str, str], int] = {}
        self._channels: dict[tuple[str, str, str], int] = {}

    def ros(self, topic: str, schema: str, payload: bytes, log_ns: int) -> None:
        self.add(topic, schema, "ros2msg", ROS.schema(schema), "cdr", payload, log_ns)

    def fox(self, topic: str, message: Any, log_ns: int) -> None:
        schema = message.get_schema()
        self.add(topic, schema.name, schema.encoding, schema.data, "protobuf", message.encode(), log_ns)

    def put(self, topic: str, message: Encoded, log_ns: int) -> None:
        m = message
        self.add(topic, m.schema, m.schema_encoding, m.definition, m.encoding, m.payload, log_ns)

    def add(
        self, topic: str, schema: str, schema_encoding: str, data: bytes, encoding: str, payload: bytes, log_ns: int
    ) -> None:  # fmt: skip
        if (schema, encoding) not in self._schemas:
            self._schemas[schema, encoding] = self.writer.register_schema(schema, schema_encoding, data)
        if (topic, schema, encoding) not in self._channels:
            self._channels[topic, schema, encoding] = self.writer.register_channel(
                topic, encoding, self._schemas[schema, encoding]
            )
        self.writer.add_message(self._channels[topic, schema, encoding], log_ns, payload, log_ns)

    def close(self) -> Path:
        self.writer.finish()
        self._stream.close()
        return self.path


ROS = Ros()
TYPES = ROS.types


def picture(i: int, width: int = 32, height: int = 24) -> npt.NDArray[np.uint8]:
    """(H, W, 3) RGB that differs for each i."""
    y, x = np.mgrid[:height, :width]
    return np.stack([x * 5 + i, y * 7 + 2 * i, (x + y) * 3], axis=2).astype(np.uint8)


def label_picture(i: int, classes: int = 3, width: int = 32, height: int = 24) -> npt.NDArray[np.uint8]:
    """(H, W) ids 0..classes-1 in stripes that move with i, and one ignored row."""
    labels = ((np.mgrid[:height, :width][1] + i) // 8 % classes).astype(np.uint8)
    labels[0] = 255
    return labels


def png(pixels: Array) -> bytes:
    return bytes(cv2.imencode(".png", pixels)[1])


def room(path: Path, frames: int = 6, **options: Any) -> Path:
    """A small complete ROS 2 log: colour (rgb8), depth (16UC1), tf, labels with LabelInfo, calibration."""
    log = Recorder(path, **options)
    log.ros(
        "/gt/label_info",
        "vision_msgs/msg/LabelInfo",
        ROS.label_info(BASE_NS, {0: "wall", 1: "floor", 2: "door"}),
        BASE_NS,
    )
    static: list[Link] = [("base", "camera", (0.0, 0.0, 0.5), LEVEL)]
    log.ros("/tf_static", "tf2_msgs/msg/TFMessage", ROS.tf(BASE_NS - 3 * NS, static), BASE_NS)
    for i in range(frames):
        stamp = BASE_NS + i * PERIOD_NS
        for k in (-50_000_000, 50_000_000):
            link: Link = ("world", "base", (i + k / PERIOD_NS, 0.0, 0.0), LEVEL)
            log.ros("/tf", "tf2_msgs/msg/TFMessage", ROS.tf(stamp + k, [link]), stamp + k + 2_000_000)
        k_matrix = [30, 0, 15.5, 0, 30, 11.5, 0, 0, 1]
        log.ros(
            "/cam/color/camera_info",
            "sensor_msgs/msg/CameraInfo",
            ROS.camera_info(stamp, 32, 24, k_matrix),
            stamp + 4_000_000,
        )
        log.ros(
            "/cam/color/image_raw", "sensor_msgs/msg/Image", ROS.image(stamp, picture(i), "rgb8"), stamp + 5_000_000
        )
        depth = np.full((24, 32), 1000 + i, "<u2")
        depth[0, :2] = 0, 65535
        depth_stamp = stamp + 3_000_000
        log.ros(
            "/cam/depth/image_raw", "sensor_msgs/msg/Image", ROS.image(depth_stamp, depth, "16UC1"), stamp + 9_000_000
        )
        log.ros("/gt/labels", "sensor_msgs/msg/Image", ROS.image(stamp, label_picture(i), "mono8"), stamp + 20_000_000)
    return log.close()
