"""File formats, told by their first bytes: whatever a `format` string says, the bytes decide."""

from stsem.log.schemas.messages import CompressedImage

JPEG, PNG, WEBP, VIDEO, UNKNOWN = "jpeg", "png", "webp", "video", "unknown"

_SIGNATURES: tuple[tuple[str, int, bytes], ...] = (
    (JPEG, 0, b"\xff\xd8\xff"),
    (PNG, 0, b"\x89PNG\r\n\x1a\n"),
    (WEBP, 8, b"WEBP"),
    ("avif", 4, b"ftypavif"),
    ("avif", 4, b"ftypavis"),
    ("heic", 4, b"ftyphei"),
    ("heic", 4, b"ftypmif1"),
    ("jpeg 2000", 4, b"jP  \r\n\x87\n"),
    ("jpeg 2000", 0, b"\xff\x4f\xff\x51"),
    ("jpeg xl", 4, b"JXL \r\n\x87\n"),
    ("jpeg xl", 0, b"\xff\x0a"),
    ("tiff", 0, b"II*\0"),
    ("tiff", 0, b"MM\0*"),
    ("gif", 0, b"GIF8"),
    ("bmp", 0, b"BM"),
)
_CODECS = ("264", "265", "hevc", "vp8", "vp9", "av1", "theora", "mpeg4")
_START_CODES = (b"\0\0\0\1", b"\0\0\1")  # of h264 and h265, ITU-T H.264 annex B


def file_format(message: CompressedImage) -> str:
    """JPEG, PNG, WEBP, the name of another format, VIDEO or UNKNOWN."""
    head = bytes(message.data[:16])
    for name, at, signature in _SIGNATURES:
        if head.startswith(signature, at):
            return name
    video = head.startswith(_START_CODES) or any(codec in message.format.lower() for codec in _CODECS)
    return VIDEO if video else UNKNOWN


def refusal(message: CompressedImage, form: str) -> ValueError:
    """Why a file of this format is not decoded, and what to do."""
    if form == VIDEO:
        codec = message.format or "a stream of h264 or h265"
        return ValueError(f"{codec} is a video codec, but still images (jpeg, png) or raw ones are needed")
    if form == UNKNOWN:
        return ValueError(f"the format {message.format!r} is not supported, only jpeg, png and webp")
    return ValueError(f"{form} is not supported; record or convert it as jpeg, png, webp or raw images")
