"""ROS payloads by rosbags: ROS 2 in both byte orders, and ROS 1."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.records import Schema
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

Array = npt.NDArray[Any]
Quaternion = tuple[float, float, float, float]
Link = tuple[str, str, tuple[float, float, float], Quaternion]
NS = 1_000_000_000
LEVEL: Quaternion = (0.0, 0.0, 0.0, 1.0)
EXTRA = {
    "vision_msgs/msg/VisionClass": "uint16 class_id\nstring class_name\n",
    "vision_msgs/msg/LabelInfo": "std_msgs/Header header\nvision_msgs/VisionClass[] class_map\nfloat32 threshold\n",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "tf/msg/tfMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "foxglove_msgs/msg/CompressedVideo": (
        "builtin_interfaces/Time timestamp\nstring frame_id\nuint8[] data\nstring format\n"
    ),
}


@dataclass(frozen=True)
class Encoded:
    """A message, and everything that a channel for it must say."""

    schema: str
    schema_encoding: str
    definition: bytes
    encoding: str
    payload: bytes

    def schema_record(self) -> Schema:
        return Schema(id=1, name=self.schema, encoding=self.schema_encoding, data=self.definition)


def _typestore(version: int) -> Any:
    store = get_typestore(Stores.ROS2_JAZZY if version == 2 else Stores.ROS1_NOETIC)
    for name, fields in EXTRA.items():
        if name not in store.fielddefs:
            fields = fields if version == 2 else fields.replace("builtin_interfaces/Time", "time")
            store.register(get_types_from_msg(fields, name))
    return store


class Ros:
    """Payloads of one family; every maker of messages returns what `encode` does.

    Args:
        version: 1 or 2.
        little_endian: of ROS 2; ROS 1 always is.
    """

    def __init__(self, version: int = 2, little_endian: bool = True) -> None:
        self.types, self.version, self.little_endian = _typestore(version), version, little_endian
        self._definitions: dict[str, bytes] = {}

    def __call__(self, name: str, **fields: Any) -> Any:
        return self.types.types[name](**fields)

    def encode(self, message: Any) -> Any:
        name = message.__msgtype__
        if self.version == 1:
            return bytes(self.types.serialize_ros1(message, name))
        return bytes(self.types.serialize_cdr(message, name, little_endian=self.little_endian))

    def schema(self, name: str) -> bytes:
        if name not in self._definitions:
            text, _ = self.types.generate_msgdef(name, ros_version=self.version)
            self._definitions[name] = str(text).encode()
        return self._definitions[name]

    def header(self, stamp_ns: int, frame_id: str) -> Any:
        stamp = self("builtin_interfaces/msg/Time", sec=stamp_ns // NS, nanosec=stamp_ns % NS)
        count = {"seq": 7} if self.version == 1 else {}
        return self("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id, **count)

    def image(
        self, stamp_ns: int, pixels: Array, encoding: str, *, frame_id: str = "camera", padding: int = 0,
        size: tuple[int, int] | None = None,
    ) -> Any:  # fmt: skip
        """`size` is (width, height) where the rows of `pixels` are not those of the image."""
        rows = pixels.reshape(pixels.shape[0], -1).view(np.uint8)
        width, height = size or pixels.shape[1::-1]
        padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
        return self.encode(
            self(
                "sensor_msgs/msg/Image", header=self.header(stamp_ns, frame_id), height=height, width=width,
                encoding=encoding, is_bigendian=int(pixels.dtype.byteorder == ">"),
                step=padded.shape[1], data=np.ascontiguousarray(padded).ravel(),
            )
        )  # fmt: skip

    def compressed(self, stamp_ns: int, data: bytes, form: str, frame_id: str = "camera") -> Any:
        name = "sensor_msgs/msg/CompressedImage"
        header = self.header(stamp_ns, frame_id)
        return self.encode(self(name, header=header, format=form, data=np.frombuffer(data, np.uint8)))

    def video(self, stamp_ns: int, data: bytes, form: str, frame_id: str = "camera") -> Any:
        stamp = self.header(stamp_ns, frame_id).stamp
        fields = {"timestamp": stamp, "frame_id": frame_id, "data": np.frombuffer(data, np.uint8), "format": form}
        return self.encode(self("foxglove_msgs/msg/CompressedVideo", **fields))

    def camera_info(
        self, stamp_ns: int, width: int, height: int, k: Sequence[float], frame_id: str = "camera", *,
        d: Sequence[float] = (0.0,) * 5, model: str = "plumb_bob", p: Sequence[float] = (0.0,) * 12,
        binning: tuple[int, int] = (0, 0), roi: tuple[int, int, int, int] = (0, 0, 0, 0),
    ) -> Any:  # fmt: skip
        """`roi` is x, y, width, height."""
        x, y, roi_width, roi_height = roi
        region = self(
            "sensor_msgs/msg/RegionOfInterest", x_offset=x, y_offset=y, height=roi_height, width=roi_width,
            do_rectify=False,
        )  # fmt: skip
        matrices = {"d": np.array(d, float), "k": np.array(k, float), "r": np.eye(3).ravel(), "p": np.array(p, float)}
        if self.version == 1:
            matrices = {name.upper(): values for name, values in matrices.items()}
        return self.encode(
            self(
                "sensor_msgs/msg/CameraInfo", header=self.header(stamp_ns, frame_id), height=height, width=width,
                distortion_model=model, binning_x=binning[0], binning_y=binning[1], roi=region, **matrices,
            )
        )  # fmt: skip

    def tf(self, stamp_ns: int, links: Iterable[Link], name: str = "tf2_msgs/msg/TFMessage") -> Any:
        return self.encode(self(name, transforms=[self._transform(stamp_ns, *link) for link in links]))

    def transform(self, stamp_ns: int, link: Link) -> Any:
        return self.encode(self._transform(stamp_ns, *link))

    def pose(self, stamp_ns: int, t: Sequence[float], q: Quaternion = LEVEL, frame_id: str = "world") -> Any:
        header = self.header(stamp_ns, frame_id)
        return self.encode(self("geometry_msgs/msg/PoseStamped", header=header, pose=self._pose(t, q)))

    def pose_with_covariance(self, stamp_ns: int, t: Sequence[float], q: Quaternion = LEVEL) -> Any:
        name, header = "geometry_msgs/msg/PoseWithCovarianceStamped", self.header(stamp_ns, "world")
        return self.encode(self(name, header=header, pose=self._pose_with_covariance(t, q)))

    def odometry(
        self, stamp_ns: int, t: Sequence[float], q: Quaternion = LEVEL, frame_id: str = "odom", child: str = "base"
    ) -> Any:
        zero = self("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        twist = self("geometry_msgs/msg/Twist", linear=zero, angular=zero)
        return self.encode(
            self(
                "nav_msgs/msg/Odometry", header=self.header(stamp_ns, frame_id), child_frame_id=child,
                pose=self._pose_with_covariance(t, q),
                twist=self("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
            )
        )  # fmt: skip

    def label_info(self, stamp_ns: int, names: dict[int, str]) -> Any:
        items = [self("vision_msgs/msg/VisionClass", class_id=i, class_name=name) for i, name in names.items()]
        name = "vision_msgs/msg/LabelInfo"
        return self.encode(self(name, header=self.header(stamp_ns, ""), class_map=items, threshold=0.0))

    def _transform(self, stamp_ns: int, parent: str, child: str, t: Sequence[float], q: Quaternion) -> Any:
        x, y, z = t
        body = self(
            "geometry_msgs/msg/Transform", translation=self("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=self._quaternion(q),
        )  # fmt: skip
        name = "geometry_msgs/msg/TransformStamped"
        return self(name, header=self.header(stamp_ns, parent), child_frame_id=child, transform=body)

    def _pose(self, t: Sequence[float], q: Quaternion) -> Any:
        x, y, z = t
        point = self("geometry_msgs/msg/Point", x=x, y=y, z=z)
        return self("geometry_msgs/msg/Pose", position=point, orientation=self._quaternion(q))

    def _pose_with_covariance(self, t: Sequence[float], q: Quaternion) -> Any:
        covariance = np.arange(36.0)
        return self("geometry_msgs/msg/PoseWithCovariance", pose=self._pose(t, q), covariance=covariance)

    def _quaternion(self, q: Quaternion) -> Any:
        return self("geometry_msgs/msg/Quaternion", x=q[0], y=q[1], z=q[2], w=q[3])


class RosMessages(Ros):
    """The same, with what a channel must say: `Encoded` instead of payloads."""

    def encode(self, message: Any) -> Encoded:
        name = message.__msgtype__
        payload, definition = super().encode(message), self.schema(name)
        if self.version == 1:
            return Encoded(name.replace("/msg/", "/"), "ros1msg", definition, "ros1", payload)
        return Encoded(name, "ros2msg", definition, "cdr", payload)
