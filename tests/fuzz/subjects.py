"""The logs that are mutated: small, complete, made by code, with a checksum over every byte that can change a result.

Each is of another family and in another container:

| log | family | container | checksums |
|---|---|---|---|
| `ros2` | ROS 2: jpeg, 16UC1, tf, mono8 labels, LabelInfo | zstd chunks of 4 kB, as rosbag2 | chunks, summary |
| `protobuf` | foxglove: rgb8, 32FC1, transforms, png labels | no chunks | data, summary |
| `ours` | what `stsem` writes: jpeg, 16UC1, poses, labels | zstd chunks of 6 kB | chunks, data, summary |
| `ros1` | ROS 1: png, compressedDepth rvl, tf, LabelInfo | lz4 chunks, no summary | chunks, data |
| `json` | foxglove JSON: jpeg, 16UC1, transforms, labels | chunks without compression | chunks, data, summary |

In a log without chunks and without a data checksum a wrong byte in a payload cannot be noticed, by anybody. So such
logs (`bare-*`) are mutated too, because there the damage reaches the decoders, but their scores are not compared.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import cv2
import numpy as np
from mcap.writer import CompressionType, IndexType

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "log"))

from encoders_foxglove import Fox, Json
from encoders_ros import LEVEL, NS, Encoded, RosMessages
from made_up_logs import BASE_NS, PERIOD_NS, Recorder, label_picture, picture, png
from rvl_writer import rvl

from stsem.camera import Camera
from stsem.classes import ClassSet
from stsem.log.writer import LogWriter

FRAMES = 8
NAMES = {0: "wall", 1: "floor", 2: "door"}
K = [30.0, 0.0, 15.5, 0.0, 30.0, 11.5, 0.0, 0.0, 1.0]
Images = Callable[[Any, int, int], tuple[Encoded, Encoded, Encoded]]
"""(maker of messages, stamp, frame) -> colour, depth, labels."""


@dataclass(frozen=True)
class Subject:
    """A log.

    Args:
        write: writes it to a path.
        protected: whether every changed byte that matters can be noticed.
    """

    write: Callable[[Path], object]
    protected: bool = True


def depth_mm(i: int) -> "np.ndarray[Any, Any]":
    """(H, W) uint16 millimetres of a slanted plane, with unknown pixels."""
    y, x = np.mgrid[:24, :32]
    depth = (1000 + 5 * x + 3 * y + 10 * i).astype("<u2")
    depth[0, :2] = 0, 65535
    return depth


def jpeg_and_raw(make: Any, stamp: int, i: int) -> tuple[Encoded, Encoded, Encoded]:
    jpeg = bytes(cv2.imencode(".jpg", picture(i))[1])
    return (
        make.compressed(stamp, jpeg, "rgb8; jpeg compressed bgr8"),
        make.image(stamp, depth_mm(i), "16UC1"),
        make.image(stamp, label_picture(i), "mono8"),
    )


def raw_and_png(make: Any, stamp: int, i: int) -> tuple[Encoded, Encoded, Encoded]:
    metres = (depth_mm(i) / 1000).astype("<f4")
    labels = png(label_picture(i))
    return (
        make.image(stamp, picture(i), "rgb8"),
        make.image(stamp, metres, "32FC1"),
        make.compressed(stamp, labels, "png"),
    )


def png_and_rvl(make: Any, stamp: int, i: int) -> tuple[Encoded, Encoded, Encoded]:
    size = np.array([32, 24], "<u4").tobytes()
    return (
        make.compressed(stamp, png(picture(i)), "png"),
        make.compressed(stamp, bytes(12) + size + rvl(depth_mm(i)), "16UC1; compressedDepth rvl"),
        make.image(stamp, label_picture(i), "mono8"),
    )


def _recorded(path: Path, make: Any, images: Images, **options: Any) -> Path:
    log = Recorder(path, **options)
    if isinstance(make, RosMessages):
        log.put("/gt/label_info", make.label_info(BASE_NS, NAMES), BASE_NS)
    else:
        log.writer.add_metadata("stsem.classes", {str(i): name for i, name in NAMES.items()})
    log.put("/tf_static", make.tf(BASE_NS - 3 * NS, [("base", "camera", (0.0, 0.0, 0.5), LEVEL)]), BASE_NS)
    for i in range(FRAMES):
        stamp = BASE_NS + i * PERIOD_NS
        for k in (-50_000_000, 50_000_000):
            link = ("world", "base", (0.01 * (i + k / PERIOD_NS), 0.0, 0.0), LEVEL)
            log.put("/tf", make.tf(stamp + k, [link]), stamp + k + 2_000_000)
        color, depth, labels = images(make, stamp, i)
        log.put("/cam/color/camera_info", make.camera_info(stamp, 32, 24, K), stamp + 4_000_000)
        log.put("/cam/color/image", color, stamp + 5_000_000)
        log.put("/cam/depth/image", depth, stamp + 9_000_000)
        log.put("/gt/labels", labels, stamp + 20_000_000)
    return log.close()


def _ours(path: Path) -> None:
    """As every log that `stsem` writes, except for the size of the chunks: one alone would hold a log so small."""
    with mock.patch("stsem.log.mcapfile._CHUNK_BYTES", 6000), LogWriter(path, ClassSet(tuple(NAMES.values()))) as log:
        for i in range(FRAMES):
            stamp = BASE_NS + i * PERIOD_NS
            T_WC = np.eye(4)
            T_WC[0, 3] = 0.01 * i
            log.calibration(stamp, stamp, Camera(32, 24, 30.0, 30.0, 15.5, 11.5))
            log.pose(stamp, stamp + 3_000_000, T_WC)
            log.color(stamp, stamp + 5_000_000, picture(i))
            log.depth(stamp, stamp + 9_000_000, depth_mm(i))
            log.labels(stamp, stamp + 20_000_000, label_picture(i))


def _subject(make: Callable[[], Any], images: Images, *, protected: bool = True, **options: Any) -> Subject:
    return Subject(lambda path: _recorded(path, make(), images, **options), protected)


BARE: dict[str, Any] = {"use_chunking": False, "protected": False}
THREE = ("ros2", "protobuf", "ours")
SUBJECTS: dict[str, Subject] = {
    "ros2": _subject(lambda: RosMessages(2), jpeg_and_raw),
    "protobuf": _subject(Fox, raw_and_png, use_chunking=False, enable_data_crcs=True),
    "ours": Subject(_ours),
    "ros1": _subject(
        lambda: RosMessages(1), png_and_rvl, compression=CompressionType.LZ4, enable_data_crcs=True,
        index_types=IndexType.MESSAGE, use_statistics=False, use_summary_offsets=False, repeat_channels=False,
    ),
    "json": _subject(Json, jpeg_and_raw, compression=CompressionType.NONE, chunk_size=8000, enable_data_crcs=True),
    "bare-ros2": _subject(lambda: RosMessages(2), jpeg_and_raw, **BARE),
    "bare-ros1": _subject(lambda: RosMessages(1), png_and_rvl, **BARE),
    "bare-protobuf": _subject(Fox, raw_and_png, **BARE),
    "bare-json": _subject(Json, jpeg_and_raw, **BARE),
}  # fmt: skip


def written(folder: Path) -> dict[str, bytes]:
    """name -> bytes of every log; written to `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, subject in SUBJECTS.items():
        subject.write(folder / f"{name}.mcap")
    return {name: (folder / f"{name}.mcap").read_bytes() for name in SUBJECTS}
