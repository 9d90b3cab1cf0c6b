"""A frame in cells: where each of them is, which way it faces and what it looks like."""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from stsem.frame import Image
from stsem.geometry.carried import Bools
from stsem.geometry.packed import Rows
from stsem.geometry.reproject import View

Float32 = npt.NDArray[np.float32]
Value = TypeVar("Value", np.uint8, np.float32)
Direction = npt.NDArray[np.float64]

CELLS = 120
"""Cells along the longer side of an image."""
LIGHTNESS = 0.5
"""Weight of L* against a* and b*: shade tells less than colour."""


@dataclass(frozen=True, eq=False)
class Cells:
    """What a frame looks like, cell by cell.

    Args:
        place: (h, w, 3) metres in the world, of the middle of each cell; NaN where its depth is unknown.
        normal: (h, w, 3) of unit length, towards the camera; 0 where a neighbour is unknown.
        colour: (h, w, 3) mean over the cell: 8-bit L*a*b*, L* times LIGHTNESS.
        texture: (h, w) standard deviation of the grey levels over the cell.
        view: of the frame.
        image: (H, W, 3) of the frame.
        side: pixels along a cell; the image may be up to side - 1 pixels wider and higher than all cells.
    """

    place: Float32
    normal: Float32
    colour: Float32
    texture: Float32
    view: View
    image: Image
    side: int

    @cached_property
    def depth(self) -> Float32:
        """(h, w) metres of the middle, NaN unknown."""
        return np.asarray(self.middles(self.view.depth), np.float32)

    @property
    def known(self) -> Bools:
        """(h, w) bool: the middle has depth."""
        return np.asarray(self.depth > 0)

    @property
    def up(self) -> Direction:
        """(3,) in the world, where the top of the image is."""
        return -self.view.T_WC[:3, 1]

    def middles(self, values: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
        """(h, w) of `values` (H, W) in the middle of each cell."""
        height, width = self.texture.shape
        return values[self.side // 2 :: self.side, self.side // 2 :: self.side][:height, :width]

    def pixels(self, cells: Bools) -> Rows:
        """(n,) the middles of the n true of `cells` (h, w), counted row by row over the image."""
        y, x = np.nonzero(cells)
        return np.asarray((y * self.side + self.side // 2) * self.image.shape[1] + x * self.side + self.side // 2)


def described(view: View, image: Image) -> Cells:
    """The cells of a frame.

    Args:
        view: its depth, pose and camera.
        image: (H, W, 3) of the size of its depth.

    Raises:
        ValueError: they differ in size.
    """
    height, width = view.depth.shape
    if image.shape[:2] != (height, width):
        raise ValueError(f"the image {image.shape[:2]} must have the size of its depth {view.depth.shape}")
    side = max(1, min(round(max(height, width) / CELLS), height, width))
    rows, columns = height // side, width // side
    middle = np.s_[side // 2 :: side, side // 2 :: side]
    x, y = np.arange(columns) * side + side // 2, np.arange(rows) * side + side // 2
    depth = view.depth[middle][:rows, :columns]
    seen = _seen(view, x.astype(np.float32)[None, :], y.astype(np.float32)[:, None], depth)
    whole = image[: rows * side, : columns * side]
    colour = lightened(_mean(whole, columns, rows))
    place = np.asarray(seen + view.T_WC[:3, 3], np.float32)
    return Cells(place, _normals(seen), colour, _texture(whole, columns, rows), view, image, side)


def lightened(colours: Image) -> Float32:
    """(h, w, 3) of the RGB `colours` (h, w, 3): 8-bit L*a*b*, L* times LIGHTNESS."""
    lab = cv2.cvtColor(colours, cv2.COLOR_RGB2LAB).astype(np.float32)
    lab[..., 0] *= np.float32(LIGHTNESS)
    return lab


def _mean(values: npt.NDArray[Value], columns: int, rows: int) -> npt.NDArray[Value]:
    return np.asarray(cv2.resize(values, (columns, rows), interpolation=cv2.INTER_AREA), values.dtype)


def _texture(image: Image, columns: int, rows: int) -> Float32:
    """(h, w) standard deviation of the grey levels over each cell: the root of E[g^2] - E[g]^2."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    mean, square = _mean(grey, columns, rows), _mean(grey * grey, columns, rows)
    return np.asarray(np.sqrt(np.maximum(square - mean * mean, 0)), np.float32)


def _seen(view: View, x: Float32, y: Float32, depth: Float32) -> Float32:
    """(h, w, 3) metres from the camera along the axes of the world: R z K^-1 (u, v, 1); NaN where depth is unknown."""
    ray = (view.T_WC[:3, :3] @ view.rays).astype(np.float32)
    known = np.where(depth > 0, depth, np.float32(np.nan))
    # Written out instead of a matrix product: BLAS may round differently with other thread counts.
    return np.stack([(a * x + b * y + c) * known for a, b, c in ray], axis=-1)


def _normals(place: Float32) -> Float32:
    """(h, w, 3) of unit length, of the surface through `place` (h, w, 3), towards the camera; 0 by an unknown place."""
    if min(place.shape[:2]) < 2:
        return np.zeros_like(place)
    down, right = np.gradient(place, axis=0), np.gradient(place, axis=1)
    (a, b, c), (d, e, f) = np.moveaxis(down, 2, 0), np.moveaxis(right, 2, 0)
    x, y, z = b * f - c * e, c * d - a * f, a * e - b * d
    length = np.sqrt(x * x + y * y + z * z)
    known = length > 0
    length[~known] = 1
    return np.asarray(
        np.stack([np.where(known, axis / length, np.float32(0)) for axis in (x, y, z)], axis=2), np.float32
    )
