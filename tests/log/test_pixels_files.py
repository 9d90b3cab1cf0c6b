"""Still images: every format and habit decoded as its own encoder means it, refused before it can cost anything."""

import io
import zlib
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from image_messages import SIGNATURE, compressed, encoded, giant_png, png_chunk, raw, written_png
from made_up_logs import label_picture, picture
from PIL import Image

from stsem.log.pixels import decode, headers, png, still
from stsem.log.pixels.look import ImageMessage, look
from stsem.log.schemas.messages import CompressedImage

JPEG, PNG, WEBP = encoded(".jpg", picture(2)), encoded(".png", picture(2)), encoded(".webp", picture(2))
LOSSY_WEBP = encoded(".webp", picture(2), cv2.IMWRITE_WEBP_QUALITY, 60)
WIDE = encoded(".jpg", np.zeros((8, 80), np.uint8))
HEIGHT, WIDTH = picture(2).shape[:2]


def by_pillow(image: Image.Image, suffix: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, suffix, **options)
    return buffer.getvalue()


@pytest.fixture
def no_decoder(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        pytest.fail("the decoder was asked")

    monkeypatch.setattr(still.cv2, "imdecode", refuse)


@pytest.mark.parametrize(
    "form",
    ["rgb8; jpeg compressed bgr8", "jpg", "jpeg", "image/png", "PNG", "bgr8; png compressed", "", "nonsense", "h264"],
)
@pytest.mark.parametrize("data", [JPEG, PNG, WEBP, LOSSY_WEBP])
def test_the_bytes_decide_the_format_not_the_string(form: str, data: bytes) -> None:
    expected = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    np.testing.assert_array_equal(decode.colour(compressed(data, form)), expected)
    np.testing.assert_array_equal(decode.colour(compressed(data + bytes(7), form), (WIDTH, HEIGHT)), expected)


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "L", "LA", "1", "P", "I;16"])
def test_pngs_of_every_kind(mode: str) -> None:
    """As pillow reads them: alpha and palettes go, of 16 bits the high byte stays."""
    image = Image.fromarray(picture(1))
    if mode == "I;16":
        image = Image.fromarray(np.arange(24, dtype=np.uint16).reshape(4, 6) * 2700)
        expected = np.repeat(np.asarray(image)[:, :, None] >> 8, 3, 2)
    else:
        image = image.convert(mode)
        expected = np.asarray(image.convert("RGB"))
    np.testing.assert_array_equal(decode.colour(compressed(by_pillow(image, "png"))), expected)


def test_wide_png_and_wide_raw_colour_are_the_same() -> None:
    wide = np.random.default_rng(0).integers(0, 65536, (5, 4, 3)).astype("<u2")
    of_png = decode.colour(compressed(encoded(".png", wide)))
    np.testing.assert_array_equal(of_png, decode.colour(raw(wide, "rgb16")))


def test_an_interlaced_png() -> None:
    """Adam7: seven small images, each with its own rows."""
    grey = np.random.default_rng(1).integers(0, 256, (8, 8), np.uint8)
    passes = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
    rows = b"".join(b"\0" + row.tobytes() for x, y, dx, dy in passes for row in grey[y::dy, x::dx])
    message = compressed(written_png((8, 8), 8, 0, rows, interlaced=True))
    np.testing.assert_array_equal(decode.labels(message), grey)
    np.testing.assert_array_equal(decode.colour(message), np.repeat(grey[:, :, None], 3, 2))


def test_the_orientation_tag_is_ignored() -> None:
    image = Image.fromarray(picture(1))
    exif = image.getexif()
    exif[0x0112] = 6
    plain = decode.colour(compressed(by_pillow(image, "jpeg")))
    for form, expected in (("jpeg", plain), ("png", picture(1))):
        data = by_pillow(image, form, exif=exif)
        assert b"Exif" in data or b"eXIf" in data
        np.testing.assert_array_equal(decode.colour(compressed(data)), expected)


