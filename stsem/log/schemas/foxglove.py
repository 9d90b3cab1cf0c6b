"""foxglove messages as mappings from field names to values, whichever way they were encoded, to what they say.

A field that is absent has its default (0, "", nothing), as in protobuf. Values come from a file: each is checked, and
ValueError says what is wrong with it.
"""

import base64
from collections.abc import Mapping, Sequence
from typing import Any

from stsem.log.schemas.calibration import Intrinsics, calibration
from stsem.log.schemas.cursor import MAX_TEXT, NS
from stsem.log.schemas.messages import Calibration, CompressedImage, RawImage, Transform

Fields = Mapping[str, Any]
NOTHING: Fields = {}
INTEGERS = range(-(1 << 63), 1 << 63)


def raw_image(fields: Fields) -> RawImage:
    """foxglove.RawImage, whose samples are little endian."""
    width, height, step = (size(fields, name) for name in ("width", "height", "step"))
    return RawImage(
        stamp(fields), text(fields, "frame_id"), width, height, text(fields, "encoding"), False, step, data(fields)
    )


def compressed_image(fields: Fields) -> CompressedImage:
    """foxglove.CompressedImage (and CompressedVideo, whose data are refused later)."""
    return CompressedImage(stamp(fields), text(fields, "frame_id"), text(fields, "format"), data(fields))


def camera_calibration(fields: Fields) -> Calibration:
    """foxglove.CameraCalibration."""
    k, d, p = (numbers(fields, name) for name in ("K", "D", "P"))
    model = text(fields, "distortion_model")
    sensor = Intrinsics(size(fields, "width"), size(fields, "height"), k, d, model, p)
    return calibration(stamp(fields), text(fields, "frame_id"), sensor)


def pose_in_frame(fields: Fields) -> tuple[Transform, ...]:
    """foxglove.PoseInFrame."""
    return (_pose(fields, ""),)


def odometry(fields: Fields) -> tuple[Transform, ...]:
    """foxglove.Odometry, the pose of `body_frame_id`."""
    return (_pose(fields, text(fields, "body_frame_id")),)


def frame_transform(fields: Fields) -> tuple[Transform, ...]:
    """foxglove.FrameTransform."""
    parent, child = text(fields, "parent_frame_id"), text(fields, "child_frame_id")
    return (_transform(fields, parent, child, mapping(fields, "translation"), mapping(fields, "rotation")),)


def frame_transforms(fields: Fields) -> tuple[Transform, ...]:
    """foxglove.FrameTransforms."""
    items = fields.get("transforms") or ()
    if not isinstance(items, Sequence) or not all(isinstance(item, Mapping) for item in items):
        raise ValueError("transforms is not a list of messages")
    return tuple(frame_transform(item)[0] for item in items)


def stamp(fields: Fields) -> int | None:
    """The field `timestamp` in nanoseconds; None when it is absent or zero, which means unset."""
    time = mapping(fields, "timestamp")
    seconds, rest = ("sec", "nsec") if "sec" in time else ("seconds", "nanos")
    return integer(time, seconds) * NS + integer(time, rest) or None


def mapping(fields: Fields, name: str) -> Fields:
    """The message in the field `name`."""
    value = fields.get(name)
    if value is None:
        return NOTHING
    if not isinstance(value, Mapping):
        raise ValueError(f"{name} is not a message")
    return value


def integer(fields: Fields, name: str) -> int:
    """The whole number of 64 bits in the field `name`."""
    value = fields.get(name, 0)
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if not isinstance(value, int) or isinstance(value, bool) or value not in INTEGERS:
        raise ValueError(f"{name} is not a whole number of 64 bits")
    return value


def size(fields: Fields, name: str) -> int:
    """The number of pixels or bytes in the field `name`."""
    value = integer(fields, name)
    if not 0 <= value < 1 << 32:
        raise ValueError(f"{name} is {value}, which is no size")
    return value


def number(fields: Fields, name: str) -> float:
    """The number in the field `name`, which may be NaN."""
    return _float(fields.get(name, 0.0), name)


def numbers(fields: Fields, name: str) -> tuple[float, ...]:
    """The numbers in the field `name`."""
    values = fields.get(name) or ()
    if not isinstance(values, Sequence) or isinstance(values, str | memoryview):
        raise ValueError(f"{name} is not a list of numbers")
    return tuple(_float(value, name) for value in values)


def text(fields: Fields, name: str) -> str:
    """The short text in the field `name`."""
    value = fields.get(name, "")
    if not isinstance(value, str):
        raise ValueError(f"{name} is not a text")
    if len(value) > MAX_TEXT:
        raise ValueError(f"{name} has {len(value)} characters")
    return value


def data(fields: Fields) -> memoryview:
    """The bytes in the field `data`, which JSON holds in base64."""
    value = fields.get("data", b"")
    if isinstance(value, str):
        value = base64.b64decode(value, validate=True)
    if not isinstance(value, bytes | memoryview):
        raise ValueError("data is not bytes or base64")
    return memoryview(value)


def _pose(fields: Fields, child: str) -> Transform:
    pose = mapping(fields, "pose")
    return _transform(fields, text(fields, "frame_id"), child, mapping(pose, "position"), mapping(pose, "orientation"))


def _transform(fields: Fields, parent: str, child: str, t: Fields, q: Fields) -> Transform:
    return Transform(
        stamp(fields), parent.lstrip("/"), child.lstrip("/"), (number(t, "x"), number(t, "y"), number(t, "z")),
        (number(q, "x"), number(q, "y"), number(q, "z"), number(q, "w")),
    )  # fmt: skip


def _float(value: object, name: str) -> float:
    if isinstance(value, float):
        return value
    if not isinstance(value, int) or isinstance(value, bool) or value not in INTEGERS:
        raise ValueError(f"{name} holds something that is not a number")
    return float(value)
