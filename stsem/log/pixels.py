"""Pixels: image messages to arrays. Raw images by a table of encodings, compressed ones by what their bytes begin with.

All functions raise ValueError with a sentence's middle ("encoding yuv9 is not supported ..."); the caller names the
topic and the stamp.
"""

import zlib
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stsem.frame import Depth, Image
from stsem.log.schemas.messages import CompressedImage, RawImage

ImageMessage = RawImage | CompressedImage
Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Encoding:
    """Layout of one raw encoding.

    Args:
        dtype: of a sample.
        samples: per pixel.
        order: "rgb", "bgr", "grey", or "metric" for depth.
    """

    dtype: str
    samples: int
    order: str


ENCODINGS: dict[str, Encoding] = {
    "rgb8": Encoding("u1", 3, "rgb"),
    "bgr8": Encoding("u1", 3, "bgr"),
    "mono8": Encoding("u1", 1, "grey"),
    "8UC1": Encoding("u1", 1, "grey"),
    "16UC1": Encoding("u2", 1, "metric"),
    "32FC1": Encoding("f4", 1, "metric"),
}

JPEG, PNG, WEBP, VIDEO, UNKNOWN = "jpeg", "png", "webp", "video", "unknown"

MAX_SIDE = 1 << 15
_METRES = np.arange(1 << 16, dtype=np.float64) / 1000
_METRES[[0, 65535]] = np.nan
MILLIMETRES_TO_METRES: Depth = _METRES.astype(np.float32)


@dataclass(frozen=True)
class Look:
    """What an image is, told from its message without decoding the pixels.

    Args:
        order: "rgb", "bgr", "grey", "metric", "video" or "unknown".
        bits: per sample; 0 when it cannot be told.
        name: encoding or format, for people.
        frame_id: of its header.
    """

    order: str
    bits: int
    name: str
    frame_id: str


def look(message: ImageMessage) -> Look:
    """What `message` holds, from its encoding or from the head of its file."""
    if isinstance(message, RawImage):
        encoding = ENCODINGS.get(message.encoding)
        if encoding is None:
            return Look("unknown", 0, message.encoding, message.frame_id)
        return Look(encoding.order, 8 * int(encoding.dtype[1]), message.encoding, message.frame_id)
    form = file_format(message)
    if form == PNG and len(message.data) > 25:
        depth, colour_type = message.data[24], message.data[25]
        grey = colour_type in (0, 4)
        order = "metric" if grey and depth == 16 else "grey" if grey else "rgb"
        return Look(order, depth, "png", message.frame_id)
    if form in (JPEG, WEBP):
        return Look("rgb", 8, form, message.frame_id)
    return Look("video" if form == VIDEO else "unknown", 0, message.format or "no format", message.frame_id)


def file_format(message: CompressedImage) -> str:
    """The format that the bytes themselves show; the `format` string only tells videos."""
    head = bytes(message.data[:12])
    if head.startswith(b"\xff\xd8\xff"):
        return JPEG
    if head.startswith(b"\x89PNG\r\n\x1a\n"):
        return PNG
    if head.startswith(b"RIFF") and head[8:12] == b"WEBP":
        return WEBP
    words = message.format.lower()
    return VIDEO if any(codec in words for codec in ("264", "265", "hevc", "vp9", "av1")) else UNKNOWN


def colour(message: ImageMessage) -> Image:
    """(H, W, 3) uint8 RGB; grey images are repeated into three channels. The array owns its memory."""
    if isinstance(message, CompressedImage):
        decoded = _decode_file(message, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        return _uint8(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB, dst=decoded))
    encoding, pixels = _view(message)
    if encoding.order == "rgb":
        return pixels.copy()
    if encoding.order == "bgr":
        return _uint8(cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB))
    if encoding.order == "grey":
        return _uint8(cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB))
    raise ValueError(f"{message.encoding} is depth, but a colour image was expected")


