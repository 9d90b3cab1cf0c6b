"""Pixels: every encoding of the table, padding, byte order, file formats, and clear refusals."""

import zlib

import cv2
import numpy as np
import pytest
from made_up_logs import label_picture, picture, png

from stsem.log import pixels
from stsem.log.schemas.messages import CompressedImage, RawImage


def raw(array: np.ndarray, encoding: str, *, padding: int = 0, big_endian: bool = False) -> RawImage:
    rows = np.ascontiguousarray(array).reshape(array.shape[0], -1).view(np.uint8)
    padded = np.ascontiguousarray(np.pad(rows, ((0, 0), (0, padding)), constant_values=99))
    height, width = array.shape[:2]
    return RawImage(1, "cam", width, height, encoding, big_endian, padded.shape[1], memoryview(padded.tobytes()))


def compressed(data: bytes, form: str = "") -> CompressedImage:
    return CompressedImage(1, "cam", form, memoryview(data))


def giant_png() -> bytes:
    """A small file whose head asks for a terabyte."""
    head = b"IHDR" + (10**6).to_bytes(4, "big") * 2 + b"\x08\2\0\0\0"
    return b"\x89PNG\r\n\x1a\n" + b"\0\0\0\x0d" + head + zlib.crc32(head).to_bytes(4, "big") + bytes(100)


@pytest.mark.parametrize("padding", [0, 1, 7])
def test_raw_colour(padding: int) -> None:
    rgb = picture(1)
    np.testing.assert_array_equal(pixels.colour(raw(rgb, "rgb8", padding=padding)), rgb)
    np.testing.assert_array_equal(pixels.colour(raw(rgb[:, :, ::-1], "bgr8", padding=padding)), rgb)
    grey = pixels.colour(raw(rgb[:, :, 0], "mono8", padding=padding))
    np.testing.assert_array_equal(grey, np.repeat(rgb[:, :, :1], 3, axis=2))


def test_the_last_row_may_lack_its_padding() -> None:
    message = raw(picture(1), "rgb8", padding=5)
    short = RawImage(1, "", message.width, message.height, "rgb8", False, message.step, message.data[:-5])
    np.testing.assert_array_equal(pixels.colour(short), picture(1))


def test_images_own_their_memory() -> None:
    """A view would keep a whole chunk alive."""
    for message in (raw(picture(1), "rgb8"), raw(picture(1), "bgr8"), compressed(png(picture(1)))):
        image = pixels.colour(message)
        assert image.flags.owndata or image.base.flags.owndata
        assert image.flags.writeable


@pytest.mark.parametrize("padding", [0, 3])
@pytest.mark.parametrize("big_endian", [False, True])
def test_depth_in_millimetres(padding: int, big_endian: bool) -> None:
    """0 and 65535 are unknown; every other value is its thousandth, correctly rounded."""
    values = np.arange(65536).reshape(256, 256)
    stored = values.astype(">u2" if big_endian else "<u2")
    metres = pixels.depth(raw(stored, "16UC1", padding=padding, big_endian=big_endian))
    expected = (values / 1000).astype(np.float32)
    expected[0, 0] = expected[-1, -1] = np.nan
    assert metres.dtype == np.float32
    np.testing.assert_array_equal(metres, expected)


@pytest.mark.parametrize("big_endian", [False, True])
def test_depth_in_metres(big_endian: bool) -> None:
    stored = np.array([[0.5, np.nan, np.inf], [-np.inf, 0.0, -1.0], [7.25, 1e-3, 80.0]])
    metres = pixels.depth(raw(stored.astype(">f4" if big_endian else "<f4"), "32FC1", big_endian=big_endian))
    expected = np.array([[0.5, np.nan, np.nan], [np.nan] * 3, [7.25, 1e-3, 80.0]], np.float32)
    np.testing.assert_array_equal(metres, expected)


def test_depth_in_a_png() -> None:
    stored = np.array([[0, 1500], [65535, 20]], np.uint16)
    metres = pixels.depth(compressed(png(stored), "16UC1; png"))
    np.testing.assert_array_equal(metres, np.array([[np.nan, 1.5], [np.nan, 0.02]], np.float32))


def test_jpeg_is_what_opencv_decodes() -> None:
    data = bytes(cv2.imencode(".jpg", picture(2))[1])
    expected = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    np.testing.assert_array_equal(pixels.colour(compressed(data, "rgb8; jpeg compressed bgr8")), expected)
    np.testing.assert_array_equal(pixels.colour(compressed(data + bytes(7), "jpeg")), expected)


def test_the_bytes_decide_the_format_not_the_string() -> None:
    np.testing.assert_array_equal(pixels.colour(compressed(png(picture(1)[:, :, ::-1]), "jpeg")), picture(1))


