"""The raw encodings: one row each, under every name that ROS, Foxglove and OpenCV have for it."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stsem.frame import Image
from stsem.log.pixels import yuv

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Packed:
    """An encoding whose pixels lie side by side.

    Args:
        dtype: of a sample.
        samples: per pixel.
        order: "rgb", "bgr", "grey", "metric" for depth, "labels" for what can only be ids.
        to_rgb: (H, W) or (H, W, samples) in native byte order -> (H, W, 3) uint8 RGB of its own memory;
            None when it is no colour.
        group: pixels that share samples; rows are filled up to whole groups.
        least: pixels that a side needs.
    """

    dtype: str
    samples: int
    order: str
    to_rgb: Callable[[Array], Image] | None
    group: int = 1
    least: int = 1

    @property
    def bits(self) -> int:
        """Bits of a sample."""
        return 8 * int(self.dtype[1])


@dataclass(frozen=True)
class Planar:
    """A YUV encoding of 8 bits whose brightness comes first as an image of its own, then its colour.

    Args:
        rows: of `step` bytes for each row of pixels.
        to_rgb: ((rows, step) uint8, width, height) -> (H, W, 3) uint8 RGB.
        even_width, even_height: whether colour is shared by pixels across and down.
    """

    rows: Fraction
    to_rgb: Callable[[Array, int, int], Image]
    even_width: bool
    even_height: bool
    order: str = "rgb"
    bits: int = 8


Encoding = Packed | Planar


def _copied(pixels: Array) -> Image:
    return pixels.copy()


def _converted(code: int, pixels: Array) -> Image:
    return np.asarray(cv2.cvtColor(pixels, code), np.uint8)


def _high_byte(to_rgb: Callable[[Array], Image], pixels: Array) -> Image:
    """16-bit colour as 8 bits: the high byte, as png decoders have it; 8-bit values filled up come back exactly."""
    return to_rgb(np.right_shift(pixels, 8).astype(np.uint8))


def _demosaiced(code: int, pixels: Array) -> Image:
    rgb = cv2.cvtColor(pixels, code)
    return np.asarray(rgb if rgb.dtype == np.uint8 else np.right_shift(rgb, 8), np.uint8)


_BGR = partial(_converted, cv2.COLOR_BGR2RGB)
_RGBA = partial(_converted, cv2.COLOR_RGBA2RGB)
_BGRA = partial(_converted, cv2.COLOR_BGRA2RGB)
_GREY = partial(_converted, cv2.COLOR_GRAY2RGB)
# The names that spell out a 2x2 block; those of two letters ("BayerBG") start one pixel further.
_RGGB = partial(_demosaiced, cv2.COLOR_BayerRGGB2RGB)
_BGGR = partial(_demosaiced, cv2.COLOR_BayerBGGR2RGB)
_GBRG = partial(_demosaiced, cv2.COLOR_BayerGBRG2RGB)
_GRBG = partial(_demosaiced, cv2.COLOR_BayerGRBG2RGB)

ENCODINGS: dict[str, Encoding] = {
    "rgb8": Packed("u1", 3, "rgb", _copied),
    "bgr8": Packed("u1", 3, "bgr", _BGR),
    "8UC3": Packed("u1", 3, "bgr", _BGR),
    "rgba8": Packed("u1", 4, "rgb", _RGBA),
    "bgra8": Packed("u1", 4, "bgr", _BGRA),
    "8UC4": Packed("u1", 4, "bgr", _BGRA),
    "mono8": Packed("u1", 1, "grey", _GREY),
    "8UC1": Packed("u1", 1, "grey", _GREY),
    "rgb16": Packed("u2", 3, "rgb", partial(_high_byte, _copied)),
    "bgr16": Packed("u2", 3, "bgr", partial(_high_byte, _BGR)),
    "16UC3": Packed("u2", 3, "bgr", partial(_high_byte, _BGR)),
    "rgba16": Packed("u2", 4, "rgb", partial(_high_byte, _RGBA)),
    "bgra16": Packed("u2", 4, "bgr", partial(_high_byte, _BGRA)),
    "16UC4": Packed("u2", 4, "bgr", partial(_high_byte, _BGRA)),
    "mono16": Packed("u2", 1, "metric", partial(_high_byte, _GREY)),
    "16UC1": Packed("u2", 1, "metric", None),
    "32FC1": Packed("f4", 1, "metric", None),
    "64FC1": Packed("f8", 1, "metric", None),
    "32SC1": Packed("i4", 1, "labels", None),
    "bayer_rggb8": Packed("u1", 1, "rgb", _RGGB, least=3),
    "bayer_bggr8": Packed("u1", 1, "rgb", _BGGR, least=3),
    "bayer_gbrg8": Packed("u1", 1, "rgb", _GBRG, least=3),
    "bayer_grbg8": Packed("u1", 1, "rgb", _GRBG, least=3),
    "bayer_rggb16": Packed("u2", 1, "rgb", _RGGB, least=3),
    "bayer_bggr16": Packed("u2", 1, "rgb", _BGGR, least=3),
    "bayer_gbrg16": Packed("u2", 1, "rgb", _GBRG, least=3),
    "bayer_grbg16": Packed("u2", 1, "rgb", _GRBG, least=3),
    "yuv422": Packed("u1", 2, "rgb", yuv.uyvy, group=2),
    "uyvy": Packed("u1", 2, "rgb", yuv.uyvy, group=2),
    "yuv422_yuy2": Packed("u1", 2, "rgb", yuv.yuyv, group=2),
    "yuyv": Packed("u1", 2, "rgb", yuv.yuyv, group=2),
    "yuy2": Packed("u1", 2, "rgb", yuv.yuyv, group=2),
    "nv12": Planar(Fraction(3, 2), yuv.nv12, even_width=True, even_height=True),
    "nv21": Planar(Fraction(3, 2), yuv.nv21, even_width=True, even_height=True),
    "i420": Planar(Fraction(3, 2), yuv.i420, even_width=True, even_height=True),
    "nv16": Planar(Fraction(2), yuv.nv16, even_width=True, even_height=False),
    "nv24": Planar(Fraction(3), yuv.nv24, even_width=False, even_height=False),
}


def _normalised(name: str) -> str:
    return "".join(name.replace("\0", " ").split()).casefold()


_FOUND = {_normalised(name): encoding for name, encoding in ENCODINGS.items()}


def find_encoding(name: str) -> Encoding | None:
    """The row of `name`, in any letter case and with any blanks; None when there is none."""
    return ENCODINGS.get(name) or _FOUND.get(_normalised(name))
