"""Depth: millimetres, metres, pngs, and the transport compressedDepth with png and RVL."""

import struct
import tracemalloc

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from image_messages import compressed, encoded, raw
from made_up_logs import picture
from rvl_writer import numbers, packed, rvl, split

from stsem.log.pixels import decode
from stsem.log.pixels.rvl import MAX_RVL_PIXELS, decode_rvl
from stsem.log.schemas.messages import CompressedImage, RawImage

STORED = np.array([[0, 1500, 20], [65535, 9999, 1]], np.uint16)
METRES = np.array([[np.nan, 1.5, 0.02], [np.nan, 9.999, 0.001]], np.float32)
# ROS quantises 32FC1 by default with depth_quantization 100 and depth_max 10: codec.cpp, encodeCompressedDepthImage.
A = 100.0 * (100.0 + 1.0)
B = 1.0 - A / 10.0


def header(a: float = 0.0, b: float = 0.0) -> bytes:
    return struct.pack("<iff", 0, a, b)


def rvl_body(stored: np.ndarray) -> bytes:
    height, width = stored.shape
    return struct.pack("<II", width, height) + rvl(stored)


@pytest.mark.parametrize("padding", [0, 3])
@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("encoding", ["16UC1", "mono16", "16uc1 "])
def test_millimetres(padding: int, big_endian: bool, encoding: str) -> None:
    """0 and 65535 are unknown; every other value is its thousandth, correctly rounded."""
    values = np.arange(65536).reshape(256, 256)
    stored = values.astype(">u2" if big_endian else "<u2")
    metres = decode.depth(raw(stored, encoding, padding=padding, big_endian=big_endian))
    expected = (values / 1000).astype(np.float32)
    expected[0, 0] = expected[-1, -1] = np.nan
    assert metres.dtype == np.float32
    np.testing.assert_array_equal(metres, expected)


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize(("encoding", "dtype"), [("32FC1", "f4"), ("64FC1", "f8")])
def test_metres(big_endian: bool, encoding: str, dtype: str) -> None:
    stored = np.array([[0.5, np.nan, np.inf], [-np.inf, 0.0, -1.0], [7.25, 1e-3, 80.0]])
    metres = decode.depth(raw(stored.astype((">" if big_endian else "<") + dtype), encoding, big_endian=big_endian))
    expected = np.array([[0.5, np.nan, np.nan], [np.nan] * 3, [7.25, 1e-3, 80.0]], np.float32)
    np.testing.assert_array_equal(metres, expected)


def test_the_largest_float_is_no_distance() -> None:
    """Simulators write it where a ray hits nothing; up to 100 km is taken as it is."""
    stored = np.array([[np.finfo(np.float32).max, 1e30, 100_001.0, 100_000.0, 120.0]], np.float32)
    expected = np.array([[np.nan, np.nan, np.nan, 1e5, 120.0]], np.float32)
    np.testing.assert_array_equal(decode.depth(raw(stored, "32FC1")), expected)


def test_what_float32_cannot_hold_is_unknown() -> None:
    assert np.isnan(decode.depth(raw(np.array([[1e300, 1e-300]]), "64FC1"))).all()


@pytest.mark.parametrize(
    ("form", "data"),
    [
        ("16UC1; png", encoded(".png", STORED)),
        ("", encoded(".png", STORED)),
        ("16UC1; compressedDepth png", header() + encoded(".png", STORED)),
        ("16UC1; compressedDepth", header() + encoded(".png", STORED)),
        ("mono16; compressedDepth ", header(np.nan, 1e9) + encoded(".png", STORED)),
        ("16UC1; compressedDepth png", header(A, B) + encoded(".png", STORED)),
        ("png", header() + encoded(".png", STORED)),
        ("16UC1; compressedDepth png", encoded(".png", STORED)),
        ("16UC1; compressedDepth rvl", header() + rvl_body(STORED)),
        ("16UC1; COMPRESSEDDEPTH RVL", header() + rvl_body(STORED)),
    ],
)
def test_files_of_millimetres(form: str, data: bytes) -> None:
    """The header is told by the word or by the png behind it; its garbage does no harm where the encoding is named."""
    np.testing.assert_array_equal(decode.depth(compressed(data, form), (3, 2)), METRES)