def test_labels() -> None:
    ids = label_picture(1)
    for message in (
        raw(ids, "mono8"),
        raw(ids, "8UC1", padding=3),
        compressed(png(ids)),
        raw(ids.astype("<u2"), "16UC1"),
    ):
        np.testing.assert_array_equal(pixels.labels(message), ids)
    wide = raw((ids * 200).astype(">u2"), "16UC1", big_endian=True)
    np.testing.assert_array_equal(pixels.labels(wide), ids * 200)
    rgb = picture(3)
    for message in (raw(rgb, "rgb8"), raw(rgb[:, :, ::-1], "bgr8"), compressed(png(rgb[:, :, ::-1]))):
        np.testing.assert_array_equal(pixels.labels(message), rgb)
    alpha = np.dstack([rgb[:, :, ::-1], np.full(rgb.shape[:2], 255, np.uint8)])
    np.testing.assert_array_equal(pixels.labels(compressed(png(alpha))), rgb)


@pytest.mark.parametrize(
    ("convert", "message", "words"),
    [
        (pixels.colour, raw(picture(0), "bayer_rggb8"), "encoding 'bayer_rggb8' is not supported, only rgb8"),
        (pixels.colour, raw(np.zeros((2, 2), "<u2"), "16UC1"), "16UC1 is depth, but a colour image was expected"),
        (pixels.depth, raw(picture(0), "rgb8"), "depth needs 16UC1 or 32FC1, but rgb8 came"),
        (pixels.depth, compressed(png(picture(0))), "depth needs one 16-bit channel"),
        (pixels.labels, raw(np.zeros((2, 2), "<f4"), "32FC1"), "labels need whole numbers"),
        (pixels.labels, compressed(bytes(cv2.imencode(".jpg", picture(0))[1])), "labels need a lossless image"),
        (pixels.colour, compressed(b"\0\0\0\1gB\0", "h264"), "h264 is a video codec"),
        (pixels.colour, compressed(b"nonsense", "tiff"), "the format 'tiff' is not supported, only jpeg, png and webp"),
        (pixels.colour, compressed(b"", ""), "the format '' is not supported"),
        (pixels.colour, compressed(bytes(cv2.imencode(".jpg", picture(0))[1])[:200]), "the jpeg ends early"),
        (pixels.colour, compressed(png(picture(0))[:40]), "the png ends early"),
        (pixels.colour, compressed(png(picture(0))[:-5]), "the png ends early"),
        (pixels.colour, compressed(png(picture(0))[:60] + b"?" + png(picture(0))[61:]), "does not have its checksum"),
        (pixels.colour, compressed(giant_png()), "a png of 1000000x1000000 cannot be"),
        (pixels.colour, RawImage(1, "", 4, 4, "rgb8", False, 11, memoryview(bytes(48))), "in rows of 11 bytes"),
        (pixels.colour, RawImage(1, "", 4, 4, "rgb8", False, 12, memoryview(bytes(47))), "came in 47 bytes"),
        (pixels.colour, RawImage(1, "", 0, 4, "rgb8", False, 12, memoryview(b"")), "a size of 0x4 cannot be"),
        (pixels.colour, RawImage(1, "", 1 << 31, 1, "mono8", False, 0, memoryview(b"")), "cannot be"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused_with_a_reason(convert: object, message: object, words: str) -> None:
    with pytest.raises(ValueError, match=r"\w+ \w+") as caught:
        convert(message)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("message", "order", "bits"),
    [
        (raw(picture(0), "rgb8"), "rgb", 8),
        (raw(picture(0), "bgr8"), "bgr", 8),
        (raw(label_picture(0), "mono8"), "grey", 8),
        (raw(np.zeros((2, 2), "<u2"), "16UC1"), "metric", 16),
        (raw(np.zeros((2, 2), "<f4"), "32FC1"), "metric", 32),
        (raw(picture(0), "yuv9"), "unknown", 0),
        (compressed(png(picture(0))), "rgb", 8),
        (compressed(png(label_picture(0))), "grey", 8),
        (compressed(png(np.zeros((2, 2), np.uint16))), "metric", 16),
        (compressed(bytes(cv2.imencode(".jpg", picture(0))[1])), "rgb", 8),
        (compressed(bytes(cv2.imencode(".webp", picture(0))[1])), "rgb", 8),
        (compressed(b"\0\0\0\1", "h265"), "video", 0),
        (compressed(b"", "jpeg"), "unknown", 0),
    ],
)
def test_a_look_tells_the_nature_without_decoding(message: pixels.ImageMessage, order: str, bits: int) -> None:
    look = pixels.look(message)
    assert (look.order, look.bits) == (order, bits)
