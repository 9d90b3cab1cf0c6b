"""Image messages to colour, depth and labels.

All functions raise ValueError with a sentence's middle ("encoding yuv9 is not supported ..."); the caller names the
topic and the stamp. Sizes are read and checked before anything is decoded.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from stsem.classes import Colour
from stsem.frame import Depth, Image
from stsem.log.classtable import OUTSIDE
from stsem.log.pixels.compressed_depth import compressed_depth
from stsem.log.pixels.encodings import Array, Packed
from stsem.log.pixels.formats import JPEG, PNG, WEBP, file_format, refusal
from stsem.log.pixels.look import ImageMessage
from stsem.log.pixels.metres import in_metres
from stsem.log.pixels.png import PALETTE, Png, read_png
from stsem.log.pixels.raw import encoding_of, native, raw_colour, samples
from stsem.log.pixels.sizes import Size
from stsem.log.pixels.still import png_samples, still_colour
from stsem.log.schemas.messages import CompressedImage, RawImage

NO_COLOURS: Mapping[int, Colour] = {}


def colour(message: ImageMessage, size: Size | None = None) -> Image:
    """(H, W, 3) uint8 RGB; grey images are repeated into three channels. The array owns its memory.

    Args:
        message: raw or compressed.
        size: (width, height) that it has to have; None takes any.

    Raises:
        ValueError: it cannot be decoded or is not of `size`.
    """
    if isinstance(message, RawImage):
        return raw_colour(message, size)
    if depth := compressed_depth(message):
        raise ValueError(f"{depth.name} is depth, but a colour image was expected")
    return still_colour(message, size)


def depth(message: ImageMessage, size: Size | None = None) -> Depth:
    """(H, W) float32 metres, NaN unknown: 16-bit samples are millimetres (0 and 65535 unknown), floats metres.

    Args:
        message: raw or compressed.
        size: (width, height) that it has to have; None takes any.

    Raises:
        ValueError: it cannot be decoded, is no depth, or is not of `size`.
    """
    if isinstance(message, RawImage):
        encoding = encoding_of(message)
        if not isinstance(encoding, Packed) or encoding.order != "metric":
            raise ValueError(f"depth needs 16UC1, mono16, 32FC1 or 64FC1, but {message.encoding} came")
        return in_metres(samples(message, encoding, size))
    if packed := compressed_depth(message):
        return packed.metres(size)
    form = file_format(message)
    if form in (JPEG, WEBP):
        raise ValueError(
            f"depth came in a {form} ({message.format!r}), whose 8 bits cannot hold it; "
            "record it raw, as png of 16 bits or as compressedDepth"
        )
    if form != PNG:
        raise refusal(message, form)
    png = read_png(message.data, size)
    if not png.head.grey or png.head.bits != 16:
        kind = "grey" if png.head.grey else "coloured"
        raise ValueError(f"depth needs a grey png of 16 bits, but a {kind} one of {png.head.bits} came")
    return in_metres(png_samples(png))


def labels(message: ImageMessage, colours: Mapping[int, Colour] = NO_COLOURS) -> Array:
    """Class ids as they stand: (H, W) uint8 or uint16, or (H, W, 3) uint8 RGB when they are colours.

    A png with a palette gives its indices; or its colours, if it paints any index in the colour of a class that has
    another id. Ids that 16 bits cannot hold become 65535.

    Args:
        message: raw or compressed, of any size.
        colours: id in the images -> colour, of the class table.

    Raises:
        ValueError: it cannot be decoded, or cannot be labels.
    """
    if isinstance(message, RawImage):
        return _raw_labels(message)
    if packed := compressed_depth(message):
        if packed.inverse:
            raise ValueError(f"labels need whole numbers, but {packed.name} came")
        return packed.samples(None)
    return _png_labels(_label_png(message), colours)


def _raw_labels(message: RawImage) -> Array:
    encoding = encoding_of(message)
    if not isinstance(encoding, Packed) or (encoding.order in ("rgb", "bgr") and encoding.samples < 3):
        raise ValueError(f"labels need ids or colours as they are, but {message.encoding} came, which mixes pixels")
    if encoding.dtype[0] == "f" or (encoding.samples > 1 and encoding.bits > 8):
        raise ValueError(f"labels need whole numbers or colours of 8 bits, but {message.encoding} came")
    pixels = samples(message, encoding)
    if encoding.samples > 1:
        return np.ascontiguousarray(pixels[:, :, 2::-1] if encoding.order == "bgr" else pixels[:, :, :3])
    if encoding.dtype == "i4":
        return _within_16_bits(native(pixels))
    return pixels.astype(encoding.dtype)


def _within_16_bits(ids: npt.NDArray[np.int32]) -> npt.NDArray[np.uint16]:
    return np.where((ids < 0) | (ids > OUTSIDE), OUTSIDE, ids).astype(np.uint16)


def _label_png(message: CompressedImage) -> Png:
    form = file_format(message)
    if form in (JPEG, WEBP):
        raise ValueError(
            f"labels need a lossless image (raw or png), but {form} came ({message.format!r}), which changes ids"
        )
    if form != PNG:
        raise refusal(message, form)
    return read_png(message.data)


def _png_labels(png: Png, colours: Mapping[int, Colour]) -> Array:
    pixels = png_samples(png)
    if pixels.ndim == 3 and pixels.dtype != np.uint8:
        raise ValueError("labels need whole numbers or colours of 8 bits, but a coloured png of 16 bits came")
    if png.head.colour_type != PALETTE or not colours:
        return pixels
    palette = np.frombuffer(png.palette[: len(png.palette) // 3 * 3], np.uint8).reshape(-1, 3)
    used = np.flatnonzero(np.bincount(pixels.ravel(), minlength=256)).tolist()
    if used[-1] >= len(palette):
        return pixels
    painted = {index: (int(r), int(g), int(b)) for index, (r, g, b) in zip(used, palette[used], strict=True)}
    of_classes = set(colours.values())
    elsewhere = any(colour in of_classes and colours.get(index) != colour for index, colour in painted.items())
    return palette[pixels] if elsewhere else pixels
