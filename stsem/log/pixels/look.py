"""What an image is, told from its message without decoding the pixels."""

from dataclasses import dataclass

from stsem.log.pixels.compressed_depth import compressed_depth
from stsem.log.pixels.encodings import find_encoding
from stsem.log.pixels.formats import JPEG, PNG, VIDEO, WEBP, file_format
from stsem.log.pixels.headers import jpeg_head
from stsem.log.pixels.png import read_head
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
    """

    order: str
    bits: int
    name: str
    frame_id: str


def look(message: ImageMessage) -> Look:
    """What `message` holds, from its encoding or from the head of its file."""
    if isinstance(message, RawImage):
        encoding = find_encoding(message.encoding)
        order, bits = (encoding.order, encoding.bits) if encoding else ("unknown", 0)
        return Look(order, bits, message.encoding, message.frame_id)
    try:
        return Look(*_file(message), message.frame_id)
    except ValueError:
        return Look("unknown", 0, message.format or "no format", message.frame_id)


def _file(message: CompressedImage) -> tuple[str, int, str]:
    """(order, bits, name); ValueError when the head is spoilt."""
    if depth := compressed_depth(message):
        return "metric", 32 if depth.inverse else 16, depth.name
    form = file_format(message)
    if form == PNG:
        head = read_head(message.data)
        order = "metric" if head.grey and head.bits == 16 else "grey" if head.grey else "rgb"
        return order, head.bits, form
    if form in (JPEG, WEBP):
        if message.format.lower().lstrip().startswith(_DEPTH):
            return "spoilt", 8, f"{message.format} ({form} has 8 bits)"
        return "grey" if form == JPEG and jpeg_head(message.data).channels == 1 else "rgb", 8, form
    return "video" if form == VIDEO else "unknown", 0, message.format or "no format"
