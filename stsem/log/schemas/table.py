"""The table of decoders: (message encoding, schema name) -> what it holds and how it is read.

A new message type is a row; a new family is a file of readers and its rows.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mcap.records import Schema

from stsem.log.schemas import protobuf, ros2
from stsem.log.schemas.messages import Decoded, Kind

StampReader = Callable[[memoryview], int | None]
MessageReader = Callable[[memoryview], Decoded]


@dataclass(frozen=True)
class Row:
    """How one message type is read.

    Args:
        kind: what it holds.
        reader: makes, once per channel and from the schema in the file, the reader of whole messages.
        stamp: makes the reader of the capture stamp alone; None when the whole message is read during the scan.
        stamp_bytes: of a calibration: bytes at the front that hold the stamp; a message that is equal to the one before
            behind them says nothing new and is not read again.
    """

    kind: Kind
    reader: Callable[[Schema], MessageReader]
    stamp: Callable[[Schema], StampReader] | None = None
    stamp_bytes: int = 0


def _header(_: Schema) -> StampReader:
    return ros2.header_stamp


CDR_HEADER_STAMP = 12

TABLE: dict[tuple[str, str], Row] = {
    ("cdr", "sensor_msgs/msg/Image"): Row(Kind.IMAGE, ros2.image, _header),
    ("cdr", "sensor_msgs/msg/CompressedImage"): Row(Kind.COMPRESSED, ros2.compressed_image, _header),
    ("cdr", "sensor_msgs/msg/CameraInfo"): Row(
        Kind.CALIBRATION, ros2.camera_info, _header, stamp_bytes=CDR_HEADER_STAMP
    ),
    ("cdr", "tf2_msgs/msg/TFMessage"): Row(Kind.TRANSFORMS, ros2.tf_message),
    ("cdr", "geometry_msgs/msg/PoseStamped"): Row(Kind.POSE, ros2.pose_stamped),
    ("cdr", "vision_msgs/msg/LabelInfo"): Row(Kind.CLASS_TABLE, ros2.label_info),
    ("protobuf", "foxglove.RawImage"): Row(Kind.IMAGE, protobuf.raw_image, protobuf.stamp_reader),
    ("protobuf", "foxglove.CompressedImage"): Row(Kind.COMPRESSED, protobuf.compressed_image, protobuf.stamp_reader),
    ("protobuf", "foxglove.CompressedVideo"): Row(Kind.VIDEO, protobuf.compressed_image, protobuf.stamp_reader),
    ("protobuf", "foxglove.CameraCalibration"): Row(Kind.CALIBRATION, protobuf.camera_calibration),
    ("protobuf", "foxglove.PoseInFrame"): Row(Kind.POSE, protobuf.pose_in_frame),
}
