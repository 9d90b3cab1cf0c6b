"""foxglove messages with the makers of `encoders_ros`: in protobuf by foxglove-sdk, in JSON by hand."""

import base64
import json
from collections.abc import Iterable, Sequence
from typing import Any

import foxglove.messages as fox
import numpy as np
from encoders_ros import LEVEL, NS, Array, Encoded, Link, Quaternion


def fox_time(stamp_ns: int) -> Any:
    return fox.Timestamp(sec=stamp_ns // NS, nsec=stamp_ns % NS)


class Fox:
    """foxglove messages as mappings of fields; `encode` makes protobuf of them.

    There are no class tables among them, no binning and no region of interest, and samples are little endian.
    """

    def image(
        self, stamp_ns: int, pixels: Array, encoding: str, *, frame_id: str = "camera", padding: int = 0,
        size: tuple[int, int] | None = None,
    ) -> Encoded:  # fmt: skip
        """`size` is (width, height) where the rows of `pixels` are not those of the image."""
        rows = pixels.reshape(pixels.shape[0], -1).view(np.uint8)
        padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
        width, height = size or pixels.shape[1::-1]
        return self.encode(
            "RawImage", timestamp=stamp_ns, frame_id=frame_id, width=width, height=height, encoding=encoding,
            step=padded.shape[1], data=padded.tobytes(),
        )  # fmt: skip

    def compressed(self, stamp_ns: int, data: bytes, form: str, frame_id: str = "camera") -> Encoded:
        return self.encode("CompressedImage", timestamp=stamp_ns, frame_id=frame_id, data=data, format=form)

    def video(self, stamp_ns: int, data: bytes, form: str, frame_id: str = "camera") -> Encoded:
        return self.encode("CompressedVideo", timestamp=stamp_ns, frame_id=frame_id, data=data, format=form)

    def camera_info(
        self, stamp_ns: int, width: int, height: int, k: Sequence[float], frame_id: str = "camera", *,
        d: Sequence[float] = (0.0,) * 5, model: str = "plumb_bob", p: Sequence[float] = (0.0,) * 12,
    ) -> Encoded:  # fmt: skip
        return self.encode(
            "CameraCalibration", timestamp=stamp_ns, frame_id=frame_id, width=width, height=height,
            distortion_model=model, D=list(map(float, d)), K=list(map(float, k)), P=list(map(float, p)),
            R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        )  # fmt: skip

    def tf(self, stamp_ns: int, links: Iterable[Link]) -> Encoded:
        return self.encode("FrameTransforms", transforms=[self._transform(stamp_ns, *link) for link in links])

    def transform(self, stamp_ns: int, link: Link) -> Encoded:
        return self.encode("FrameTransform", **self._transform(stamp_ns, *link))

    def pose(self, stamp_ns: int, t: Sequence[float], q: Quaternion = LEVEL, frame_id: str = "world") -> Encoded:
        return self.encode("PoseInFrame", timestamp=stamp_ns, frame_id=frame_id, pose=self._pose(t, q))

    def odometry(
        self, stamp_ns: int, t: Sequence[float], q: Quaternion = LEVEL, frame_id: str = "odom", child: str = "base"
    ) -> Encoded:
        fields = {"frame_id": frame_id, "body_frame_id": child, "pose": self._pose(t, q)}
        return self.encode("Odometry", timestamp=stamp_ns, **fields)

    def encode(self, name: str, **fields: Any) -> Encoded:
        message = _sdk_message(name, fields)
        schema = message.get_schema()
        return Encoded(schema.name, schema.encoding, schema.data, "protobuf", message.encode())

    def _transform(self, stamp_ns: int, parent: str, child: str, t: Sequence[float], q: Quaternion) -> dict[str, Any]:
        return {
            "timestamp": stamp_ns, "parent_frame_id": parent, "child_frame_id": child,
            "translation": dict(zip("xyz", t, strict=True)), "rotation": dict(zip("xyzw", q, strict=True)),
        }  # fmt: skip

    def _pose(self, t: Sequence[float], q: Quaternion) -> dict[str, Any]:
        return {"position": dict(zip("xyz", t, strict=True)), "orientation": dict(zip("xyzw", q, strict=True))}


class Json(Fox):
    """The same in JSON, as foxglove's JSON schemas say: times of sec and nsec, bytes in base64."""

    def encode(self, name: str, **fields: Any) -> Encoded:
        text = json.dumps(_plain(fields), ensure_ascii=False).encode()
        schema = json.dumps({"title": f"foxglove.{name}", "type": "object"}).encode()
        return Encoded(f"foxglove.{name}", "jsonschema", schema, "json", text)


def _plain(value: Any, name: str = "") -> Any:
    if name == "timestamp":
        return {"sec": value // NS, "nsec": value % NS}
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    if isinstance(value, dict):
        return {key: _plain(inner, key) for key, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, list) else value


def _sdk_message(name: str, fields: dict[str, Any]) -> Any:
    return getattr(fox, name)(**{key: _sdk_value(key, value) for key, value in fields.items()})


def _sdk_value(name: str, value: Any) -> Any:
    if name == "timestamp":
        return fox_time(value)
    if name in ("translation", "position"):
        return fox.Vector3(**value)
    if name in ("rotation", "orientation"):
        return fox.Quaternion(**value)
    if name == "pose":
        return fox.Pose(**{key: _sdk_value(key, inner) for key, inner in value.items()})
    if name == "transforms":
        return [_sdk_message("FrameTransform", inner) for inner in value]
    return value
