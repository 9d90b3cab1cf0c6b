"""Our own logs: the foxglove schemas, depth and labels as raw images in zstd chunks (DESIGN 10)."""

import json
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt
from foxglove import messages as fox
from mcap.well_known import MessageEncoding

from stsem.camera import Camera
from stsem.classes import NO_LABEL, ClassSet, Labels
from stsem.frame import Depth, Image
from stsem.log import encode
from stsem.log.mcapfile import McapFile
from stsem.pose import Pose

WORLD, OPTICAL, DEPTH_OPTICAL = "world", "camera_optical", "depth_optical"
COLOR, DEPTH, LABELS, CALIBRATION, POSE = "/camera/color", "/camera/depth", "/gt/labels", "/camera/calibration", "/pose"
DEPTH_CALIBRATION, STATIC = "/camera/depth/calibration", "/tf_static"


class _Encodable(Protocol):
    def encode(self) -> bytes: ...


_SCHEMAS: dict[str, Any] = {
    COLOR: fox.CompressedImage,
    DEPTH: fox.RawImage,
    LABELS: fox.RawImage,
    CALIBRATION: fox.CameraCalibration,
    POSE: fox.PoseInFrame,
    DEPTH_CALIBRATION: fox.CameraCalibration,
    STATIC: fox.FrameTransform,
}
RENDERED = (COLOR, DEPTH, LABELS, CALIBRATION, POSE)
"""Channels of a rendered log, in the order in which they stand in the file."""


class LogWriter:
    """Writes a log beside `path` and renames it when it is complete.

    Messages must come in ascending order of log time; equal input gives equal bytes. With an exception inside the
    `with` block nothing is left behind.

    Args:
        path: the file.
        classes: names and colours; they go into the metadata record `stsem.classes` and the attachment `classes.json`.
            None: neither is written.
        declared: channels that are there even without a message; the others appear with their first one.

    Raises:
        OutputError: the file cannot be written; a place that cannot be is found out at once.
    """

    def __init__(self, path: Path, classes: ClassSet | None, declared: Sequence[str] = RENDERED) -> None:
        self._classes, self._depth_frame = classes, OPTICAL
        self._channels: dict[str, int] = {}
        self._file = McapFile(path)
        if classes is not None:
            self._file.metadata("stsem.classes", {str(i): name for i, name in enumerate(classes.names)})
        for topic in declared:
            self._register(topic)

    @property
    def counts(self) -> dict[str, int]:
        """Topic -> messages written so far."""
        return self._file.counts

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None and self._classes is not None:
            self._file.attachment("classes.json", "application/json", _class_table(self._classes))
        self._file.__exit__(kind, error, tb)

    def color(self, stamp_ns: int, log_ns: int, image: Image) -> None:
        """A colour image (H, W, 3) uint8 RGB, as JPEG."""
        self._write(COLOR, stamp_ns, log_ns, encode.jpeg_image(image, stamp_ns, OPTICAL))

    def color_pixels(self, stamp_ns: int, log_ns: int, image: Image) -> None:
        """A colour image (H, W, 3) uint8 RGB, without loss, as PNG."""
        self._write(COLOR, stamp_ns, log_ns, encode.png_image(image, stamp_ns, OPTICAL))

    def color_file(self, stamp_ns: int, log_ns: int, data: bytes, form: str) -> None:
        """A colour image as the bytes of its file, untouched; `form` is `jpeg`, `png` or `webp`."""
        self._write(COLOR, stamp_ns, log_ns, encode.image_file(data, form, stamp_ns, OPTICAL))

    def depth(self, stamp_ns: int, log_ns: int, millimetres: npt.NDArray[np.uint16]) -> None:
        """Depth (H, W) uint16 along z, 0 unknown, pixel for pixel that of the colour image."""
        message = encode.raw_image(millimetres.astype("<u2"), "16UC1", stamp_ns, self._depth_frame)
        self._write(DEPTH, stamp_ns, log_ns, message)

    def depth_metres(self, stamp_ns: int, log_ns: int, depth: Depth) -> None:
        """Depth (H, W) float32 metres along z, NaN unknown; as whole millimetres when nothing is lost by that."""
        millimetres = encode.whole_millimetres(depth)
        if millimetres is not None:
            self.depth(stamp_ns, log_ns, millimetres)
            return
        message = encode.raw_image(depth.astype("<f4"), "32FC1", stamp_ns, self._depth_frame)
        self._write(DEPTH, stamp_ns, log_ns, message)

    def depth_camera(self, stamp_ns: int, log_ns: int, camera: Camera, T_color_depth: Pose | None) -> None:
        """A depth camera of its own: call it before its first image.

        Args:
            stamp_ns, log_ns: when.
            camera: its intrinsics.
            T_color_depth: (4, 4) colour camera from depth camera, metres; None when unknown.
        """
        self._depth_frame = DEPTH_OPTICAL
        message = encode.calibration(camera, stamp_ns, DEPTH_OPTICAL)
        self._write(DEPTH_CALIBRATION, stamp_ns, log_ns, message)
        if T_color_depth is not None:
            transform = fox.FrameTransform(
                timestamp=encode.timestamp(stamp_ns), parent_frame_id=OPTICAL, child_frame_id=DEPTH_OPTICAL,
                translation=encode.vector(T_color_depth), rotation=encode.quaternion(T_color_depth),
            )  # fmt: skip
            self._write(STATIC, stamp_ns, log_ns, transform)

    def labels(self, stamp_ns: int, log_ns: int, labels: Labels) -> None:
        """Truth (H, W) uint8 class ids, 255 ignored."""
        self._write(LABELS, stamp_ns, log_ns, encode.raw_image(labels, "mono8", stamp_ns, OPTICAL))

    def calibration(self, stamp_ns: int, log_ns: int, camera: Camera) -> None:
        """Intrinsics of the colour image, and of the depth image unless it has a camera of its own."""
        self._write(CALIBRATION, stamp_ns, log_ns, encode.calibration(camera, stamp_ns, OPTICAL))

    def pose(self, stamp_ns: int, log_ns: int, T_WC: Pose) -> None:
        """Pose of the optical frame in the world, metres."""
        pose = fox.Pose(position=encode.vector(T_WC), orientation=encode.quaternion(T_WC))
        stamp = encode.timestamp(stamp_ns)
        self._write(POSE, stamp_ns, log_ns, fox.PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=pose))

    def _register(self, topic: str) -> None:
        described = _SCHEMAS[topic].get_schema()
        schema = self._file.schema(described.name, described.encoding, described.data)
        self._channels[topic] = self._file.channel(topic, schema, MessageEncoding.Protobuf)

    def _write(self, topic: str, stamp_ns: int, log_ns: int, message: _Encodable) -> None:
        if log_ns < self._file.last_ns:
            raise ValueError(f"{topic} at {log_ns} ns came after a message at {self._file.last_ns} ns")
        if topic not in self._channels:
            self._register(topic)
        self._file.message(self._channels[topic], log_ns, stamp_ns, message.encode(), self.counts[topic])


def _class_table(classes: ClassSet) -> bytes:
    colours = classes.palette()[: len(classes)].tolist()
    table = {"names": list(classes.names), "colours": colours, "ignore_id": NO_LABEL}
    return (json.dumps(table, indent=1) + "\n").encode()
