"""annotated.mcap: the answers of a run and its images on the log's own clock, for Foxglove, Lichtblick and Rerun."""

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from foxglove import messages as fox
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

from stsem import __version__
from stsem.classes import NO_LABEL, ClassSet, Labels
from stsem.errors import OutputError
from stsem.frame import Frame, Image
from stsem.log import encode
from stsem.log.classtable import METADATA
from stsem.result import FrameResult
from stsem.uncertainty import ROOT, TOP_LEVEL, UNITS, Uncertainty, ceiling

LEVELS = "stsem.uncertainty"
"""Metadata record: measure -> the value that a level of its images stands for."""

_OPAQUE = 0.55
_WORLD, _CAMERA = "world", "camera_optical"
_ANSWER_SCHEMA = {
    "type": "object",
    "properties": {
        "frame": {"type": "integer"}, "outcome": {"type": "string"}, "keyframe": {"type": ["integer", "null"]},
        "reason": {"type": "string"}, "remark": {"type": "string"}, "latency_ms": {"type": ["number", "null"]},
        "coverage": {"type": ["number", "null"]},
    },
}  # fmt: skip


class AnnotatedLog:
    """Writes channels per mode while a replay goes on: `with AnnotatedLog(...)`, which leaves no file after an error.

    Channels: `/stsem/MODE/overlay` (CompressedImage), `/stsem/MODE/labels` (RawImage rgb8 in the classes' colours),
    `/stsem/MODE/answer` (JSON: outcome, keyframe, latency), `/stsem/pose` (FrameTransform), `/stsem/map` (PointCloud),
    and for segmented frames of a network that gives them `/stsem/MODE/uncertainty/MEASURE` (RawImage mono8; the
    metadata record `stsem.uncertainty` says which value a level stands for).
    Message times are capture stamps of the log, so that it lines up with the log it was made from. The metadata record
    `stsem.classes` says name -> `#rrggbb id`: with it, the labels read back as a log's truth would.

    Args:
        path: the file.
        classes: names and colours of the labels.

    Raises:
        OutputError: the file cannot be written; also from every method.
    """

    def __init__(self, path: Path, classes: ClassSet) -> None:
        self._path, self._palette = path, classes.palette()
        self._channels: dict[str, int] = {}
        self._posed: set[int] = set()
        self._explained = False
        with _writing(path):
            self._stream = path.open("wb")
            self._writer = Writer(self._stream, compression=CompressionType.ZSTD, enable_data_crcs=True)
            self._writer.start("", f"stsem {__version__}")
            self._writer.add_metadata(METADATA, _legend(classes))

    def __enter__(self) -> "AnnotatedLog":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._discard()

    def answer(self, mode: str, result: FrameResult, frame: Frame) -> None:
        """One answered frame of one mode; `result.labels` are shown at the size of the image."""
        if result.labels is None:
            return
        labels, stamp = _at_size(result.labels, frame.size), frame.stamp_ns
        colours = self._palette[labels]
        self._message(
            f"/stsem/{mode}/overlay", stamp, encode.jpeg_image(_blend(frame.image, colours, labels), stamp, _CAMERA)
        )
        self._message(f"/stsem/{mode}/labels", stamp, encode.raw_image(colours, "rgb8", stamp, _CAMERA))
        self._json(f"/stsem/{mode}/answer", stamp, _facts(result))
        if result.uncertainty is not None:
            self._uncertainty(mode, stamp, result.uncertainty)
        if frame.T_WC is not None and frame.index not in self._posed:
            self._posed.add(frame.index)
            self._message("/stsem/pose", stamp, _transform(frame.T_WC, stamp))

    def _uncertainty(self, mode: str, stamp_ns: int, said: Uncertainty) -> None:
        if not self._explained:
            self._explained = True
            with _writing(self._path):
                self._writer.add_metadata(LEVELS, {measure: _scale(measure, said.classes) for measure in said.measures})
        for measure in said.measures:
            image = encode.raw_image(said.of(measure), "mono8", stamp_ns, _CAMERA)
            self._message(f"/stsem/{mode}/uncertainty/{measure}", stamp_ns, image)

    def map(self, stamp_ns: int, xyz: npt.NDArray[np.float64], labels: Labels) -> None:
        """The labelled points (n, 3) in world metres, coloured by class, shown from `stamp_ns` on."""
        packed = np.zeros(len(xyz), np.dtype([("xyz", "<f4", 3), ("rgba", "u1", 4), ("label", "u1")]))
        packed["xyz"], packed["label"] = xyz, labels
        packed["rgba"][:, :3], packed["rgba"][:, 3] = self._palette[labels], 255
        floats = [fox.PackedElementField(name=n, offset=4 * i, type=fox.PackedElementFieldNumericType.Float32)
                  for i, n in enumerate("xyz")]  # fmt: skip
        bytes_ = [fox.PackedElementField(name=n, offset=12 + i, type=fox.PackedElementFieldNumericType.Uint8)
                  for i, n in enumerate(("red", "green", "blue", "alpha", "label"))]  # fmt: skip
        cloud = fox.PointCloud(
            timestamp=encode.timestamp(stamp_ns), frame_id=_WORLD, pose=_identity(), point_stride=packed.itemsize,
            fields=floats + bytes_, data=packed.tobytes(),
        )  # fmt: skip
        self._message("/stsem/map", stamp_ns, cloud)

    def close(self) -> None:
        """Finish the file; nothing happens when it is closed already."""
        if self._stream.closed:
            return
        try:
            with _writing(self._path):
                self._writer.finish()  # type: ignore[no-untyped-call]
                self._stream.close()
        except OutputError:
            self._discard()
            raise

    def _discard(self) -> None:
        with suppress(OSError):  # closing writes what is buffered, which may be what went wrong
            self._stream.close()
        self._path.unlink(missing_ok=True)

    def _message(self, topic: str, stamp_ns: int, message: Any) -> None:
        if topic not in self._channels:
            schema = type(message).get_schema()
            self._channel(topic, schema.name, schema.encoding, schema.data, MessageEncoding.Protobuf)
        self._add(topic, stamp_ns, message.encode())

    def _json(self, topic: str, stamp_ns: int, facts: dict[str, Any]) -> None:
        if topic not in self._channels:
            schema = json.dumps(_ANSWER_SCHEMA).encode()
            self._channel(topic, "stsem.Answer", SchemaEncoding.JSONSchema, schema, MessageEncoding.JSON)
        self._add(topic, stamp_ns, json.dumps(facts).encode())

    def _channel(self, topic: str, schema: str, kind: str, definition: bytes, encoding: str) -> None:
        with _writing(self._path):
            schema_id = self._writer.register_schema(schema, kind, definition)
            self._channels[topic] = self._writer.register_channel(topic, encoding, schema_id)

    def _add(self, topic: str, stamp_ns: int, data: bytes) -> None:
        with _writing(self._path):
            self._writer.add_message(self._channels[topic], stamp_ns, data, stamp_ns)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as err:
        raise OutputError(
            f"The annotated log {path} cannot be written ({err.strerror or err}); make room or leave out --annotate."
        ) from err


