"""A small complete foxglove log: a window that slides over a painted wall, so that every homography is known."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from foxglove.messages import (
    CameraCalibration,
    Pose,
    PoseInFrame,
    Quaternion,
    RawImage,
    Timestamp,
    Vector3,
)
from mcap.writer import CompressionType, Writer

NS = 1_000_000_000
BASE_NS = 1_700_000_000 * NS
PERIOD_NS = 100_000_000
SHIFT = 2
NAMES = {0: "wall", 1: "floor", 2: "door"}
DELAYS_NS = {"color": 5_000_000, "depth": 9_000_000, "pose": 3_000_000, "labels": 20_000_000}

Bytes = npt.NDArray[np.uint8]


def always(index: int) -> bool:
    """For every frame."""
    return True


def wall(width: int, height: int, frames: int) -> tuple[Bytes, Bytes]:
    """(colours (h, w, 3), labels (h, w)) of the whole wall: blobs with corners, and three classes in stripes."""
    rng = np.random.default_rng(7)
    full = width + SHIFT * frames
    coarse = rng.integers(0, 255, (height // 4 + 1, full // 4 + 1, 3), np.uint8)
    colours = cv2.resize(coarse, (full, height), interpolation=cv2.INTER_NEAREST)
    labels = (np.mgrid[:height, :full][1] // 20 % 3).astype(np.uint8)
    labels[:3] = 255
    return np.asarray(colours, np.uint8), labels


def write_walk(
    path: Path,
    *,
    frames: int = 12,
    size: tuple[int, int] = (96, 64),
    truth: Callable[[int], bool] | None = always,
    depth: Callable[[int], bool] | None = always,
    poses: bool = True,
    broken: frozenset[int] = frozenset(),
    broken_labels: frozenset[int] = frozenset(),
    names: Mapping[int, str] | None = NAMES,
    distortion: tuple[float, ...] = (),
    metadata: Mapping[str, Mapping[str, str]] | None = None,
    second_camera: bool = False,
    dark: Callable[[int], bool] = lambda index: False,
    pause_ns: int = 0,
) -> Path:
    """Write the log.

    Args:
        path: of the file.
        frames: at 10 Hz; the window moves 2 pixels a frame.
        size: (width, height) of colour, depth and labels.
        truth, depth: which frames have labels and depth; None for no such channel.
        poses: whether the log has poses.
        broken, broken_labels: frames whose image, or label image, holds too few bytes.
        names: class table; None for none.
        distortion: of the calibration.
        metadata: further records.
        second_camera: `/second/color` shows the same at the same stamps, inverted.
        dark: which images are black.
        pause_ns: how much later than its turn everything from the middle frame on comes.
    """
    width, height = size
    colours, labels = wall(width, height, frames)
    with path.open("wb") as stream:
        log = _Recorder(Writer(stream, compression=CompressionType.ZSTD, chunk_size=1 << 16))
        for name, record in (metadata or {}).items():
            log.writer.add_metadata(name, dict(record))
        if names is not None:
            log.writer.add_metadata("stsem.classes", {str(raw): name for raw, name in names.items()})
        for i in range(frames):
            stamp = BASE_NS + i * PERIOD_NS + pause_ns * (i >= frames // 2)
            log.add("/camera/calibration", _calibration(stamp, size, distortion), stamp + 1_000_000)
            if poses:
                log.add("/pose", _pose(stamp, 0.01 * i), stamp + DELAYS_NS["pose"])
            window = np.s_[:, SHIFT * i : SHIFT * i + width]
            color = _image(stamp, colours[window] * (not dark(i)), "rgb8", 3 * width, cut=i in broken)
            log.add("/camera/color", color, stamp + DELAYS_NS["color"])
            if second_camera:
                inverted = _image(stamp, 255 - colours[window], "rgb8", 3 * width)
                log.add("/second/color", inverted, stamp + DELAYS_NS["color"])
            if depth is not None and depth(i):
                metres = np.full((height, width), 2000, "<u2")
                metres[:4] = 0
                log.add("/camera/depth", _image(stamp, metres, "16UC1", 2 * width), stamp + DELAYS_NS["depth"])
            if truth is not None and truth(i):
                log.add(
                    "/gt/labels",
                    _image(stamp, labels[window], "mono8", width, cut=i in broken_labels),
                    stamp + DELAYS_NS["labels"],
                )
        log.writer.finish()
    return path


class _Recorder:
    def __init__(self, writer: Writer) -> None:
        self.writer = writer
        writer.start("", "tests")
        self._channels: dict[str, int] = {}

    def add(self, topic: str, message: Any, log_ns: int) -> None:
        if topic not in self._channels:
            schema = message.get_schema()
            number = self.writer.register_schema(schema.name, schema.encoding, schema.data)
            self._channels[topic] = self.writer.register_channel(topic, "protobuf", number)
        self.writer.add_message(self._channels[topic], log_ns, message.encode(), log_ns)


def _stamp(ns: int) -> Timestamp:
    return Timestamp(ns // NS, ns % NS)


def _image(stamp: int, pixels: npt.NDArray[Any], encoding: str, step: int, *, cut: bool = False) -> RawImage:
    data = np.ascontiguousarray(pixels).tobytes()
    return RawImage(
        timestamp=_stamp(stamp), frame_id="camera", width=pixels.shape[1], height=pixels.shape[0], encoding=encoding,
        step=step, data=data[:100] if cut else data,
    )  # fmt: skip


def _calibration(stamp: int, size: tuple[int, int], distortion: tuple[float, ...]) -> CameraCalibration:
    width, height = size
    return CameraCalibration(
        timestamp=_stamp(stamp), frame_id="camera", width=width, height=height, distortion_model="plumb_bob",
        D=list(distortion), K=[80.0, 0, (width - 1) / 2, 0, 80.0, (height - 1) / 2, 0, 0, 1],
    )  # fmt: skip


def _pose(stamp: int, x: float) -> PoseInFrame:
    pose = Pose(position=Vector3(x=x, y=0.0, z=0.0), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))
    return PoseInFrame(timestamp=_stamp(stamp), frame_id="world", pose=pose)