def depth(message: ImageMessage) -> Depth:
    """(H, W) float32 metres, NaN unknown: 16-bit samples are millimetres (0 and 65535 unknown), floats metres."""
    if isinstance(message, CompressedImage):
        pixels: Array = _decode_file(message, cv2.IMREAD_UNCHANGED)
        if pixels.dtype != np.uint16 or pixels.ndim != 2:
            raise ValueError(f"depth needs one 16-bit channel, but {message.format!r} decodes to {_shape(pixels)}")
    else:
        encoding, pixels = _view(message)
        if encoding.order != "metric":
            raise ValueError(f"depth needs 16UC1 or 32FC1, but {message.encoding} came")
    if pixels.dtype.kind == "u":
        # Every 16-bit number is in the table; "wrap" is the mode that checks least.
        return MILLIMETRES_TO_METRES.take(pixels, mode="wrap")
    metres = pixels.astype(np.float32)
    metres[~(np.isfinite(metres) & (metres > 0))] = np.nan
    return metres


def labels(message: ImageMessage) -> Array:
    """Class ids as they stand: (H, W) uint8 or uint16, or (H, W, 3) uint8 RGB when they are colours."""
    if isinstance(message, CompressedImage):
        if (form := file_format(message)) != PNG:
            raise ValueError(f"labels need a lossless image (raw or png), but {form} came ({message.format!r})")
        pixels: Array = _decode_file(message, cv2.IMREAD_UNCHANGED)
        if pixels.ndim == 2:
            return pixels
        return np.ascontiguousarray(pixels[:, :, 2::-1])
    encoding, pixels = _view(message)
    if encoding.dtype == "f4":
        raise ValueError(f"labels need whole numbers, but {message.encoding} came")
    return np.ascontiguousarray(pixels[:, :, ::-1]) if encoding.order == "bgr" else pixels.astype(encoding.dtype)


def _view(message: RawImage) -> tuple[Encoding, Array]:
    """(H, W) or (H, W, samples) view of the data, rows `step` bytes apart."""
    encoding = ENCODINGS.get(message.encoding)
    if encoding is None:
        raise ValueError(f"encoding {message.encoding!r} is not supported, only {', '.join(ENCODINGS)}")
    width, height, item = message.width, message.height, int(encoding.dtype[1])
    row = width * encoding.samples * item
    if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
        raise ValueError(f"a size of {width}x{height} cannot be")
    if message.step < row or len(message.data) < message.step * (height - 1) + row:
        raise ValueError(
            f"{width}x{height} {message.encoding} in rows of {message.step} bytes came in {len(message.data)} bytes"
        )
    shape = (height, width) if encoding.samples == 1 else (height, width, encoding.samples)
    strides = (message.step, encoding.samples * item, item)[: len(shape)]
    dtype = np.dtype(encoding.dtype).newbyteorder(">" if message.big_endian else "<")
    return encoding, np.ndarray(shape, dtype, buffer=message.data, strides=strides)


def _decode_file(message: CompressedImage, flags: int) -> Image:
    form = file_format(message)
    if form == VIDEO:
        raise ValueError(f"{message.format} is a video codec, but still images (jpeg, png) or raw ones are needed")
    if form == UNKNOWN:
        raise ValueError(f"the format {message.format!r} is not supported, only jpeg, png and webp")
    if form == JPEG and b"\xff\xd9" not in bytes(message.data[-4096:]):
        raise ValueError("the jpeg ends early")
    if form == PNG:
        _check_png(message.data)
    try:
        decoded = cv2.imdecode(np.frombuffer(message.data, np.uint8), flags)
    except cv2.error as err:
        raise ValueError(f"the {form} cannot be decoded ({err.err or err})") from err
    if decoded is None:
        raise ValueError(f"the {form} cannot be decoded")
    return decoded  # type: ignore[return-value]


def _check_png(data: memoryview) -> None:
    """A png has a checksum per chunk and says its size first: the decoder only mutters about either."""
    at, kind = 8, b""
    while kind != b"IEND":
        if at + 12 > len(data):
            raise ValueError("the png ends early")
        length, kind = int.from_bytes(data[at : at + 4], "big"), bytes(data[at + 4 : at + 8])
        end = at + 8 + length
        if end + 4 > len(data):
            raise ValueError("the png ends early")
        if zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            raise ValueError("the png does not have its checksum")
        if at == 8:
            width, height = (int.from_bytes(data[k : k + 4], "big") for k in (16, 20))
            if kind != b"IHDR" or not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE):
                raise ValueError(f"a png of {width}x{height} cannot be")
        at = end + 4


def _uint8(pixels: Any) -> Image:
    return np.asarray(pixels, np.uint8)


def _shape(pixels: Array) -> str:
    return f"{'x'.join(map(str, pixels.shape))} {pixels.dtype}"
