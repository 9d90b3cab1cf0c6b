"""Our own logs: the foxglove schemas, depth and labels as raw images in zstd chunks (DESIGN 10)."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Protocol, Self

import numpy as np
import numpy.typing as npt
from foxglove import messages as fox
from mcap.well_known import MessageEncoding
from mcap.writer import CompressionType, Writer

from stsem.camera import Camera
from stsem.classes import NO_LABEL, ClassSet, Labels
from stsem.errors import OutputError
from stsem.frame import Image
from stsem.log import encode
from stsem.pose import Pose

WORLD, OPTICAL = "world", "camera_optical"
_CHUNK_BYTES = 2 << 20


class _Encodable(Protocol):
    def encode(self) -> bytes: ...


_SCHEMAS: dict[str, Any] = {
    "/camera/color": fox.CompressedImage,
    "/camera/depth": fox.RawImage,
    "/gt/labels": fox.RawImage,
    "/camera/calibration": fox.CameraCalibration,
    "/pose": fox.PoseInFrame,
}


class LogWriter:
    """Writes a log beside `path` and renames it when it is complete.

    Messages must come in ascending order of log time; equal input gives equal bytes. With an exception inside the
    `with` block nothing is left behind.

    Args:
        path: the file.
        classes: names and colours; they go into the metadata record `stsem.classes` and the attachment `classes.json`.

    Raises:
        OutputError: the file cannot be written; a place that cannot be is found out at once.
    """

    def __init__(self, path: Path, classes: ClassSet) -> None:
        if path.is_dir():
            raise OutputError(f"The log {path} cannot be written: it is a folder; give the name of a file in it.")
        self._path, self._aside, self._classes = path, path.with_name(f".{path.name}.{os.getpid()}"), classes
        self._counts = dict.fromkeys(_SCHEMAS, 0)
        self._last_ns = 0
        self._stream: IO[bytes] = self._open()
        self._writer = Writer(
            self._stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        with self._whole_or_nothing():
            self._writer.start("", "stsem")
            names = {str(i): name for i, name in enumerate(classes.names)}
            self._writer.add_metadata("stsem.classes", names)
            self._channels = {topic: self._register(topic, schema) for topic, schema in _SCHEMAS.items()}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is not None:
            self._discard()
            return
        with self._whole_or_nothing():
            self._writer.add_attachment(0, self._last_ns, "classes.json", "application/json", self._class_table())
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.close()
            self._aside.replace(self._path)

    def color(self, stamp_ns: int, log_ns: int, image: Image) -> None:
        """A colour image (H, W, 3) uint8 RGB, as JPEG."""
        self._write("/camera/color", stamp_ns, log_ns, encode.jpeg_image(image, stamp_ns, OPTICAL))

    def depth(self, stamp_ns: int, log_ns: int, millimetres: npt.NDArray[np.uint16]) -> None:
        """Depth (H, W) uint16 along z, 0 unknown, pixel for pixel that of the colour image."""
        self._write(
            "/camera/depth", stamp_ns, log_ns, encode.raw_image(millimetres.astype("<u2"), "16UC1", stamp_ns, OPTICAL)
        )

    def labels(self, stamp_ns: int, log_ns: int, labels: Labels) -> None:
        """Truth (H, W) uint8 class ids, 255 ignored."""
        self._write("/gt/labels", stamp_ns, log_ns, encode.raw_image(labels, "mono8", stamp_ns, OPTICAL))

    def calibration(self, stamp_ns: int, log_ns: int, camera: Camera) -> None:
        """Intrinsics of the colour and the depth image."""
        K = camera.K.ravel().tolist()
        message = fox.CameraCalibration(
            timestamp=encode.timestamp(stamp_ns), frame_id=OPTICAL, width=camera.width, height=camera.height,
            distortion_model="plumb_bob", D=[0.0] * 5, K=K, R=np.eye(3).ravel().tolist(),
            P=np.hstack([camera.K, np.zeros((3, 1))]).ravel().tolist(),
        )  # fmt: skip
        self._write("/camera/calibration", stamp_ns, log_ns, message)

    def pose(self, stamp_ns: int, log_ns: int, T_WC: Pose) -> None:
        """Pose of the optical frame in the world, metres."""
        pose = fox.Pose(position=encode.vector(T_WC), orientation=encode.quaternion(T_WC))
        stamp = encode.timestamp(stamp_ns)
        self._write("/pose", stamp_ns, log_ns, fox.PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=pose))

    def _open(self) -> IO[bytes]:
        try:
            return self._aside.open("wb")
        except OSError as err:
            raise self._unwritable(err) from err

    @contextmanager
    def _whole_or_nothing(self) -> Iterator[None]:
        try:
            yield
        except OSError as err:
            self._discard()
            raise self._unwritable(err) from err
        except BaseException:
            self._discard()
            raise

    def _discard(self) -> None:
        """Closing flushes, which fails once more on a full disk."""
        with suppress(OSError):
            self._stream.close()
        self._aside.unlink(missing_ok=True)

    def _unwritable(self, err: OSError) -> OutputError:
        return OutputError(f"The log {self._path} cannot be written: {err.strerror or err}; choose another place.")

    def _register(self, topic: str, schema: Any) -> int:
        described = schema.get_schema()
        schema_id = self._writer.register_schema(described.name, described.encoding, described.data)
        return self._writer.register_channel(topic, MessageEncoding.Protobuf, schema_id)

    def _write(self, topic: str, stamp_ns: int, log_ns: int, message: _Encodable) -> None:
        if log_ns < self._last_ns:
            raise ValueError(f"{topic} at {log_ns} ns came after a message at {self._last_ns} ns")
        try:
            self._writer.add_message(self._channels[topic], log_ns, message.encode(), stamp_ns, self._counts[topic])
        except OSError as err:
            raise self._unwritable(err) from err
        self._counts[topic] += 1
        self._last_ns = log_ns

    def _class_table(self) -> bytes:
        colours = self._classes.palette()[: len(self._classes)].tolist()
        table = {"names": list(self._classes.names), "colours": colours, "ignore_id": NO_LABEL}
        return (json.dumps(table, indent=1) + "\n").encode()