def test_what_stands_before_the_frame_header_is_skipped() -> None:
    """A preview with a frame header of its own, fill bytes, and bytes that are no marker."""
    preview = b"\xff\xe1" + (len(WIDE) + 2).to_bytes(2, "big") + WIDE
    data = JPEG[:2] + preview + b"\xff\xff\xff\xfe\0\4hi" + b"\0\1" + b"\xff\xd0" + JPEG[2:]
    np.testing.assert_array_equal(decode.colour(compressed(data)), decode.colour(compressed(JPEG)))


def test_a_progressive_jpeg_and_a_grey_one() -> None:
    data = encoded(".jpg", picture(1), cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    assert np.abs(decode.colour(compressed(data)).astype(int) - picture(1)).mean() < 20
    grey = compressed(encoded(".jpg", picture(1)[:, :, 0]))
    assert (look(grey).order, decode.colour(grey).shape) == ("grey", picture(1).shape)


def changed(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at + len(new) :]


FTYP = b"\0\0\0\x20ftyp"


@pytest.mark.parametrize(
    ("data", "form", "words"),
    [
        (b"\0\0\0\1gB\0", "h264", "h264 is a video codec, but still images"),
        (b"\0\0\0\1gB\0", "", "a stream of h264 or h265 is a video codec"),
        (b"nonsense", "qoi", "the format 'qoi' is not supported, only jpeg, png and webp"),
        (b"", "", "the format '' is not supported"),
        (FTYP + b"avif" + bytes(9), "avif", "avif is not supported; record or convert it as jpeg"),
        (FTYP + b"heic" + bytes(9), "heic", "heic is not supported"),
        (b"BM" + bytes(60), "bmp", "bmp is not supported"),
        (b"II*\0" + bytes(60), "16UC1; tiff compressed", "tiff is not supported"),
        (b"GIF89a" + bytes(9), "", "gif is not supported"),
        (JPEG[:200], "jpeg", "the jpeg"),
        (JPEG[:-2], "jpeg", "the jpeg ends early"),
        (b"\xff\xd8\xff\xd9", "jpeg", "the jpeg does not say its size"),
        (b"\xff\xd8" + b"\xff\xe0\0\2" * 5000 + JPEG[2:], "jpeg", "the jpeg does not say its size"),
        (PNG[:40], "png", "the png ends early"),
        (PNG[:20], "png", "the png ends early"),
        (PNG[:-5], "png", "the png ends early"),
        (changed(PNG, 60, b"?!"), "png", "the png does not have its checksum"),
        (WEBP[:-1], "webp", "the webp ends early"),
        (LOSSY_WEBP[:-1], "webp", "the webp ends early"),
        (b"RIFF" + (30).to_bytes(4, "little") + b"WEBPVP9 " + bytes(30), "webp", "the webp does not say its size"),
    ],
)
def test_what_cannot_be_used_is_refused_with_a_reason(no_decoder: None, data: bytes, form: str, words: str) -> None:
    with pytest.raises(ValueError, match=r"\w+ \w+") as caught:
        decode.colour(compressed(data, form))
    assert words in str(caught.value)


def test_an_animated_webp_is_refused(no_decoder: None) -> None:
    first, second = Image.fromarray(picture(1)), Image.fromarray(255 - picture(1))
    data = by_pillow(first, "webp", save_all=True, append_images=[second])
    with pytest.raises(ValueError, match="the webp is animated"):
        decode.colour(compressed(data))


def sized_jpeg(width: int, height: int) -> bytes:
    at = JPEG.index(b"\xff\xc0") + 5
    return changed(JPEG, at, height.to_bytes(2, "big") + width.to_bytes(2, "big"))


def extended_webp(width: int, height: int) -> bytes:
    body = (
        b"VP8X\x0a\0\0\0\0\0\0\0" + (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little") + WEBP[12:]
    )
    return b"RIFF" + (len(body) + 4).to_bytes(4, "little") + b"WEBP" + body


@pytest.mark.parametrize("data", [giant_png(), sized_jpeg(65000, 65000), extended_webp(16000, 16000)])
def test_a_giant_is_refused_before_it_is_decoded(no_decoder: None, data: bytes) -> None:
    with pytest.raises(ValueError, match="million pixels are the most allowed"):
        decode.colour(compressed(data))


@pytest.mark.parametrize("data", [JPEG, PNG, WEBP, LOSSY_WEBP, extended_webp(WIDTH, HEIGHT)])
def test_another_size_than_expected_is_refused_before_it_is_decoded(no_decoder: None, data: bytes) -> None:
    with pytest.raises(ValueError, match=f"the image is {WIDTH}x{HEIGHT}, but 20x20 is expected"):
        decode.colour(compressed(data), (20, 20))


def test_a_head_that_lies_is_noticed() -> None:
    with pytest.raises(ValueError, match="the webp"):
        decode.colour(compressed(extended_webp(WIDTH + 1, HEIGHT)))
    rows = written_png((4, 4), 8, 0, bytes(5 * 3))
    with pytest.raises(ValueError, match="the png cannot be decoded"):
        decode.colour(compressed(rows))


def test_a_png_that_inflates_to_more_than_its_pixels_is_refused(no_decoder: None) -> None:
    """Short streams by their length; long ones are inflated as far as their pixels go."""
    with pytest.raises(ValueError, match="more data than 8x8 pixels"):
        decode.colour(compressed(written_png((8, 8), 8, 0, bytes(1 << 24))))
    noise = np.random.default_rng(0).integers(0, 256, (1000, 1201), np.uint8)
    noise[:, 0] = 0
    with pytest.raises(ValueError, match="more data than 1200x1000 pixels"):
        decode.colour(compressed(written_png((1200, 1000), 8, 0, noise.tobytes() + bytes(1 << 20))))
    whole = written_png((1200, 1000), 8, 0, noise.tobytes())
    assert len(whole) > png.INFLATED_FIRST
    assert png.read_png(memoryview(whole)).head.inflated == noise.nbytes


def test_text_profiles_and_animation_never_reach_a_decoder() -> None:
    bomb = zlib.compress(bytes(1 << 22), 9)
    extras = b"".join(
        png_chunk(kind, body)
        for kind, body in {b"zTXt": b"k\0\0" + bomb, b"iCCP": b"k\0\0" + bomb, b"acTL": bytes(8)}.items()
    )
    kept = png.read_png(memoryview(written_png((2, 1), 8, 0, b"\0\5\6", before=extras))).file()
    assert kept == written_png((2, 1), 8, 0, b"\0\5\6")


def test_a_png_of_endless_chunks_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(png, "MAX_CHUNKS", 20)
    with pytest.raises(ValueError, match="more than 20 chunks"):
        decode.colour(compressed(written_png((2, 1), 8, 0, b"\0\5\6", before=20 * png_chunk(b"tEXt", b"k\0"))))


def test_a_jpeg_of_a_thousand_scans_is_refused(no_decoder: None) -> None:
    data = encoded(".jpg", picture(1), cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    scan = data[data.rindex(b"\xff\xda") : -2]
    headers.check_jpeg(memoryview(data))
    with pytest.raises(ValueError, match="the jpeg has more than 100 scans"):
        decode.colour(compressed(data[:-2] + 1000 * scan + data[-2:]))


@settings(max_examples=40)
@given(share=st.floats(0, 1, exclude_max=True), which=st.sampled_from(["png", "webp", "lossy"]))
def test_a_cut_file_is_never_half_an_image(share: float, which: str) -> None:
    data = {"png": PNG, "webp": WEBP, "lossy": LOSSY_WEBP}[which]
    with pytest.raises(ValueError, match=r"ends early|is not supported"):
        decode.colour(compressed(data[: int(share * len(data))]))


CONVERSIONS: tuple[Callable[[CompressedImage], object], ...] = (decode.colour, decode.depth, decode.labels, look)


@settings(max_examples=150)
@given(
    head=st.sampled_from([b"", b"\xff\xd8\xff", SIGNATURE, b"RIFF\x14\0\0\0WEBPVP8X", PNG[:33], JPEG[:160], WEBP[:30]]),
    body=st.binary(max_size=120),
    form=st.sampled_from(["", "16UC1; compressedDepth rvl", "32FC1; compressedDepth png", "compressedDepth", "h264"]),
)
@example(b"\xff\xd8\xff\xc0", b"\0\x0b\x08\0\4\0\4\xff\xd9", "")
def test_any_bytes_are_an_image_or_a_refusal(head: bytes, body: bytes, form: str) -> None:
    message = compressed(head + body, form)
    for convert in CONVERSIONS:
        try:
            convert(message)
        except ValueError as err:
            assert " " in str(err)  # noqa: PT017


@settings(max_examples=60)
@given(which=st.sampled_from([JPEG, PNG, WEBP, LOSSY_WEBP]), at=st.floats(0, 1), new=st.binary(min_size=1, max_size=4))
def test_a_flipped_file_keeps_its_size_or_is_refused(which: bytes, at: float, new: bytes) -> None:
    """What a jpeg or a webp decodes to then cannot be known: neither has a checksum; a png has."""
    data = changed(which, int(at * (len(which) - len(new))), new)
    try:
        image = decode.colour(compressed(data), (WIDTH, HEIGHT))
    except ValueError:
        return
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert which is not PNG or np.array_equal(image, picture(2))


@pytest.mark.parametrize(
    ("message", "order", "bits"),
    [
        (raw(picture(0), "rgb8"), "rgb", 8),
        (raw(picture(0), "bgr8"), "bgr", 8),
        (raw(picture(0), "BGRA8"), "bgr", 8),
        (raw(label_picture(0), "mono8"), "grey", 8),
        (raw(label_picture(0), "bayer_rggb8"), "rgb", 8),
        (raw(label_picture(0), "nv12"), "rgb", 8),
        (raw(np.zeros((2, 2), "<u2"), "16UC1"), "metric", 16),
        (raw(np.zeros((2, 2), "<u2"), "mono16"), "metric", 16),
        (raw(np.zeros((2, 2), "<f4"), "32FC1"), "metric", 32),
        (raw(np.zeros((2, 2), "<f8"), "64FC1"), "metric", 64),
        (raw(np.zeros((2, 2), "<i4"), "32SC1"), "labels", 32),
        (raw(picture(0), "yuv9"), "unknown", 0),
        (compressed(PNG), "rgb", 8),
        (compressed(encoded(".png", label_picture(0))), "grey", 8),
        (compressed(encoded(".png", np.zeros((2, 2), np.uint16))), "metric", 16),
        (compressed(JPEG), "rgb", 8),
        (compressed(JPEG, "16UC1; jpeg compressed "), "spoilt", 8),
        (compressed(WEBP), "rgb", 8),
        (compressed(b"\0\0\0\1", "h265"), "video", 0),
        (compressed(b"", "jpeg"), "unknown", 0),
        (compressed(PNG[:20], "png"), "unknown", 0),
        (compressed(bytes(12) + PNG, "16UC1; compressedDepth png"), "metric", 16),
        (compressed(bytes(12) + PNG, "32FC1; compressedDepth"), "metric", 32),
        (compressed(bytes(30), "16UC1; compressedDepth rvl"), "metric", 16),
    ],
)
def test_a_look_tells_the_nature_without_decoding(
    no_decoder: None, message: ImageMessage, order: str, bits: int
) -> None:
    seen = look(message)
    assert (seen.order, seen.bits) == (order, bits)
