"""Foxglove messages from arrays: what our own logs and the annotated ones are made of."""

from typing import Any

import cv2
import numpy.typing as npt
from foxglove import messages as fox

from stsem.frame import Image
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