def _legend(classes: ClassSet) -> dict[str, str]:
    """name -> "#rrggbb id", as stsem reads class tables of colour-coded labels."""
    colours = classes.palette()
    return {name: f"#{colours[i].tobytes().hex()} {i}" for i, name in enumerate(classes.names)}


def _scale(measure: str, classes: int) -> str:
    """`value = 2.5649 nats (level / 255)^4`."""
    top = f"{ceiling(measure, classes):.5g} {UNITS[measure]}".rstrip()
    return f"value = {top} (level / {TOP_LEVEL})^{ROOT}"


def _facts(result: FrameResult) -> dict[str, Any]:
    latency = None
    if result.answered_ns is not None and result.arrival_ns is not None:
        latency = (result.answered_ns - result.arrival_ns) / 1e6
    return {
        "frame": result.index, "outcome": str(result.outcome), "keyframe": result.keyframe, "reason": result.reason,
        "remark": result.remark, "latency_ms": latency, "coverage": result.coverage,
    }  # fmt: skip


def _blend(image: Image, colours: Image, labels: Labels) -> Image:
    mixed = cv2.addWeighted(image, 1 - _OPAQUE, colours, _OPAQUE, 0)
    return np.where((labels == NO_LABEL)[:, :, None], image, mixed).astype(np.uint8)


def _at_size(labels: Labels, size: tuple[int, int]) -> Labels:
    if labels.shape == (size[1], size[0]):
        return labels
    return np.asarray(cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST_EXACT), np.uint8)


def _transform(T_WC: npt.NDArray[np.float64], stamp_ns: int) -> fox.FrameTransform:
    return fox.FrameTransform(
        timestamp=encode.timestamp(stamp_ns), parent_frame_id=_WORLD, child_frame_id=_CAMERA,
        translation=encode.vector(T_WC), rotation=encode.quaternion(T_WC),
    )  # fmt: skip


def _identity() -> fox.Pose:
    return fox.Pose(position=fox.Vector3(x=0, y=0, z=0), orientation=fox.Quaternion(x=0, y=0, z=0, w=1))
