"""Still images: checked by their header and their whole, then decoded by OpenCV."""

import cv2
import numpy as np

from stsem.frame import Image
from stsem.log.pixels.encodings import Array
from stsem.log.pixels.formats import JPEG, PNG, WEBP, file_format, refusal
from stsem.log.pixels.headers import check_jpeg, jpeg_head, webp_head
from stsem.log.pixels.png import GREY_ALPHA, Png, read_png
from stsem.log.pixels.sizes import Size, check_size
from stsem.log.schemas.messages import CompressedImage

_COLOUR = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION


def still_colour(message: CompressedImage, size: Size | None) -> Image:
    """(H, W, 3) uint8 RGB: alpha is dropped, 16 bits become their high byte, the orientation tag is ignored.

    Raises:
        ValueError: it cannot be decoded, or is not of `size`.
    """
    form, data = file_format(message), message.data
    if form == PNG:
        png = read_png(data, size)
        decoded = _decoded(png.file(), _COLOUR, PNG, (png.head.width, png.head.height))
    elif form in (JPEG, WEBP):
        head = jpeg_head(data) if form == JPEG else webp_head(data)
        check_size(head.width, head.height, size)
        if form == JPEG:
            check_jpeg(data)
        decoded = _decoded(data, _COLOUR, form, (head.width, head.height))
    else:
        raise refusal(message, form)
    return np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB, dst=decoded), np.uint8)


def png_samples(png: Png) -> Array:
    """(H, W) uint8 or uint16 grey samples or palette indices as they are stored, or (H, W, 3) uint8 or uint16 RGB.

    Raises:
        ValueError: it cannot be decoded.
    """
    head = png.head
    file = png.file() if not png.palette or head.colour_type != 3 else png.index_file()
    pixels = _decoded(file, cv2.IMREAD_UNCHANGED, PNG, (head.width, head.height))
    if head.colour_type == GREY_ALPHA:
        return np.ascontiguousarray(pixels[:, :, 0])
    if pixels.ndim == 3:
        return np.ascontiguousarray(pixels[:, :, 2::-1])
    # Decoders spread small samples over 0..255; 255 is a multiple of the highest one, so the way back is exact.
    return pixels if head.bits >= 8 else pixels // np.uint8(255 // ((1 << head.bits) - 1))


def _decoded(data: bytes | memoryview, flags: int, form: str, size: Size) -> Array:
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as err:
        raise ValueError(f"the {form} cannot be decoded ({err.err or err})") from err
    if pixels is None:
        raise ValueError(f"the {form} cannot be decoded")
    if pixels.shape[1::-1] != size:
        raise ValueError(f"the {form} says {size[0]}x{size[1]} but decodes to {pixels.shape[1]}x{pixels.shape[0]}")
    return np.asarray(pixels)
