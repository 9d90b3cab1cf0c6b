"""YUV layouts to RGB: all by OpenCV's BT.601 in studio range, which is what cameras of robots send."""

import cv2
import numpy as np
import numpy.typing as npt

from stsem.frame import Image

Bytes = npt.NDArray[np.uint8]


def uyvy(pixels: Bytes) -> Image:
    """(H, W, 2) with U or V first -> (H, W, 3) RGB; W is even."""
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_YUV2RGB_UYVY), np.uint8)


def yuyv(pixels: Bytes) -> Image:
    """(H, W, 2) with Y first -> (H, W, 3) RGB; W is even."""
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_YUV2RGB_YUYV), np.uint8)


def nv12(rows: Bytes, width: int, height: int) -> Image:
    """Y (H, W), then U and V in turns (H/2, W)."""
    return np.asarray(cv2.cvtColor(rows[:, :width], cv2.COLOR_YUV2RGB_NV12), np.uint8)


def nv21(rows: Bytes, width: int, height: int) -> Image:
    """Y (H, W), then V and U in turns (H/2, W)."""
    return np.asarray(cv2.cvtColor(rows[:, :width], cv2.COLOR_YUV2RGB_NV21), np.uint8)


def i420(rows: Bytes, width: int, height: int) -> Image:
    """Y (H, W), then U and V, each (H/2, W/2) in rows of half a step."""
    if rows.shape[1] % 2:
        raise ValueError(f"i420 has rows of half a step, but the step is {rows.shape[1]}")
    chroma = rows[height:].reshape(height, -1)[:, : width // 2].reshape(height // 2, width)
    return np.asarray(cv2.cvtColor(np.concatenate([rows[:height, :width], chroma]), cv2.COLOR_YUV2RGB_I420), np.uint8)


def nv16(rows: Bytes, width: int, height: int) -> Image:
    """Y (H, W), then U and V in turns (H, W)."""
    return yuyv(np.dstack([rows[:height, :width], rows[height:, :width]]))


def nv24(rows: Bytes, width: int, height: int) -> Image:
    """Y (H, W), then U and V in turns (H, 2 W) in rows of two steps.

    Every pixel is written twice, so that the pair shares its colour; then every second one is kept.
    """
    luma = np.repeat(rows[:height, :width], 2, axis=1)
    chroma = rows[height:].reshape(height, -1)[:, : 2 * width]
    return np.ascontiguousarray(yuyv(np.dstack([luma, chroma]))[:, ::2])
