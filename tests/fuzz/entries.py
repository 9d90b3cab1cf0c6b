"""What a fuzzer feeds with bytes: a whole log, and each of the small parsers. Any error that is not announced is a bug.

Every entry takes the bytes of a stranger; where a parser needs to be told something more (a size, a message type), the
first bytes say it.
"""

import contextlib
import io
import json
import struct
import tempfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from mcap.reader import make_reader
from mcap.records import Schema

from stsem.convert import sens
from stsem.errors import StsemError
from stsem.log import classtable
from stsem.log.log import open_log
from stsem.log.pixels import decode
from stsem.log.pixels.look import ImageMessage
from stsem.log.pixels.rvl import decode_rvl
from stsem.log.schemas import definition, protobuf
from stsem.log.schemas.messages import CompressedImage, RawImage
from stsem.log.schemas.table import TABLE
from tests.fuzz.subjects import SUBJECTS, depth_mm, picture, png, rvl, written

FORMATS = ("png", "jpeg", "webp", "16UC1; compressedDepth png", "16UC1; compressedDepth rvl", "32FC1; compressedDepth")
READ = tuple(sorted(TABLE))
BIG = (1024, 1024)


@dataclass(frozen=True)
class Entry:
    """What is fed, the errors that it may raise, and bytes to begin with."""

    feed: Callable[[bytes], object]
    may_raise: tuple[type[Exception], ...]
    seeds: Callable[[], list[bytes]]

    def __call__(self, data: bytes) -> None:
        """Feed `data`; errors that are announced are none."""
        with contextlib.suppress(*self.may_raise):
            self.feed(data)


def log(data: bytes) -> None:
    """Open it, and read every frame."""
    with tempfile.NamedTemporaryFile(suffix=".mcap") as file:
        file.write(data)
        file.flush()
        with open_log([Path(file.name)]) as opened:
            for _ in opened.frames(range(len(opened.plans)), depth=True, previous=False, truth=True):
                pass


def rvl_stream(data: bytes) -> None:
    """Width and height in two bytes each, then the stream."""
    width, height = struct.unpack_from("<HH", data.ljust(4, b"\0"))
    decode_rvl(memoryview(data[4:]), width, height)


def compressed_image(data: bytes) -> None:
    """A byte for the format, then the file: as colour, depth and labels."""
    form = FORMATS[data[0] % len(FORMATS)] if data else ""
    _images(CompressedImage(None, "camera", form, memoryview(data[1:])))


def raw_image(data: bytes) -> None:
    """A message of ROS 2 as raw image: its numbers are all the stranger's."""
    message = TABLE["cdr", "sensor_msgs/msg/Image"].reader(_nothing("sensor_msgs/msg/Image"))(memoryview(data))
    if isinstance(message, RawImage):
        _images(message)


def message(data: bytes) -> None:
    """A byte for the message type, then the message, whose schema is that of the type."""
    encoding, name = READ[data[0] % len(READ)] if data else READ[0]
    schema = _schemas().get((encoding, name), _nothing(name))
    if encoding != "protobuf" or schema.data:
        TABLE[encoding, name].reader(schema)(memoryview(data[1:]))


def wire(data: bytes) -> None:
    """The fields of a protobuf message."""
    for _ in protobuf.walk(memoryview(data)):
        pass


def descriptors(data: bytes) -> None:
    """A byte for the message type, then a protobuf schema; a message of the type is read with it."""
    samples = [(schema, payload) for encoding, schema, payload in _messages() if encoding == "protobuf"]
    schema, payload = samples[data[0] % len(samples) if data else 0]
    broken = replace(schema, data=data[1:])
    TABLE["protobuf", schema.name].reader(broken)(memoryview(payload))


def message_definition(data: bytes) -> None:
    """A ROS message definition, whatever its layout is."""
    definition.layout(data.decode())


def class_table(data: bytes) -> None:
    """A class table in JSON, as the attachment of a log."""
    table, _ = classtable.find_table(None, None, {}, {classtable.ATTACHMENT: data})
    if table is not None:
        classtable.Translator(table)(np.arange(256, dtype=np.uint8).reshape(16, 16))


def scannet(data: bytes) -> None:
    """A `.sens` file: its header and its frames."""
    stream, path = io.BytesIO(data), Path("fuzz.sens")
    header = sens.read_header(stream, path)
    index = sens.read_index(stream, header, path)
    for frame in range(len(index)):
        sens.depth_samples(index.read(stream, frame, "depth_bytes"), header)


