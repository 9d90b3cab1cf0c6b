"""The table of decoders: (message encoding, schema name) -> what it holds and how it is read.

A new message type is a row; a new family is a file of readers and its rows.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from mcap.records import Schema

from stsem.log.schemas import cursor, foxglove, foxglove_json, protobuf, ros
from stsem.log.schemas.foxglove import Fields
from stsem.log.schemas.messages import Decoded, Kind

StampReader = Callable[[memoryview], int | None]
MessageReader = Callable[[memoryview], Decoded]
Rows = Iterator[tuple[tuple[str, str], "Row"]]


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


ROS_FAMILIES: dict[str, cursor.Open] = {"cdr": cursor.cdr, "ros1": cursor.ros1}
ROS_SPELLINGS = ("{0}/msg/{1}", "{0}/{1}", "{0}::msg::dds_::{1}_")
"""Names of a type by ROS 2, by ROS 1, and by recorders of plain DDS; each family reads them all."""

FOXGLOVE: dict[str, tuple[Kind, Callable[[Fields], Decoded]]] = {
    "foxglove.RawImage": (Kind.IMAGE, foxglove.raw_image),
    "foxglove.CompressedImage": (Kind.COMPRESSED, foxglove.compressed_image),
    "foxglove.CompressedVideo": (Kind.VIDEO, foxglove.compressed_image),
    "foxglove.CameraCalibration": (Kind.CALIBRATION, foxglove.camera_calibration),
    "foxglove.FrameTransform": (Kind.TRANSFORMS, foxglove.frame_transform),
    "foxglove.FrameTransforms": (Kind.TRANSFORMS, foxglove.frame_transforms),
    "foxglove.PoseInFrame": (Kind.POSE, foxglove.pose_in_frame),
    "foxglove.Odometry": (Kind.POSE, foxglove.odometry),
}


def _ros_rows() -> Rows:
    for encoding, begin in ROS_FAMILIES.items():
        for name, message in ros.TYPES.items():
            stamp, stamp_bytes = None, 0
            if message.kind.is_image or message.kind is Kind.CALIBRATION:
                stamp, stamp_bytes = ros.stamp_reader(message, begin), ros.STAMP_BYTES
            row = Row(message.kind, ros.reader(message, begin), stamp, stamp_bytes)
            for spelling in ROS_SPELLINGS:
                yield (encoding, spelling.format(*name.split("/"))), row


def _foxglove_rows() -> Rows:
    for name, (kind, convert) in FOXGLOVE.items():
        for encoding, family in (("protobuf", protobuf), ("json", foxglove_json)):
            stamp = family.stamp_reader if kind.is_image else None
            yield (encoding, name), Row(kind, family.reader(convert), stamp)


TABLE: dict[tuple[str, str], Row] = {**dict(_ros_rows()), **dict(_foxglove_rows())}
_NAMES = frozenset(name for _, name in TABLE)


def why_not(encoding: str, schema_name: str) -> str:
    """Why a message type is not read although its name is known from another encoding; "" for all other types."""
    if (encoding, schema_name) in TABLE or schema_name not in _NAMES:
        return ""
    known = sorted({other for other, name in TABLE if name == schema_name})
    return f"messages in {encoding!r} are not read; record {schema_name} as {' or '.join(known)}"
