"""A writer of small ScanNet `.sens` files."""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from made_up_images import encoded, pose, rgb

COLOR_SIZE, DEPTH_SIZE = (40, 30), (32, 24)
JPEG, ZLIB = 2, 1
Matrix = npt.NDArray[np.float64]


def intrinsic(fx: float, fy: float, cx: float, cy: float) -> Matrix:
    K = np.eye(4)
    K[0, 0], K[1, 1], K[0, 2], K[1, 2] = fx, fy, cx, cy
    return K


def depth_units(k: int) -> npt.NDArray[np.uint16]:
    """(H, W) millimetres of a slanted plane, with a hole."""
    v, u = np.mgrid[: DEPTH_SIZE[1], : DEPTH_SIZE[0]]
    units = (1000 + 10 * u + 7 * v + 3 * k).astype(np.uint16)
    units[4:6, 4:9] = 0
    return units


@dataclass
class Shot:
    """One frame as it is written."""

    color: bytes
    depth: bytes
    camera_to_world: Matrix
    color_us: int
    depth_us: int

    def packed(self) -> bytes:
        head = self.camera_to_world.astype("<f4").tobytes()
        numbers = struct.pack("<4Q", self.color_us, self.depth_us, len(self.color), len(self.depth))
        return head + numbers + self.color + self.depth


def shots(n: int = 4) -> list[Shot]:
    """Frames at 30 Hz from one second on; depth is exposed 5 ms later."""
    return [
        Shot(
            encoded(rgb(k, *COLOR_SIZE), ".png"), zlib.compress(depth_units(k).tobytes()), pose(k),
            1_000_000 + 33_333 * k, 1_005_000 + 33_333 * k,
        )
        for k in range(n)
    ]  # fmt: skip


@dataclass
class Scan:
    """A file and what its header says."""

    frames: Sequence[Shot] = field(default_factory=shots)
    name: bytes = b"StructureSensor"
    version: int = 4
    matrices: Sequence[Matrix] = field(
        default_factory=lambda: [intrinsic(36, 37, 19.5, 14.5), np.eye(4), intrinsic(28, 29, 15.5, 11.5), np.eye(4)]
    )
    compression: tuple[int, int] = (JPEG, ZLIB)
    sizes: tuple[int, int, int, int] = (*COLOR_SIZE, *DEPTH_SIZE)
    depth_shift: float = 1000.0
    declared: int | None = None
    imu: bytes = b"\7\0\0\0\0\0\0\0" + b"\1" * 100

    def packed(self) -> bytes:
        matrices = b"".join(m.astype("<f4").tobytes() for m in self.matrices)
        declared = len(self.frames) if self.declared is None else self.declared
        head = struct.pack("<IQ", self.version, len(self.name)) + self.name + matrices
        head += struct.pack("<2i4IfQ", *self.compression, *self.sizes, self.depth_shift, declared)
        return head + b"".join(frame.packed() for frame in self.frames) + self.imu

    def write(self, path: Path) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(self.packed())
        return path
