"""Reading against its floor, at 960x540: one pass that reads, decompresses and decodes the same messages and no more.

Content first: both must give the same pixels. Then the ratio of the two, taken in turns in one run.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from pytest_benchmark.fixture import BenchmarkFixture

from stsem.log.log import open_log
from stsem.log.pixels import MILLIMETRES_TO_METRES

FRAMES, WIDTH, HEIGHT, PERIOD_NS, ROUNDS = 120, 960, 540, 100_000_000, 5
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


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bench") / "bench.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, chunk_size=2 << 20)
        writer.start("ros2", "stsem bench")
        ids = {}
        topics = {"/cam/image_raw/compressed": COMPRESSED, "/cam/depth/image_raw": IMAGE, "/cam/labels": IMAGE}
        for topic, schema in topics.items():
            ids[topic] = writer.register_channel(topic, "cdr", writer.register_schema(schema, "ros2msg", b""))
        for i in range(FRAMES):
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
    depth: npt.NDArray[np.float32]
    labels: U8


def _floor(path: Path) -> Iterator[Row]:
    """Read, decompress, decode: the public stream reader, one thread, no index, no checks."""
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
                else:
                    raw = np.frombuffer(record.data[-2 * HEIGHT * WIDTH :], "<u2").reshape(HEIGHT, WIDTH)
                    held["depth"] = MILLIMETRES_TO_METRES.take(raw, mode="wrap")


def _harness(path: Path) -> int:
    with open_log([path]) as log:
        return sum(1 for _ in log.frames(range(len(log.plans)), depth=True, previous=True, truth=True))


def test_reading_over_floor(log_path: Path, benchmark: BenchmarkFixture) -> None:
    """Scan and all frames through `Log`, as a multiple of the floor."""
    with open_log([log_path]) as log:
        loaded = log.frames(range(len(log.plans)), depth=True, previous=True, truth=True)
        for row, got in zip(_floor(log_path), loaded, strict=True):
            assert got.frame is not None
            assert got.frame.depth is not None
            assert got.truth is not None
            np.testing.assert_array_equal(got.frame.image, row.rgb)
            np.testing.assert_array_equal(got.frame.depth, row.depth)
            np.testing.assert_array_equal(got.truth, row.labels)
    times: dict[str, list[float]] = {"floor": [], "floor_cpu": [], "ours": [], "ours_cpu": [], "scan": []}
    for _ in range(ROUNDS):
        start, cpu = perf_counter(), process_time()
        assert sum(1 for _ in _floor(log_path)) == FRAMES
        times["floor"].append(perf_counter() - start)
        times["floor_cpu"].append(process_time() - cpu)
        start, cpu = perf_counter(), process_time()
        assert _harness(log_path) == FRAMES
        times["ours"].append(perf_counter() - start)
        times["ours_cpu"].append(process_time() - cpu)
        start = perf_counter()
        open_log([log_path]).close()
        times["scan"].append(perf_counter() - start)
    ms = {name: 1000 * min(values) / FRAMES for name, values in times.items()}
    benchmark.extra_info |= {f"{name}_ms_per_frame": round(value, 3) for name, value in ms.items()}
    benchmark.extra_info["wall_over_floor"] = round(ms["ours"] / ms["floor"], 3)
    benchmark.extra_info["cpu_over_floor"] = round(ms["ours_cpu"] / ms["floor_cpu"], 3)
    print(f"\n{log_path.stat().st_size / 1e6:.1f} MB", benchmark.extra_info)
    benchmark.pedantic(_harness, args=(log_path,), rounds=1)
