"""ROS 2 messages (cdr): images by a cursor over the bytes, without a copy; small messages by mcap-ros2-support.

Every reader here takes the payload of a message and raises ValueError, struct.error or what the library raises when
the bytes are not such a message; `decode.py` turns that into a DecodeError with topic and stamp.
"""

import struct
from collections.abc import Callable
from typing import Any

from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from stsem.log.schemas.calibration import Intrinsics, Readout, calibration
from stsem.log.schemas.messages import Calibration, ClassNames, CompressedImage, RawImage, Transform

NS = 1_000_000_000


class Cursor:
    """Reads cdr from the front: numbers aligned to their size, counted from behind the 4 bytes of the encapsulation."""

    __slots__ = ("_at", "_data", "_u32")

    def __init__(self, data: memoryview) -> None:
        if len(data) < 4 or data[0] != 0 or data[1] > 1:
            raise ValueError(f"the payload does not begin as plain cdr but with {bytes(data[:4]).hex() or 'nothing'}")
        self._data, self._at = data, 4
        self._u32 = struct.Struct("<I" if data[1] else ">I").unpack_from

    def u8(self) -> int:
        """Next byte."""
        self._at += 1
        return self._data[self._at - 1]

    def u32(self) -> int:
        """Next 32-bit unsigned integer."""
        at = (self._at + 3) & ~3
        self._at = at + 4
        return int(self._u32(self._data, at)[0])

    def blob(self) -> memoryview:
        """Next sequence of bytes, as a view."""
        length = self.u32()
        start, self._at = self._at, self._at + length
        if self._at > len(self._data):
            raise ValueError(f"{length} bytes are announced but {len(self._data) - start} are there")
        return self._data[start : self._at]

    def text(self) -> str:
        """Next string, without its closing zero."""
        return bytes(self.blob()).rstrip(b"\0").decode()

    def stamp(self) -> int | None:
        """Next builtin_interfaces/Time in nanoseconds; None when it is zero, which means unset."""
        seconds, rest = self.u32(), self.u32()
        return seconds * NS + rest or None


def header_stamp(payload: memoryview) -> int | None:
    """Capture stamp of a message that begins with a std_msgs/Header."""
    return Cursor(payload).stamp()


IMAGE_FIELDS = ("header", "height", "width", "encoding", "is_bigendian", "step", "data")
COMPRESSED_IMAGE_FIELDS = ("header", "format", "data")


def check_fields(schema: Schema, expected: tuple[str, ...]) -> None:
    """ValueError unless the message that `schema` (ros2msg) describes has just these fields; an empty one is trusted.

    The cursor reads a fixed layout, so a namesake with other fields must not reach it.
    """
    if schema.encoding != "ros2msg" or not schema.data:
        return
    own = schema.data.decode().split("\n====")[0]
    lines = [line.split("#")[0].split() for line in own.splitlines() if "=" not in line.split("#")[0]]
    found = tuple(words[1] for words in lines if len(words) > 1)
    if found != expected:
        raise ValueError(f"its fields are {', '.join(found) or 'none'}, but {', '.join(expected)} were expected")


def image(schema: Schema) -> Callable[[memoryview], RawImage]:
    """Reader of sensor_msgs/Image."""
    check_fields(schema, IMAGE_FIELDS)

    def read(payload: memoryview) -> RawImage:
        cursor = Cursor(payload)
        stamp_ns, frame_id = cursor.stamp(), cursor.text()
        height, width = cursor.u32(), cursor.u32()
        encoding, big_endian = cursor.text(), cursor.u8() != 0
        return RawImage(stamp_ns, frame_id, width, height, encoding, big_endian, cursor.u32(), cursor.blob())

    return read


def compressed_image(schema: Schema) -> Callable[[memoryview], CompressedImage]:
    """Reader of sensor_msgs/CompressedImage."""
    check_fields(schema, COMPRESSED_IMAGE_FIELDS)

    def read(payload: memoryview) -> CompressedImage:
        cursor = Cursor(payload)
        return CompressedImage(cursor.stamp(), cursor.text(), cursor.text(), cursor.blob())

    return read


def camera_info(schema: Schema) -> Callable[[memoryview], Calibration]:
    """Reader of sensor_msgs/CameraInfo."""
    decode = _library(schema)

    def read(payload: memoryview) -> Calibration:
        message = decode(bytes(payload))
        roi = message.roi
        readout = Readout((message.binning_x, message.binning_y), (roi.x_offset, roi.y_offset), (roi.width, roi.height))
        sensor = Intrinsics(
            message.width, message.height, message.k, message.d, message.distortion_model, message.p, readout
        )
        return calibration(_stamp(message.header), message.header.frame_id, sensor)

    return read


def tf_message(schema: Schema) -> Callable[[memoryview], tuple[Transform, ...]]:
    """Reader of tf2_msgs/TFMessage."""
    decode = _library(schema)

    def read(payload: memoryview) -> tuple[Transform, ...]:
        return tuple(
            _transform(item.header, item.child_frame_id, item.transform.translation, item.transform.rotation)
            for item in decode(bytes(payload)).transforms
        )

    return read


def pose_stamped(schema: Schema) -> Callable[[memoryview], tuple[Transform, ...]]:
    """Reader of geometry_msgs/PoseStamped."""
    decode = _library(schema)

    def read(payload: memoryview) -> tuple[Transform, ...]:
        message = decode(bytes(payload))
        return (_transform(message.header, "", message.pose.position, message.pose.orientation),)

    return read


def label_info(schema: Schema) -> Callable[[memoryview], ClassNames]:
    """Reader of vision_msgs/LabelInfo."""
    decode = _library(schema)

    def read(payload: memoryview) -> ClassNames:
        message = decode(bytes(payload))
        return ClassNames(_stamp(message.header), {item.class_id: item.class_name for item in message.class_map})

    return read


def _library(schema: Schema) -> Callable[[bytes], Any]:
    decode = DecoderFactory().decoder_for("cdr", schema)
    if decode is None:
        raise ValueError(f"a schema in {schema.encoding!r} cannot be read, only 'ros2msg'")
    return decode


def _stamp(header: Any) -> int | None:
    return header.stamp.sec * NS + header.stamp.nanosec or None


def _transform(header: Any, child: str, t: Any, q: Any) -> Transform:
    return Transform(
        _stamp(header), header.frame_id.lstrip("/"), child.lstrip("/"), (t.x, t.y, t.z), (q.x, q.y, q.z, q.w)
    )
