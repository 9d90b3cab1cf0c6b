"""Foxglove messages from arrays: what our own logs and the annotated ones are made of."""

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from foxglove import messages as fox

from stsem.camera import Camera
from stsem.frame import Depth, Image
from stsem.log.pixels.metres import MILLIMETRES_TO_METRES
from stsem.pose import Pose, to_quaternion

JPEG_QUALITY = 85
_SECOND_NS = 10**9


def timestamp(stamp_ns: int) -> fox.Timestamp:
    """A stamp in nanoseconds."""
    return fox.Timestamp(*divmod(stamp_ns, _SECOND_NS))


def jpeg_image(image: Image, stamp_ns: int, frame_id: str) -> fox.CompressedImage:
    """(H, W, 3) uint8 RGB as JPEG."""
    settings = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    _, data = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), settings)
    return fox.CompressedImage(
        timestamp=timestamp(stamp_ns), frame_id=frame_id, format="jpeg", data=data.tobytes()
    )  # fmt: skip


def png_image(image: Image, stamp_ns: int, frame_id: str) -> fox.CompressedImage:
    """(H, W, 3) uint8 RGB as PNG: quick rather than small."""
    settings = [cv2.IMWRITE_PNG_COMPRESSION, 1]
    _, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), settings)
    return image_file(data.tobytes(), "png", stamp_ns, frame_id)


def image_file(data: bytes, form: str, stamp_ns: int, frame_id: str) -> fox.CompressedImage:
    """The bytes of an image file as they are; `form` as foxglove names it: `jpeg`, `png`, `webp`."""
    return fox.CompressedImage(timestamp=timestamp(stamp_ns), frame_id=frame_id, format=form, data=data)


def whole_millimetres(depth: Depth) -> npt.NDArray[np.uint16] | None:
    """Depth (H, W) float32 metres, NaN unknown, as uint16 millimetres, 0 unknown; None unless they read back equal."""
    with np.errstate(invalid="ignore", over="ignore"):
        rounded = np.nan_to_num(np.rint(depth.astype(np.float64) * 1000), nan=0, posinf=0, neginf=0)
    millimetres: npt.NDArray[np.uint16] = rounded.clip(0, 65535).astype(np.uint16)
    if not np.array_equal(MILLIMETRES_TO_METRES[millimetres], depth, equal_nan=True):
        return None
    return millimetres


def calibration(camera: Camera, stamp_ns: int, frame_id: str) -> fox.CameraCalibration:
    """Intrinsics; without distortion as `plumb_bob` with five zeros, as drivers do."""
    return fox.CameraCalibration(
        timestamp=timestamp(stamp_ns), frame_id=frame_id, width=camera.width, height=camera.height,
        distortion_model=camera.model or "plumb_bob", D=list(camera.distortion) or [0.0] * 5,
        K=camera.K.ravel().tolist(), R=np.eye(3).ravel().tolist(),
        P=np.hstack([camera.K, np.zeros((3, 1))]).ravel().tolist(),
    )  # fmt: skip


def raw_image(pixels: npt.NDArray[Any], encoding: str, stamp_ns: int, frame_id: str) -> fox.RawImage:
    """(H, W) or (H, W, C) as it lies in memory; `encoding` as in ROS, e.g. `mono8`, `16UC1`, `rgb8`."""
    height, width = pixels.shape[:2]
    return fox.RawImage(
        timestamp=timestamp(stamp_ns), frame_id=frame_id, width=width, height=height, encoding=encoding,
        step=pixels.nbytes // height, data=pixels.tobytes(),
    )  # fmt: skip


def vector(pose: Pose) -> fox.Vector3:
    """Translation of a pose (4, 4), metres."""
    x, y, z = pose[:3, 3].tolist()
    return fox.Vector3(x=x, y=y, z=z)


def quaternion(pose: Pose) -> fox.Quaternion:
    """Rotation of a pose (4, 4)."""
    x, y, z, w = to_quaternion(pose).tolist()
    return fox.Quaternion(x=x, y=y, z=z, w=w)
