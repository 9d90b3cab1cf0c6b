"""ROS 1 and ROS 2 messages: the types of both are the same but for how they are written, which the cursor knows.

Layouts are standard and built in, and no code is made from what the file says. Readers raise ValueError, struct.error
or IndexError when the bytes are not such a message.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mcap.records import Schema

from stsem.log.schemas.calibration import Intrinsics, Readout, calibration
from stsem.log.schemas.cursor import Cursor, Open
from stsem.log.schemas.definition import check_layout
from stsem.log.schemas.messages import Calibration, ClassNames, CompressedImage, Decoded, Kind, RawImage, Transform

STAMP_BYTES = 12
"""Bytes at the front of a message that hold its stamp: encapsulation or sequence number, and the time."""

POSE = "f64 f64 f64 f64 f64 f64 f64"
COVARIANCE = 36
TWIST = 6
SMALLEST_TRANSFORM, SMALLEST_CLASS = 72, 6


@dataclass(frozen=True)
class RosType:
    """A message type.

    Args:
        kind: what it holds.
        layout: as `definition.check_layout` wants it.
        read: reads a whole message from its front.
    """

    kind: Kind
    layout: str
    read: Callable[[Cursor], Decoded]


def reader(message: RosType, begin: Open) -> Callable[[Schema], Callable[[memoryview], Decoded]]:
    """Makes the reader of whole messages from the schema in the file; ValueError where it is laid out otherwise."""

    def make(schema: Schema) -> Callable[[memoryview], Decoded]:
        check_layout(schema, message.layout)
        return lambda payload: message.read(begin(payload))

    return make


def stamp_reader(message: RosType, begin: Open) -> Callable[[Schema], Callable[[memoryview], int | None]]:
    """Makes the reader of the stamp alone."""
    if message.layout.startswith("{header}"):
        return lambda _: lambda payload: begin(payload).header_stamp()
    return lambda _: lambda payload: begin(payload).stamp()


def image(cursor: Cursor) -> RawImage:
    """sensor_msgs/Image."""
    stamp_ns, frame_id = cursor.header()
    height, width = cursor.u32(), cursor.u32()
    encoding, big_endian = cursor.text(), cursor.u8() != 0
    return RawImage(stamp_ns, frame_id, width, height, encoding, big_endian, cursor.u32(), cursor.blob())


def compressed_image(cursor: Cursor) -> CompressedImage:
    """sensor_msgs/CompressedImage."""
    stamp_ns, frame_id = cursor.header()
    return CompressedImage(stamp_ns, frame_id, cursor.text(), cursor.blob())


def camera_info(cursor: Cursor) -> Calibration:
    """sensor_msgs/CameraInfo."""
    stamp_ns, frame_id = cursor.header()
    height, width = cursor.u32(), cursor.u32()
    model, d = cursor.text(), cursor.f64s(cursor.u32())
    k, _, p = cursor.f64s(9), cursor.f64s(9), cursor.f64s(12)
    binning, offset = (cursor.u32(), cursor.u32()), (cursor.u32(), cursor.u32())
    roi_height, roi_width, _ = cursor.u32(), cursor.u32(), cursor.u8()
    readout = Readout(binning, offset, (roi_width, roi_height))
    return calibration(stamp_ns, frame_id, Intrinsics(width, height, k, d, model, p, readout))


def transform_stamped(cursor: Cursor) -> tuple[Transform, ...]:
    """geometry_msgs/TransformStamped."""
    stamp_ns, parent = cursor.header()
    return (_transform(cursor, stamp_ns, parent, cursor.text()),)


def tf_message(cursor: Cursor) -> tuple[Transform, ...]:
    """tf2_msgs/TFMessage."""
    return tuple(transform_stamped(cursor)[0] for _ in cursor.items(SMALLEST_TRANSFORM))


def pose_stamped(cursor: Cursor) -> tuple[Transform, ...]:
    """geometry_msgs/PoseStamped."""
    stamp_ns, parent = cursor.header()
    return (_transform(cursor, stamp_ns, parent, ""),)


def pose_with_covariance_stamped(cursor: Cursor) -> tuple[Transform, ...]:
    """geometry_msgs/PoseWithCovarianceStamped; what follows the pose is only walked over."""
    found = pose_stamped(cursor)
    cursor.f64s(COVARIANCE)
    return found


def odometry(cursor: Cursor) -> tuple[Transform, ...]:
    """nav_msgs/Odometry; what follows the pose is only walked over."""
    found = transform_stamped(cursor)
    cursor.f64s(COVARIANCE + TWIST + COVARIANCE)
    return found


def label_info(cursor: Cursor) -> ClassNames:
    """vision_msgs/LabelInfo."""
    stamp_ns, _ = cursor.header()
    names = {cursor.u16(): cursor.text() for _ in cursor.items(SMALLEST_CLASS)}
    cursor.u32()
    return ClassNames(stamp_ns, names)


def compressed_video(cursor: Cursor) -> CompressedImage:
    """foxglove_msgs/CompressedVideo."""
    stamp_ns, frame_id, data = cursor.stamp(), cursor.text(), cursor.blob()
    return CompressedImage(stamp_ns, frame_id, cursor.text(), data)


def _transform(cursor: Cursor, stamp_ns: int | None, parent: str, child: str) -> Transform:
    x, y, z, *q = cursor.f64s(7)
    return Transform(stamp_ns, parent.lstrip("/"), child.lstrip("/"), (x, y, z), (q[0], q[1], q[2], q[3]))


TYPES: dict[str, RosType] = {
    "sensor_msgs/Image": RosType(Kind.IMAGE, "{header} i32 i32 string i8 i32 i8[]", image),
    "sensor_msgs/CompressedImage": RosType(Kind.COMPRESSED, "{header} string i8[]", compressed_image),
    "sensor_msgs/CameraInfo": RosType(
        Kind.CALIBRATION,
        "{header} i32 i32 string f64[] f64[9] f64[9] f64[12] i32 i32 i32 i32 i32 i32 i8",
        camera_info,
    ),
    "tf2_msgs/TFMessage": RosType(Kind.TRANSFORMS, f"({{header}} string {POSE})[]", tf_message),
    "tf/tfMessage": RosType(Kind.TRANSFORMS, f"({{header}} string {POSE})[]", tf_message),
    "geometry_msgs/TransformStamped": RosType(Kind.POSE, f"{{header}} string {POSE}", transform_stamped),
    "geometry_msgs/PoseStamped": RosType(Kind.POSE, f"{{header}} {POSE}", pose_stamped),
    "geometry_msgs/PoseWithCovarianceStamped": RosType(
        Kind.POSE, f"{{header}} {POSE} f64[36]", pose_with_covariance_stamped
    ),
    "nav_msgs/Odometry": RosType(
        Kind.POSE, f"{{header}} string {POSE} f64[36] f64 f64 f64 f64 f64 f64 f64[36]", odometry
    ),
    "vision_msgs/LabelInfo": RosType(Kind.CLASS_TABLE, "{header} (i16 string)[] f32", label_info),
    "foxglove_msgs/CompressedVideo": RosType(Kind.VIDEO, "i32 i32 string i8[] string", compressed_video),
}
"""By package/Type."""