@pytest.mark.parametrize(
    ("form", "body"),
    [
        ("32FC1; compressedDepth png", encoded(".png", STORED)),
        ("32FC1; compressedDepth", encoded(".png", STORED)),
        ("", encoded(".png", STORED)),
        ("32FC1; compressedDepth rvl", rvl_body(STORED)),
    ],
)
def test_inverse_depth(form: str, body: bytes) -> None:
    """Depth = A / (v - B) and 0 is unknown; without the encoding's name the quantisation tells."""
    metres = decode.depth(compressed(header(A, B) + body, form))
    expected = A / (STORED - B)
    expected[0, 0] = np.nan
    np.testing.assert_allclose(metres, expected, rtol=1e-6)


def test_what_was_quantised_comes_back_within_a_step() -> None:
    true = np.linspace(0.3, 9.9, 200).reshape(10, 20)
    stored = np.round(A / true + B).astype(np.uint16)
    message = compressed(header(A, B) + encoded(".png", stored), "32FC1; compressedDepth png")
    assert np.abs(decode.depth(message) - true).max() < true.max() ** 2 / A


@pytest.mark.parametrize(("a", "b"), [(np.nan, 0.0), (0.0, 0.0), (-1.0, 0.5), (1.0, 20.0), (np.inf, -np.inf)])
def test_a_spoilt_quantisation_is_unknown_depth_and_never_negative(a: float, b: float) -> None:
    metres = decode.depth(compressed(header(a, b) + encoded(".png", STORED), "32FC1; compressedDepth png"))
    assert np.all(np.isnan(metres) | ((metres > 0) & np.isfinite(metres)))


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (raw(picture(0), "rgb8"), "depth needs 16UC1, mono16, 32FC1 or 64FC1, but rgb8 came"),
        (raw(picture(0)[:, :, 0], "nv12"), "but nv12 came"),
        (compressed(encoded(".png", picture(0))), "depth needs a grey png of 16 bits, but a coloured one of 8 came"),
        (compressed(encoded(".png", picture(0)[:, :, 0])), "but a grey one of 8 came"),
        (compressed(encoded(".jpg", picture(0)[:, :, 0]), "16UC1; jpeg compressed "), "whose 8 bits cannot hold it"),
        (compressed(b"\0\0\0\1", "h264"), "h264 is a video codec"),
        (compressed(b"", "16UC1; compressedDepth png"), "ends early"),
        (compressed(header(), "16UC1; compressedDepth png"), "has no png after its header"),
        (compressed(header() + bytes(7), "16UC1; compressedDepth rvl"), "the rvl stream ends early"),
        (compressed(header() + encoded(".png", picture(0)), "16UC1; compressedDepth"), "needs a grey png of 16 bits"),
        (compressed(encoded(".png", STORED), "32FC1; compressedDepth png"), "lacks its header"),
        (compressed(header() + struct.pack("<II", 1 << 31, 2) + bytes(9), "rvl; compressedDepth"), "the most allowed"),
        (compressed(header() + struct.pack("<II", 0, 2) + bytes(9), "rvl; compressedDepth"), "a size of 0x2 cannot be"),
        (
            compressed(header() + struct.pack("<II", 4096, 4096), "rvl; compressedDepth"),
            "8 million pixels are the most",
        ),
    ],
)
def test_what_is_no_depth_is_refused_with_a_reason(message: RawImage | CompressedImage, words: str) -> None:
    with pytest.raises(ValueError, match=r"\w+ \w+") as caught:
        decode.depth(message)
    assert words in str(caught.value)


