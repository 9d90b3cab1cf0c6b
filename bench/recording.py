"""A log of 960x540 pictures, and the floor of reading it: one pass that reads, decompresses, decodes, and no more."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from stsem.log.pixels.metres import MILLIMETRES_TO_METRES

FRAMES, WIDTH, HEIGHT, PERIOD_NS = 120, 960, 540, 100_000_000
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
U8 = npt.NDArray[np.uint8]


def _text(value: str, behind: bytes = b"") -> bytes:
    """A string, bytes behind it, and the padding that a following number needs."""
    data = value.encode() + b"\0"
    return struct.pack("<I", len(data)) + data + behind + b"\0" * (-len(data + behind) % 4)


def _head(stamp_ns: int) -> bytes:
    return b"\0\1\0\0" + struct.pack("<II", *divmod(stamp_ns, 1_000_000_000)) + _text("camera")


def _raw(stamp_ns: int, encoding: str, pixels: npt.NDArray[np.generic]) -> bytes:
    height, width = pixels.shape[:2]
    data, step = pixels.tobytes(), pixels.strides[0]
    body = struct.pack("<II", height, width) + _text(encoding, behind=b"\0") + struct.pack("<II", step, len(data))
    return _head(stamp_ns) + body + data


def _scene(i: int) -> tuple[U8, npt.NDArray[np.uint16], U8]:
    """(BGR, depth in millimetres with sensor noise and holes, labels) of a moving pattern."""
    noise = np.random.Generator(np.random.PCG64(i))
    x = np.arange(WIDTH)[None, :] + 4 * i
    y = np.arange(HEIGHT)[:, None]
    labels = ((x // 120 + y // 90) % 13).astype(np.uint8)
    bgr = np.stack([(x * 2 + y) % 256, (x + 3 * y) % 256, labels * np.uint8(19) + 0 * y], axis=2).astype(np.uint8)
    grain = cv2.GaussianBlur(noise.integers(0, 60, bgr.shape, np.uint8), (3, 3), 0)
    depth = 1500 + 3 * y + x % 700 + noise.integers(-6, 7, (HEIGHT, WIDTH))
    depth[noise.random((HEIGHT, WIDTH)) < 0.05] = 0
    return cv2.add(cv2.GaussianBlur(bgr, (5, 5), 0), grain).astype(np.uint8), depth.astype(np.uint16), labels


def write_log(path: Path, frames: int = FRAMES) -> Path:
    """A ROS 2 log with `frames` colour (JPEG), depth and label images in zstd chunks."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=2 << 20)
        writer.start("ros2", "stsem bench")
        ids = {}
        topics = {"/cam/image_raw/compressed": COMPRESSED, "/cam/depth/image_raw": IMAGE, "/cam/labels": IMAGE}
        for topic, schema in topics.items():
            ids[topic] = writer.register_channel(topic, "cdr", writer.register_schema(schema, "ros2msg", b""))
        for i in range(frames):
            bgr, depth, labels = _scene(i)
            stamp = 1_700_000_000_000_000_000 + i * PERIOD_NS
            jpeg = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
            payloads = {
                "/cam/image_raw/compressed": _head(stamp) + _text("jpeg") + struct.pack("<I", len(jpeg)) + jpeg,
                "/cam/depth/image_raw": _raw(stamp, "16UC1", depth),
                "/cam/labels": _raw(stamp, "mono8", labels),
            }
            for topic, payload in payloads.items():
                writer.add_message(ids[topic], stamp + 5_000_000, payload, stamp, i)
        names = {str(k): f"class {k}" for k in range(13)}
        writer.add_metadata("stsem.classes", names)
        writer.finish()
    return path


@dataclass
class Row:
    """What the floor decodes of one frame."""

    rgb: U8
    labels: U8
    depth: npt.NDArray[np.float32] | None = None


def floor(path: Path, *, depth: bool = True) -> Iterator[Row]:
    """Read, decompress, decode: the public stream reader, one thread, no index, no checks; depth may be left out."""
    topics: dict[int, str] = {}
    held: dict[str, npt.NDArray[np.generic]] = {}
    with path.open("rb") as stream:
        for record in StreamReader(stream).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                topic = topics[record.channel_id]
                if topic.endswith("compressed"):
                    jpeg = np.frombuffer(record.data, np.uint8, offset=record.data.index(b"\xff\xd8\xff"))
                    held["rgb"] = cv2.cvtColor(cv2.imdecode(jpeg, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
                elif topic.endswith("labels"):
                    held["labels"] = np.frombuffer(record.data, np.uint8)[-HEIGHT * WIDTH :].reshape(HEIGHT, WIDTH)
                    yield Row(**held)
                    held = {}
                elif depth:
                    raw = np.frombuffer(record.data[-2 * HEIGHT * WIDTH :], "<u2").reshape(HEIGHT, WIDTH)
                    held["depth"] = MILLIMETRES_TO_METRES.take(raw, mode="wrap")
