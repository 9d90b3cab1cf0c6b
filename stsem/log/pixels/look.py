"""What an image is, told from its message without decoding the pixels."""

from dataclasses import dataclass

from stsem.log.pixels.compressed_depth import compressed_depth
from stsem.log.pixels.encodings import find_encoding
from stsem.log.pixels.formats import JPEG, PNG, VIDEO, WEBP, file_format
from stsem.log.pixels.headers import jpeg_head
from stsem.log.pixels.png import read_head
from stsem.log.pixels.sizes import Size
from stsem.log.schemas.messages import CompressedImage, RawImage

ImageMessage = RawImage | CompressedImage
_DEPTH = ("16uc1", "mono16", "32fc1")


@dataclass(frozen=True)
class Look:
    """What an image is.

    Args:
        order: "rgb", "bgr", "grey", "metric" (16-bit or float samples of one channel), "labels" (whole numbers of 32
            bits), "video", "unknown", or "spoilt": depth in a format of 8 bits, which is of no use.
        bits: per sample; 0 when it cannot be told.
        name: encoding or format, for people.
        frame_id: of its header.
        size: (width, height) as stated; None where a compressed image says it elsewhere than in the head of a png or
            jpeg.
    """

    order: str
    bits: int
    name: str
    frame_id: str
    size: Size | None = None


def look(message: ImageMessage) -> Look:
    """What `message` holds, from its encoding or from the head of its file."""
    if isinstance(message, RawImage):
        encoding = find_encoding(message.encoding)
        order, bits = (encoding.order, encoding.bits) if encoding else ("unknown", 0)
        return Look(order, bits, message.encoding, message.frame_id, (message.width, message.height))
    try:
        return _file(message)
    except ValueError:
        return Look("unknown", 0, message.format or "no format", message.frame_id)


def _file(message: CompressedImage) -> Look:
    """What a file holds; ValueError when the head is spoilt."""
    frame_id = message.frame_id
    if depth := compressed_depth(message):
        return Look("metric", 32 if depth.inverse else 16, depth.name, frame_id)
    form = file_format(message)
    if form == PNG:
        png = read_head(message.data)
        order = "metric" if png.grey and png.bits == 16 else "grey" if png.grey else "rgb"
        return Look(order, png.bits, form, frame_id, (png.width, png.height))
    if form in (JPEG, WEBP) and message.format.lower().lstrip().startswith(_DEPTH):
        return Look("spoilt", 8, f"{message.format} ({form} has 8 bits)", frame_id)
    if form == JPEG:
        jpeg = jpeg_head(message.data)
        return Look("grey" if jpeg.channels == 1 else "rgb", 8, form, frame_id, (jpeg.width, jpeg.height))
    if form == WEBP:
        return Look("rgb", 8, form, frame_id)
    return Look("video" if form == VIDEO else "unknown", 0, message.format or "no format", frame_id)
