"""A log of any length that exists nowhere: the same second over and over with running stamps, behind `loop://`.

Colour (jpeg), depth, labels and poses at 30 Hz, and bulk that nobody reads. Every read makes the bytes it needs.
"""

import struct
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from typing import Any

import cv2
import fsspec
import numpy as np
from made_up_logs import BASE_NS, NS, ROS, label_picture, picture
from mcap.writer import CompressionType, Writer

RATE_HZ = 30
FRAMES = 10
"""In a chunk."""
CLASSES = 13

_IMAGE, _JPEG, _POSE = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "geometry_msgs/msg/PoseStamped"
_HEAD = struct.Struct("<BQHIQQ")
_STAMP = struct.Struct("<Ii")


@dataclass(frozen=True)
class LoopingLog:
    """The bytes of the log.

    Args:
        chunks: of FRAMES frames each.
        bulk_bytes: that nobody reads, with every frame.
        width, height: of the images.
    """

    chunks: int
    bulk_bytes: int = 0
    width: int = 64
    height: int = 48

    @property
    def frames(self) -> int:
        """Colour frames."""
        return self.chunks * FRAMES

    @property
    def size(self) -> int:
        """Bytes in all."""
        return len(self._front) + self.chunks * len(self._chunk) + len(self._back)

    def read(self, start: int, end: int) -> bytes:
        """The bytes [start, end)."""
        parts, place, step = [], start, len(self._chunk)
        while place < end:
            number, at = divmod(place - len(self._front), step)
            if number < 0:
                part = self._front[place:end]
            elif number >= self.chunks:
                part = self._back[place - len(self._front) - self.chunks * step :][: end - place]
            else:
                part = self._made(number)[at : at + end - place]
            parts.append(part)
            place += len(part)
        return b"".join(parts)

    def _made(self, number: int) -> memoryview:
        """The chunk record with its stamps moved on."""
        chunk = bytearray(self._chunk)
        struct.pack_into("<QQ", chunk, 9, _stamp_ns(number, 0), _stamp_ns(number, FRAMES - 1))
        for place, stamp_place, frame in self._places:
            stamp_ns = _stamp_ns(number, frame)
            struct.pack_into("<QQ", chunk, place, stamp_ns, stamp_ns)
            if stamp_place:
                _STAMP.pack_into(chunk, stamp_place, *divmod(stamp_ns, NS))
        return memoryview(chunk)

    @cached_property
    def _front(self) -> bytes:
        """Magic, header, schemas, channels and class table."""
        stream = BytesIO()
        writer = Writer(stream, compression=CompressionType.NONE, use_chunking=False)
        writer.start("ros2", "looping")
        for schema, topic in ((_JPEG, "/cam/color"), (_IMAGE, "/cam/depth"), (_IMAGE, "/gt/labels"), (_POSE, "/pose")):
            number = writer.register_schema(schema, "ros2msg", ROS.schema(schema))
            writer.register_channel(topic, "cdr", number)
        writer.register_channel("/lidar", "bulk", writer.register_schema("Bulk", "", b""))
        writer.add_metadata("stsem.classes", {str(k): f"class {k}" for k in range(CLASSES)})
        return stream.getvalue()

    @cached_property
    def _back(self) -> bytes:
        return b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + b"\x89MCAP0\r\n"

    @cached_property
    def _chunk(self) -> bytes:
        records = b"".join(record for record, _ in self._messages)
        head = struct.pack("<QQQII", 0, 0, len(records), 0, 0) + struct.pack("<Q", len(records))
        return b"\x06" + struct.pack("<Q", len(head) + len(records)) + head + records

    @cached_property
    def _messages(self) -> list[tuple[bytes, int]]:
        """(record, frame) of one chunk."""
        found = []
        for frame in range(FRAMES):
            for channel, payload in enumerate(self._payloads(frame), start=1):
                head = _HEAD.pack(5, _HEAD.size - 9 + len(payload), channel, 0, 0, 0)
                found.append((head + payload, frame))
        return found

    @cached_property
    def _places(self) -> list[tuple[int, int, int]]:
        """(where the log time stands, where the header's stamp does or 0, frame) of each message of the chunk."""
        place, found = len(self._chunk) - sum(len(record) for record, _ in self._messages), []
        for record, frame in self._messages:
            stamped = record[9] != len(self._payloads(0))
            found.append((place + 15, place + _HEAD.size + 4 if stamped else 0, frame))
            place += len(record)
        return found

    def _payloads(self, frame: int) -> list[bytes]:
        size = self.width, self.height
        jpeg = bytes(cv2.imencode(".jpg", picture(frame, *size))[1])
        depth = np.full(size[::-1], 1500, "<u2")
        return [
            ROS.compressed(0, jpeg, "jpeg"),
            ROS.image(0, depth, "16UC1"),
            ROS.image(0, label_picture(frame, CLASSES, *size), "mono8"),
            ROS.pose(0, (0.1 * frame, 0.0, 0.0)),
            bytes(self.bulk_bytes),
        ]


def _stamp_ns(chunk: int, frame: int) -> int:
    return BASE_NS + (chunk * FRAMES + frame) * NS // RATE_HZ


class LoopingSystem(fsspec.AbstractFileSystem):  # type: ignore[misc]
    """`loop://CHUNKS/BULK_BYTES/anything.mcap`."""

    protocol = "loop"
    cachable = False

    def info(self, path: str, **options: Any) -> dict[str, Any]:
        return {"name": path, "size": self._log(path).size, "type": "file"}

    def open(self, path: str, mode: str = "rb", **options: Any) -> Any:
        return _Stream(self._log(path))

    def _log(self, path: str) -> LoopingLog:
        chunks, bulk, _ = self._strip_protocol(path).strip("/").split("/")
        return LoopingLog(int(chunks), int(bulk))


class _Stream:
    def __init__(self, log: LoopingLog) -> None:
        self._log, self._place = log, 0

    def seek(self, place: int) -> int:
        self._place = place
        return place

    def read(self, size: int) -> bytes:
        return self._log.read(self._place, min(self._log.size, self._place + size))

    def close(self) -> None:
        pass


def register() -> None:
    """Make `loop://` known to fsspec."""
    fsspec.register_implementation("loop", LoopingSystem, clobber=True)