def test_depth_is_no_colour() -> None:
    with pytest.raises(ValueError, match="16UC1; compressedDepth png is depth"):
        decode.colour(compressed(header() + encoded(".png", STORED), "16UC1; compressedDepth png"))


@pytest.mark.parametrize(
    ("form", "data"),
    [
        ("16UC1; compressedDepth png", header() + encoded(".png", STORED)),
        ("16UC1; compressedDepth rvl", header() + rvl_body(STORED)),
        ("png", encoded(".png", STORED)),
    ],
)
def test_another_size_than_expected_is_refused(form: str, data: bytes) -> None:
    with pytest.raises(ValueError, match="the image is 3x2, but 4x2 is expected"):
        decode.depth(compressed(data, form), (4, 2))


depths = st.lists(st.sampled_from([0, 0, 1, 2, 700, 701, 1500, 65534, 65535]) | st.integers(0, 65535), min_size=1)


@settings(max_examples=100)
@given(values=depths, width=st.integers(1, 8))
def test_rvl_is_lossless(values: list[int], width: int) -> None:
    image = np.array(values + [0] * (-len(values) % width), np.uint16).reshape(-1, width)
    np.testing.assert_array_equal(decode_rvl(memoryview(rvl(image)), width, len(image)), image)


def test_rvl_written_out_by_hand() -> None:
    """Two zeros, then 3 and 2 (differences +3 and -1, zigzag 6 and 1), then three zeros: nibbles 2 2 6 1 3 0."""
    assert list(numbers([0, 0, 3, 2, 0, 0, 0])) == [2, 2, 6, 1, 3, 0]
    stream = bytes([0x00, 0x30, 0x61, 0x22])  # the word 0x22613000
    assert packed([2, 2, 6, 1, 3, 0]) == stream
    assert list(split(0o123)) == [0o3 | 8, 0o2 | 8, 0o1]
    assert decode_rvl(memoryview(stream), 7, 1).tolist() == [[0, 0, 3, 2, 0, 0, 0]]


@pytest.mark.parametrize(
    ("stream", "words"),
    [
        ([], "ends early"),
        ([2, 2, 6], "ends early"),
        ([2, 3, 6, 1], "ends early"),
        ([1, 0, 9], "ends early"),
        ([9, 1], "holds more than its 6 pixels"),
        ([15] * 40, "the rvl stream"),
        ([15] * 12 + [1] + [0] * 11, "a number of more than 9 nibbles"),
    ],
)
def test_a_spoilt_rvl_stream_is_refused(stream: list[int], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        decode_rvl(memoryview(packed(stream)), 3, 2)


@settings(max_examples=200)
@given(stream=st.binary(max_size=200), width=st.integers(1, 40), height=st.integers(1, 40))
def test_any_rvl_stream_is_an_image_or_a_refusal(stream: bytes, width: int, height: int) -> None:
    try:
        assert decode_rvl(memoryview(stream), width, height).shape == (height, width)
    except ValueError as err:
        assert "rvl" in str(err)  # noqa: PT017


@pytest.mark.parametrize("filling", [0x00, 0x11, 0x08, 0x80, 0x88, 0xFF, 0x17])
def test_an_rvl_stream_costs_what_its_docstring_says(filling: int) -> None:
    """Whatever it holds, only as much of it is looked at as its pixels can need."""
    pixels, stream = 100 * 80, memoryview(bytes([filling]) * 5_000_000)
    tracemalloc.start()
    try:
        decode_rvl(stream, 100, 80)
    except ValueError:
        pass
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 50 * 3 * pixels + 8 * pixels + 100_000
    assert MAX_RVL_PIXELS * (50 * 3 + 8) < 1 << 31


def test_opencv_reads_the_same_png() -> None:
    data = header() + encoded(".png", STORED)
    stored = cv2.imdecode(np.frombuffer(data[12:], np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(decode.labels(compressed(data, "16UC1; compressedDepth png")), stored)
