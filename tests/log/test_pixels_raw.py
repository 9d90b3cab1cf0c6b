"""Raw images: every row of the table against its definition, whatever the size, the padding and the byte order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from image_messages import raw, raw_rows
from made_up_logs import picture
from raw_layouts import CHANNELS, YUV

from stsem.log.pixels import decode
from stsem.log.pixels.encodings import ENCODINGS
from stsem.log.schemas.messages import RawImage

Planes = tuple[np.ndarray, np.ndarray, np.ndarray]

NO_COLOUR = {"16UC1", "32FC1", "64FC1", "32SC1"}
BAYER = {f"bayer_{block}{bits}" for block in ("rggb", "bggr", "gbrg", "grbg") for bits in (8, 16)}


def test_every_row_of_the_table_is_tested() -> None:
    assert set(ENCODINGS) == set(CHANNELS) | NO_COLOUR | BAYER | set(YUV)


@settings(max_examples=60)
@given(
    encoding=st.sampled_from(sorted(CHANNELS)), width=st.integers(1, 9), height=st.integers(1, 5),
    padding=st.integers(0, 9), big_endian=st.booleans(), seed=st.integers(0, 9),
)  # fmt: skip
def test_channels(encoding: str, width: int, height: int, padding: int, big_endian: bool, seed: int) -> None:
    """8 bits come back exactly; of 16 the high byte."""
    wide = ENCODINGS[encoding].bits == 16
    rgba = np.random.default_rng(seed).integers(0, 65536 if wide else 256, (height, width, 4))
    stored = rgba[:, :, ["RGBA".index(channel) for channel in CHANNELS[encoding]]]
    dtype = (">u2" if big_endian else "<u2") if wide else "u1"
    message = raw(stored.astype(dtype), encoding, padding=padding, big_endian=big_endian)
    rgb = decode.colour(message)
    expected = rgba[:, :, :3] if len(CHANNELS[encoding]) > 1 else rgba[:, :, [0, 0, 0]]
    np.testing.assert_array_equal(rgb, expected >> 8 if wide else expected)
    assert rgb.dtype == np.uint8
    assert rgb.flags.c_contiguous
    assert rgb.flags.writeable


@pytest.mark.parametrize("encoding", sorted(BAYER))
@pytest.mark.parametrize("size", [(8, 6), (7, 5), (3, 3)])
def test_mosaics(encoding: str, size: tuple[int, int]) -> None:
    """The letters name the block at the top left: what a pixel saw stays, and one colour gives one colour."""
    width, height = size
    wide = encoding.endswith("16")
    letters = encoding.removeprefix("bayer_")[:4]
    channel = np.array(["rgb".index(letter) for letter in letters]).reshape(2, 2)
    seen = np.tile(channel, (height, width))[:height, :width]
    rgb = np.random.default_rng(1).integers(0, 256, (height, width, 3))
    flat = np.broadcast_to([10, 120, 230], rgb.shape)
    for image in (rgb, flat):
        mosaic = np.take_along_axis(image, seen[:, :, None], 2)[:, :, 0]
        message = raw((mosaic << 8).astype("<u2") if wide else mosaic.astype("u1"), encoding, padding=3)
        colour = decode.colour(message)
        own = np.take_along_axis(colour, seen[:, :, None], 2)[:, :, 0]
        np.testing.assert_array_equal(own[1:-1, 1:-1], mosaic[1:-1, 1:-1])
        assert colour.shape == rgb.shape
    np.testing.assert_array_equal(colour, flat)


def studio_rgb(y: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """ITU-R BT.601 in studio range, to float RGB."""
    luma = 255 / 219 * (y - 16.0)
    cb, cr = 255 / 224 * (u - 128.0), 255 / 224 * (v - 128.0)
    return np.clip(np.dstack([luma + 1.402 * cr, luma - 0.344136 * cb - 0.714136 * cr, luma + 1.772 * cb]), 0, 255)


@pytest.mark.parametrize("encoding", sorted(YUV))
@pytest.mark.parametrize("padding", [0, 6])
def test_yuv(encoding: str, padding: int) -> None:
    """Within two steps of the definition, each pixel with the colour of its group."""
    across, down, store = YUV[encoding]
    width, height = 12 if across == 2 else 11, 6 if down == 2 else 5
    rng = np.random.default_rng(2)
    y, u, v = (rng.integers(16, 236, (height // d, width // a), np.uint8)
               for a, d in ((1, 1), (across, down), (across, down)))  # fmt: skip
    rows = store(y, u, v)
    if padding and encoding == "i420":  # rows of colour are half a step
        half = rows[height:].reshape(-1, width // 2)
        rows = np.concatenate([np.pad(rows[:height], ((0, 0), (0, padding))),
                               np.pad(half, ((0, 0), (0, padding // 2))).reshape(-1, width + padding)])  # fmt: skip
        padding = 0
    if padding and encoding == "nv24":  # rows of colour are two steps
        pairs = np.pad(rows[height:].reshape(height, -1), ((0, 0), (0, 2 * padding))).reshape(-1, width + padding)
        rows, padding = np.concatenate([np.pad(rows[:height], ((0, 0), (0, padding))), pairs]), 0
    rgb = decode.colour(raw_rows(rows, (width, height), encoding, padding=padding))
    full = [np.repeat(np.repeat(plane, down, 0), across, 1) for plane in (u, v)]
    assert rgb.shape == (height, width, 3)
    assert np.abs(rgb - studio_rgb(y, *full)).max() <= 2


@pytest.mark.parametrize("encoding", ["yuyv", "uyvy"])
def test_pairs_of_an_odd_width_are_filled_up(encoding: str) -> None:
    even = np.random.default_rng(3).integers(0, 256, (4, 6 * 2), np.uint8)
    whole = decode.colour(raw_rows(even, (6, 4), encoding))
    np.testing.assert_array_equal(decode.colour(raw_rows(even, (5, 4), encoding, padding=2)), whole[:, :5])
    with pytest.raises(ValueError, match="a row needs 12 bytes"):
        decode.colour(raw_rows(even[:, :10], (5, 4), encoding))


@pytest.mark.parametrize("name", ["RGB8", " rgb8 ", "Rgb 8", "rgb8\0"])
def test_names_in_any_case_with_blanks(name: str) -> None:
    np.testing.assert_array_equal(decode.colour(raw(picture(1), name)), picture(1))


def test_the_last_row_may_lack_its_padding() -> None:
    message = raw(picture(1), "rgb8", padding=5)
    short = RawImage(1, "", message.width, message.height, "rgb8", False, message.step, message.data[:-5])
    np.testing.assert_array_equal(decode.colour(short), picture(1))


def of(width: int, height: int, encoding: str, step: int, length: int) -> RawImage:
    return RawImage(1, "", width, height, encoding, False, step, memoryview(bytes(length)))


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (of(4, 4, "yuv9", 12, 48), "encoding 'yuv9' is not supported, only rgb8, bgr8"),
        (of(4, 4, "16UC1", 8, 32), "16UC1 is depth, but a colour image was expected"),
        (of(4, 4, "32SC1", 16, 64), "32SC1 holds ids, but a colour image was expected"),
        (of(4, 4, "rgb8", 11, 48), "4x4 rgb8 in rows of 11 bytes came, but a row needs 12 bytes"),
        (of(4, 4, "rgb8", 0, 48), "in rows of 0 bytes came, but a row needs 12 bytes"),
        (of(4, 4, "rgb8", 12, 47), "came in 47 bytes, but needs 48"),
        (of(4, 4, "rgb8", 1 << 31, 48), "came in 48 bytes, but needs"),
        (of(0, 4, "rgb8", 12, 0), "a size of 0x4 cannot be"),
        (of(1 << 31, 1, "mono8", 0, 0), "million pixels are the most allowed"),
        (of(5, 4, "nv12", 5, 90), "nv12 needs an even width and height, but 5x4 came"),
        (of(4, 5, "i420", 4, 90), "i420 needs an even width and height, but 4x5 came"),
        (of(5, 5, "nv16", 5, 90), "nv16 needs an even width, but 5x5 came"),
        (of(4, 4, "nv12", 4, 23), "4x4 nv12 in rows of 4 bytes came in 23 bytes, but needs 24"),
        (of(4, 4, "nv12", 3, 24), "a row needs 4 bytes"),
        (of(4, 4, "i420", 5, 40), "i420 has rows of half a step, but the step is 5"),
        (of(2, 9, "bayer_rggb8", 2, 18), "bayer_rggb8 needs 3 pixels each way, but 2x9 came"),
    ],
)
def test_what_cannot_be_used_is_refused_with_a_reason(message: RawImage, words: str) -> None:
    with pytest.raises(ValueError, match=r"\w+ \w+") as caught:
        decode.colour(message)
    assert words in str(caught.value)


@settings(max_examples=200)
@given(
    encoding=st.sampled_from(sorted(ENCODINGS)), width=st.integers(0, 12), height=st.integers(0, 6),
    step=st.integers(0, 60), data=st.binary(max_size=400), big_endian=st.booleans(),
)  # fmt: skip
def test_any_header_over_any_bytes_is_an_image_or_a_refusal(
    encoding: str, width: int, height: int, step: int, data: bytes, big_endian: bool
) -> None:
    message = RawImage(1, "", width, height, encoding, big_endian, step, memoryview(data))
    for convert in (decode.colour, decode.depth, decode.labels):
        try:
            assert convert(message).shape[:2] == (height, width)
        except ValueError as err:
            assert " " in str(err)  # noqa: PT017


def test_a_size_is_checked_before_the_pixels_are_touched() -> None:
    with pytest.raises(ValueError, match="the image is 32x24, but 16x12 is expected"):
        decode.colour(of(32, 24, "rgb8", 0, 0), (16, 12))
    with pytest.raises(ValueError, match="the image is 32x24, but 16x12 is expected"):
        decode.depth(of(32, 24, "32FC1", 0, 0), (16, 12))
    assert decode.colour(of(16, 12, "nv12", 16, 288), (16, 12)).shape == (12, 16, 3)


def test_images_own_their_memory() -> None:
    """A view would keep a whole chunk alive."""
    for encoding, encoded in ENCODINGS.items():
        if encoded.to_rgb:
            message = of(4, 4, encoding, 64, 1024)
            image = decode.colour(message)
            assert not np.shares_memory(image, np.frombuffer(message.data, np.uint8))
