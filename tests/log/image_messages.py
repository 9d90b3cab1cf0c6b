"""Image messages out of arrays and bytes, and pngs written by hand."""

import struct
import zlib

import cv2
import numpy as np

from stsem.log.schemas.messages import CompressedImage, RawImage

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def raw(array: np.ndarray, encoding: str, *, padding: int = 0, big_endian: bool = False) -> RawImage:
    """`array` (H, W, ...) row by row, `padding` bytes of 99 after each."""
    height, width = array.shape[:2]
    return raw_rows(array.reshape(height, -1), (width, height), encoding, padding=padding, big_endian=big_endian)


def raw_rows(
    rows: np.ndarray, size: tuple[int, int], encoding: str, *, padding: int = 0, big_endian: bool = False
) -> RawImage:
    """Rows of samples as they are stored, of an image of `size` (width, height)."""
    stored = np.ascontiguousarray(rows).view(np.uint8)
    padded = np.ascontiguousarray(np.pad(stored, ((0, 0), (0, padding)), constant_values=99))
    return RawImage(1, "cam", *size, encoding, big_endian, padded.shape[1], memoryview(padded.tobytes()))


def compressed(data: bytes, form: str = "") -> CompressedImage:
    """A file as a message."""
    return CompressedImage(1, "cam", form, memoryview(data))


def encoded(suffix: str, rgb: np.ndarray, *options: int) -> bytes:
    """(H, W) or (H, W, 3) RGB in OpenCV's encoder for `suffix`."""
    return cv2.imencode(suffix, rgb if rgb.ndim == 2 else rgb[:, :, ::-1], options)[1].tobytes()


def png_chunk(kind: bytes, body: bytes) -> bytes:
    """Length, kind, body, checksum."""
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def written_png(
    size: tuple[int, int], bits: int, colour_type: int, rows: bytes, *, before: bytes = b"", interlaced: bool = False
) -> bytes:
    """A png whose filtered rows are `rows`; `before` are chunks between head and pixels."""
    head = struct.pack(">IIBBBBB", *size, bits, colour_type, 0, 0, interlaced)
    body = png_chunk(b"IDAT", zlib.compress(rows, 9))
    return SIGNATURE + png_chunk(b"IHDR", head) + before + body + png_chunk(b"IEND", b"")


def giant_png() -> bytes:
    """A small file whose head asks for a terabyte."""
    return written_png((10**6, 10**6), 8, 2, b"")