def _images(image: ImageMessage) -> None:
    """The message as everything an image may be."""
    for read in (lambda: decode.colour(image, BIG), lambda: decode.depth(image, BIG), lambda: decode.labels(image)):
        with contextlib.suppress(ValueError, cv2.error):
            read()


def _nothing(name: str) -> Schema:
    return Schema(id=1, name=name, encoding="", data=b"")


@cache
def _logs() -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        return written(Path(folder))


@cache
def _messages() -> list[tuple[str, Schema, bytes]]:
    """(encoding, schema, payload) of the first message of each channel of the logs without chunks."""
    found = []
    for name in SUBJECTS:
        if name.startswith("bare"):
            found += _first_messages(_logs()[name])
    return found


def _first_messages(data: bytes) -> list[tuple[str, Schema, bytes]]:
    seen: dict[int, tuple[str, Schema, bytes]] = {}
    for schema, channel, record in make_reader(io.BytesIO(data)).iter_messages():
        assert schema is not None
        seen.setdefault(channel.id, (channel.message_encoding, schema, record.data))
    return list(seen.values())


@cache
def _schemas() -> dict[tuple[str, str], Schema]:
    return {(encoding, schema.name): schema for encoding, schema, _ in _messages()}


def _message_seeds() -> list[bytes]:
    return [
        bytes([READ.index((encoding, schema.name))]) + payload
        for encoding, schema, payload in _messages()
        if (encoding, schema.name) in READ
    ]


def _descriptor_seeds() -> list[bytes]:
    schemas = [schema for encoding, schema, _ in _messages() if encoding == "protobuf"]
    return [bytes([k]) + schema.data for k, schema in enumerate(schemas)]


def _definition_seeds() -> list[bytes]:
    return sorted({schema.data for _, schema, _ in _messages() if schema.encoding == "ros2msg"})


def _image_seeds() -> list[bytes]:
    jpeg = bytes(cv2.imencode(".jpg", picture(0))[1])
    webp = bytes(cv2.imencode(".webp", picture(0))[1])
    depth = bytes(12) + png(depth_mm(0))
    stream = bytes(12) + np.array([32, 24], "<u4").tobytes() + rvl(depth_mm(0))
    files = (png(picture(0)), jpeg, webp, depth, stream, bytes(12) + png(depth_mm(1)))
    return [bytes([k]) + file for k, file in enumerate(files)]


def _scannet_seed() -> bytes:
    head = struct.pack("<IQ", 4, 4) + b"fuzz" + np.stack([np.eye(4)] * 4).astype("<f4").tobytes()
    head += struct.pack("<2i4IfQ", 2, 1, 32, 24, 32, 24, 1000.0, 1)
    depth = zlib.compress(depth_mm(0).tobytes())
    shot = np.eye(4, dtype="<f4").tobytes() + struct.pack("<4Q", 1, 2, 10, len(depth)) + bytes(10) + depth
    return head + shot


def _wire_seeds() -> list[bytes]:
    return [payload for encoding, _, payload in _messages() if encoding == "protobuf"]


def _table_seeds() -> list[bytes]:
    names = ["wall", "floor", "door"]
    tables = (names, {"names": names, "ignore_id": 255, "colours": [[1, 2, 3]] * 3}, {"0": "a", "7": "b"},
              {"wall": "#112233 1"})  # fmt: skip
    return [json.dumps(table).encode() for table in tables]


def _ros_images() -> list[bytes]:
    return [payload for _, schema, payload in _messages() if schema.name == "sensor_msgs/msg/Image"]


PARSING = (ValueError, IndexError, struct.error)
ENTRIES: dict[str, Entry] = {
    "log": Entry(log, (StsemError,), lambda: list(_logs().values())),
    "rvl": Entry(rvl_stream, (ValueError,), lambda: [struct.pack("<HH", 32, 24) + rvl(depth_mm(0))]),
    "compressed_image": Entry(compressed_image, (), _image_seeds),
    "raw_image": Entry(raw_image, PARSING, _ros_images),
    "message": Entry(message, PARSING, _message_seeds),
    "wire": Entry(wire, PARSING, _wire_seeds),
    "descriptors": Entry(descriptors, PARSING, _descriptor_seeds),
    "definition": Entry(message_definition, (ValueError,), _definition_seeds),
    "class_table": Entry(class_table, (StsemError,), _table_seeds),
    "scannet": Entry(scannet, (StsemError, ValueError), lambda: [_scannet_seed()]),
}
