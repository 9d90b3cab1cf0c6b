"""The bytes of a ScanNet `.sens` file, version 4: a header, then frames of colour, depth and pose."""

import math
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.convert.rigid import is_rigid
from stsem.errors import ConversionError
from stsem.frame import Image
from stsem.log.pixels.sizes import MAX_PIXELS
from stsem.pose import Pose, inverse

VERSION = 4
RAW, PNG, JPEG = 0, 1, 2
RAW_USHORT, ZLIB_USHORT, OCCI_USHORT = 0, 1, 2
MAX_FRAMES = 1 << 20
MAX_IMAGE_BYTES = 256 << 20
_MAX_NAME = 4096
_MATRICES = 4 * 16 * 4
_TAIL = struct.Struct("<2i4IfQ")
FRAME = np.dtype([
    ("camera_to_world", "<f4", (4, 4)), ("color_us", "<u8"), ("depth_us", "<u8"),
    ("color_bytes", "<u8"), ("depth_bytes", "<u8"),
])  # fmt: skip
"""What stands before the colour and depth bytes of each frame."""


@dataclass(frozen=True, eq=False)
class Header:
    """What a file says about itself, its numbers checked.

    Args:
        color, depth: intrinsics; None when the matrix has no positive focal lengths.
        color_size, depth_size: (width, height).
        T_color_depth: (4, 4) colour camera from depth camera, metres; None when the extrinsics are no poses.
        color_compression, depth_compression: -1 unknown; RAW, PNG, JPEG; RAW_USHORT, ZLIB_USHORT, OCCI_USHORT.
        depth_shift: units of depth per metre.
        frames: how many there should be.
        start: where the first one begins, bytes.
    """

    color: Camera | None
    depth: Camera | None
    color_size: tuple[int, int]
    depth_size: tuple[int, int]
    T_color_depth: Pose | None
    color_compression: int
    depth_compression: int
    depth_shift: float
    frames: int
    start: int


def read_header(stream: IO[bytes], path: Path) -> Header:
    """The header of a file that is at its beginning.

    Raises:
        ConversionError: it is no `.sens` file of version 4, or a number in it cannot be.
    """
    (version,) = struct.unpack("<I", _take(stream, 4, path))
    if version != VERSION:
        raise ConversionError(f"{path} begins with version {version}, but .sens files of version {VERSION} are read.")
    (name_bytes,) = struct.unpack("<Q", _take(stream, 8, path))
    if name_bytes > _MAX_NAME:
        raise ConversionError(f"{path} says that its name has {name_bytes} bytes: it is broken or no .sens file.")
    _take(stream, name_bytes, path)
    with np.errstate(invalid="ignore"):  # a signalling NaN is no news: what is not finite is sorted out below
        matrices = np.frombuffer(_take(stream, _MATRICES, path), "<f4").reshape(4, 4, 4).astype(np.float64)
    tail = _TAIL.unpack(_take(stream, _TAIL.size, path))
    color_size, depth_size = (tail[2], tail[3]), (tail[4], tail[5])
    for what, (width, height) in (("colour", color_size), ("depth", depth_size)):
        if width * height > MAX_PIXELS:
            raise ConversionError(
                f"{path} says that its {what} images are {width}x{height}: it is broken, or too large for a log."
            )
    return Header(
        color=_camera(matrices[0], color_size),
        depth=_camera(matrices[2], depth_size),
        color_size=color_size,
        depth_size=depth_size,
        T_color_depth=_color_from_depth(matrices[1], matrices[3]),
        color_compression=tail[0],
        depth_compression=tail[1],
        depth_shift=tail[6],
        frames=tail[7],
        start=stream.tell(),
    )


@dataclass(frozen=True, eq=False)
class Index:
    """The whole frames of a file.

    Args:
        frames: (n,) of `FRAME`.
        places: (n,) int64: where the colour bytes of each begin; those of depth follow.
    """

    frames: npt.NDArray[np.void]
    places: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.places)

    def read(self, stream: IO[bytes], frame: int, part: str) -> bytes:
        """The bytes of an image of a frame; `part` is "color_bytes" or "depth_bytes".

        Raises:
            ValueError: there is none, or it is larger than an image can be.
        """
        size = int(self.frames[part][frame])
        if not 0 < size <= MAX_IMAGE_BYTES:
            raise ValueError(f"an image of {size} bytes cannot be")
        before = int(self.frames["color_bytes"][frame]) if part == "depth_bytes" else 0
        stream.seek(int(self.places[frame]) + before)
        return stream.read(size)


def read_index(stream: IO[bytes], header: Header, path: Path) -> Index:
    """Every frame up to the declared number, or to the first that does not fit into the file.

    Raises:
        ConversionError: there are more than MAX_FRAMES.
    """
    size = stream.seek(0, 2)
    heads: list[bytes] = []
    places: list[int] = []
    at = header.start
    while len(heads) < header.frames:
        stream.seek(at)
        head = stream.read(FRAME.itemsize)
        if len(head) < FRAME.itemsize:
            break
        color_bytes, depth_bytes = struct.unpack_from("<2Q", head, FRAME.itemsize - 16)
        place, at = at + FRAME.itemsize, at + FRAME.itemsize + color_bytes + depth_bytes
        if at > size:
            break
        if len(heads) == MAX_FRAMES:
            raise ConversionError(f"{path} has more than {MAX_FRAMES} frames: it is broken, or cut it into parts.")
        heads.append(head)
        places.append(place)
    return Index(np.frombuffer(b"".join(heads), FRAME), np.array(places, np.int64))


def raw_color(data: bytes, header: Header) -> Image:
    """(H, W, 3) uint8 of uncompressed colour; ValueError when the size is another."""
    width, height = header.color_size
    if len(data) != width * height * 3 or not data:
        raise ValueError(f"{len(data)} bytes came for {width}x{height} rgb")
    return np.frombuffer(data, np.uint8).reshape(height, width, 3)


def depth_samples(data: bytes, header: Header) -> npt.NDArray[np.uint16]:
    """(H, W) uint16 of a depth image; ValueError when it is not what the header says. Never more than its size."""
    width, height = header.depth_size
    expected = width * height * 2
    if header.depth_compression == ZLIB_USHORT:
        try:
            data = zlib.decompressobj().decompress(data, expected + 1)
        except zlib.error as err:
            raise ValueError(f"it is no zlib data ({err})") from err
    if len(data) != expected or not data:
        raise ValueError(f"{len(data)} bytes came for {width}x{height} of 16 bits")
    return np.frombuffer(data, "<u2").reshape(height, width)


def _take(stream: IO[bytes], size: int, path: Path) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise ConversionError(f"{path} ends within its header: it is cut off, or no .sens file.")
    return data


def _camera(K: npt.NDArray[np.float64], size: tuple[int, int]) -> Camera | None:
    fx, fy, cx, cy = (float(v) for v in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    if not all(math.isfinite(v) for v in (fx, fy, cx, cy)) or fx <= 0 or fy <= 0 or 0 in size:
        return None
    return Camera(*size, fx, fy, cx, cy)


def _color_from_depth(T_rig_color: Pose, T_rig_depth: Pose) -> Pose | None:
    """Each extrinsic maps its camera into one frame, which is colour's own in ScanNet."""
    if not (is_rigid(T_rig_color) and is_rigid(T_rig_depth)):
        return None
    return inverse(T_rig_color) @ T_rig_depth
