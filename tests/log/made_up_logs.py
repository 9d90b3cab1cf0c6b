"""Small logs made by others' encoders: payloads by rosbags (cdr) and foxglove-sdk (protobuf), containers by mcap."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

Array = npt.NDArray[Any]
Quaternion = tuple[float, float, float, float]
Link = tuple[str, str, tuple[float, float, float], Quaternion]
NS = 1_000_000_000
BASE_NS = 1_700_000_000 * NS
PERIOD_NS = 100_000_000
LEVEL: Quaternion = (0.0, 0.0, 0.0, 1.0)


def _typestore() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg("uint16 class_id\nstring class_name\n", "vision_msgs/msg/VisionClass"))
    fields = "std_msgs/Header header\nvision_msgs/VisionClass[] class_map\nfloat32 threshold\n"
    store.register(get_types_from_msg(fields, "vision_msgs/msg/LabelInfo"))
    return store


TYPES = _typestore()


class Ros:
    """cdr payloads by rosbags."""

    def __call__(self, name: str, **fields: Any) -> Any:
        return TYPES.types[name](**fields)

    def encode(self, message: Any) -> bytes:
        return bytes(TYPES.serialize_cdr(message, message.__msgtype__))

    def schema(self, name: str) -> bytes:
        return str(TYPES.generate_msgdef(name, ros_version=2)[0]).encode()

    def header(self, stamp_ns: int, frame_id: str) -> Any:
        stamp = self("builtin_interfaces/msg/Time", sec=stamp_ns // NS, nanosec=stamp_ns % NS)
        return self("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def image(
        self, stamp_ns: int, pixels: Array, encoding: str, *, frame_id: str = "camera", padding: int = 0
    ) -> bytes:
        rows = pixels.reshape(pixels.shape[0], -1).view(np.uint8)
        padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
        return self.encode(
            self(
                "sensor_msgs/msg/Image", header=self.header(stamp_ns, frame_id), height=pixels.shape[0],
                width=pixels.shape[1], encoding=encoding, is_bigendian=int(pixels.dtype.byteorder == ">"),
                step=padded.shape[1], data=np.ascontiguousarray(padded).ravel(),
            )
        )  # fmt: skip

    def compressed(self, stamp_ns: int, data: bytes, form: str, frame_id: str = "camera") -> bytes:
        name = "sensor_msgs/msg/CompressedImage"
        header = self.header(stamp_ns, frame_id)
        return self.encode(self(name, header=header, format=form, data=np.frombuffer(data, np.uint8)))

    def camera_info(
        self, stamp_ns: int, width: int, height: int, k: Sequence[float], frame_id: str = "camera"
    ) -> bytes:
        roi = self("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        p = np.zeros(12)
        return self.encode(
            self(
                "sensor_msgs/msg/CameraInfo", header=self.header(stamp_ns, frame_id), height=height, width=width,
                distortion_model="plumb_bob", d=np.zeros(5), k=np.array(k, float), r=np.eye(3).ravel(), p=p,
                binning_x=0, binning_y=0, roi=roi,
            )
        )  # fmt: skip

    def tf(self, stamp_ns: int, links: Iterable[Link]) -> bytes:
        def transform(parent: str, child: str, t: Sequence[float], q: Quaternion) -> Any:
            x, y, z = t
            body = self(
                "geometry_msgs/msg/Transform", translation=self("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
                rotation=self._quaternion(q),
            )  # fmt: skip
            name = "geometry_msgs/msg/TransformStamped"
            return self(name, header=self.header(stamp_ns, parent), child_frame_id=child, transform=body)

        return self.encode(self("tf2_msgs/msg/TFMessage", transforms=[transform(*link) for link in links]))

    def pose(self, stamp_ns: int, t: Sequence[float], q: Quaternion = LEVEL, frame_id: str = "world") -> bytes:
        x, y, z = t
        point = self("geometry_msgs/msg/Point", x=x, y=y, z=z)
        body = self("geometry_msgs/msg/Pose", position=point, orientation=self._quaternion(q))
        return self.encode(self("geometry_msgs/msg/PoseStamped", header=self.header(stamp_ns, frame_id), pose=body))

    def label_info(self, stamp_ns: int, names: dict[int, str]) -> bytes:
        items = [self("vision_msgs/msg/VisionClass", class_id=i, class_name=name) for i, name in names.items()]
        name = "vision_msgs/msg/LabelInfo"
        return self.encode(self(name, header=self.header(stamp_ns, ""), class_map=items, threshold=0.0))

    def _quaternion(self, q: Quaternion) -> Any:
        return self("geometry_msgs/msg/Quaternion", x=q[0], y=q[1], z=q[2], w=q[3])


class Recorder:
    """An MCAP file in the making; the defaults are those of a ROS 2 recorder with small chunks."""

    def __init__(self, path: Path, **options: Any) -> None:
        self.path = path
        self._stream = path.open("wb")
        self.writer = Writer(self._stream, **({"compression": CompressionType.ZSTD, "chunk_size": 4096} | options))
        self.writer.start("ros2", "test")
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str], int] = {}

    def ros(self, topic: str, schema: str, payload: bytes, log_ns: int) -> None:
        self.add(topic, schema, "ros2msg", ROS.schema(schema), "cdr", payload, log_ns)

    def fox(self, topic: str, message: Any, log_ns: int) -> None:
        schema = message.get_schema()
        self.add(topic, schema.name, schema.encoding, schema.data, "protobuf", message.encode(), log_ns)

    def add(
        self, topic: str, schema: str, schema_encoding: str, data: bytes, encoding: str, payload: bytes, log_ns: int
    ) -> None:  # fmt: skip
        if schema not in self._schemas:
            self._schemas[schema] = self.writer.register_schema(schema, schema_encoding, data)
        if (topic, schema) not in self._channels:
            self._channels[topic, schema] = self.writer.register_channel(topic, encoding, self._schemas[schema])
        self.writer.add_message(self._channels[topic, schema], log_ns, payload, log_ns)

    def close(self) -> Path:
        self.writer.finish()
        self._stream.close()
        return self.path


ROS = Ros()


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
