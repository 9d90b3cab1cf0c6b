"""foxglove messages (protobuf): images by a walk over the wire format, without a copy; small messages by the library.

Field numbers are taken from the schema in the file, by name. Readers raise ValueError, IndexError or what the library
raises when the bytes are not such a message.
"""

from collections.abc import Callable, Iterator
from typing import Any

from google.protobuf.descriptor_pb2 import FileDescriptorSet  # type: ignore[import-untyped]
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory

from stsem.log.schemas.calibration import Intrinsics, calibration
from stsem.log.schemas.messages import Calibration, CompressedImage, RawImage, Transform

NS = 1_000_000_000
VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
Field = int | memoryview


def varint(data: memoryview, at: int) -> tuple[int, int]:
    """(value, place behind it) of the base-128 number at `at`."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("a number is longer than 10 bytes")


def fields(data: memoryview) -> Iterator[tuple[int, Field]]:
    """(number, value) of each field of one message: int for varints, a view for everything else."""
    at, end = 0, len(data)
    while at < end:
        tag, at = varint(data, at)
        wire = tag & 7
        if wire == VARINT:
            value, at = varint(data, at)
            yield tag >> 3, value
            continue
        if wire == BYTES:
            length, at = varint(data, at)
        elif wire in (FIXED64, FIXED32):
            length = 8 if wire == FIXED64 else 4
        else:
            raise ValueError(f"wire type {wire} is unknown")
        if at + length > end:
            raise ValueError(f"{length} bytes are announced but {end - at} are there")
        yield tag >> 3, data[at : at + length]
        at += length


def numbers(schema: Schema) -> dict[str, int]:
    """Field name -> number of the message that `schema` describes."""
    for file in FileDescriptorSet.FromString(schema.data).file:
        for message in file.message_type:
            if schema.name == (f"{file.package}.{message.name}" if file.package else message.name):
                return {field.name: field.number for field in message.field}
    raise ValueError(f"the schema does not describe {schema.name}")


def stamp_reader(schema: Schema) -> Callable[[memoryview], int | None]:
    """Reader of the field `timestamp` alone; walks no further than it."""
    wanted = numbers(schema)["timestamp"]

    def read(payload: memoryview) -> int | None:
        return next((_timestamp(value) for number, value in fields(payload) if number == wanted), None)

    return read


def raw_image(schema: Schema) -> Callable[[memoryview], RawImage]:
    """Reader of foxglove.RawImage, whose samples are little endian."""
    n = numbers(schema)

    def read(payload: memoryview) -> RawImage:
        got = dict(fields(payload))
        width, height, step = (_int(got.get(n[name], 0)) for name in ("width", "height", "step"))
        encoding, frame_id = _text(got.get(n["encoding"])), _text(got.get(n["frame_id"]))
        stamp_ns, data = _timestamp(got.get(n["timestamp"])), _bytes(got.get(n["data"]))
        return RawImage(stamp_ns, frame_id, width, height, encoding, False, step, data)

    return read


def compressed_image(schema: Schema) -> Callable[[memoryview], CompressedImage]:
    """Reader of foxglove.CompressedImage (and CompressedVideo, whose data are refused later)."""
    n = numbers(schema)

    def read(payload: memoryview) -> CompressedImage:
        got = dict(fields(payload))
        frame_id, form = _text(got.get(n["frame_id"])), _text(got.get(n["format"]))
        return CompressedImage(_timestamp(got.get(n["timestamp"])), frame_id, form, _bytes(got.get(n["data"])))

    return read


def camera_calibration(schema: Schema) -> Callable[[memoryview], Calibration]:
    """Reader of foxglove.CameraCalibration."""
    decode = _library(schema)

    def read(payload: memoryview) -> Calibration:
        message = decode(bytes(payload))
        sensor = Intrinsics(message.width, message.height, message.K, message.D, message.distortion_model, message.P)
        return calibration(_stamp(message.timestamp), message.frame_id, sensor)

    return read


def pose_in_frame(schema: Schema) -> Callable[[memoryview], tuple[Transform, ...]]:
    """Reader of foxglove.PoseInFrame."""
    decode = _library(schema)

    def read(payload: memoryview) -> tuple[Transform, ...]:
        message = decode(bytes(payload))
        t, q = message.pose.position, message.pose.orientation
        stamp_ns = _stamp(message.timestamp)
        return (Transform(stamp_ns, message.frame_id, "", (t.x, t.y, t.z), (q.x, q.y, q.z, q.w)),)

    return read


def _library(schema: Schema) -> Callable[[bytes], Any]:
    decode = DecoderFactory().decoder_for("protobuf", schema)
    if decode is None:
        raise ValueError(f"a schema in {schema.encoding!r} cannot be read, only 'protobuf'")
    return decode


def _stamp(timestamp: Any) -> int | None:
    return timestamp.seconds * NS + timestamp.nanos or None


def _timestamp(value: Field | None) -> int | None:
    """google.protobuf.Timestamp: seconds (1) and nanos (2); None when absent or zero, which means unset."""
    if value is None:
        return None
    got = dict(fields(_bytes(value)))
    return _int(got.get(1, 0)) * NS + _int(got.get(2, 0)) or None


def _int(value: Field) -> int:
    if isinstance(value, int):
        return value
    return int.from_bytes(value, "little")


def _bytes(value: Field | None) -> memoryview:
    if isinstance(value, int):
        raise ValueError("a number came where bytes were expected")
    return memoryview(b"") if value is None else value


def _text(value: Field | None) -> str:
    return bytes(_bytes(value)).decode()
