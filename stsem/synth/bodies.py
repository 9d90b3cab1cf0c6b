"""Boxes, cylinders and ellipsoids out of quads."""

import numpy as np
import numpy.typing as npt

from stsem.synth.mesh import Builder
from stsem.synth.vocabulary import Label

Range = tuple[float, float]


def box(
    into: Builder, x: Range, y: Range, z: Range, material: int, label: Label, *,
    front: int | None = None, top: int | None = None, bottom: bool = True,
) -> None:  # fmt: skip
    """An axis-aligned box; `front` (the -y face) and `top` may have fitted materials of their own."""
    (x0, x1), (y0, y1), (z0, z1) = x, y, z
    into.quad(
        [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        material if front is None else front, label, fit=front is not None,
    )  # fmt: skip
    into.quad([(x1, y1, z0), (x0, y1, z0), (x0, y1, z1), (x1, y1, z1)], material, label)
    into.quad([(x0, y1, z0), (x0, y0, z0), (x0, y0, z1), (x0, y1, z1)], material, label)
    into.quad([(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)], material, label)
    into.quad(
        [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
        material if top is None else top, label, fit=top is not None,
    )  # fmt: skip
    if bottom:
        into.quad([(x0, y1, z0), (x1, y1, z0), (x1, y0, z0), (x0, y0, z0)], material, label)


def tube(
    into: Builder, start: npt.ArrayLike, end: npt.ArrayLike, radii: Range, material: int, label: Label, *,
    sides: int = 10, caps: bool = True, inside: bool = False, flat: float = 1.0,
) -> None:  # fmt: skip
    """A (tapered) cylinder from `start` to `end`; `inside` turns its faces in, `flat` squeezes it along one axis."""
    a, b = np.asarray(start, np.float64), np.asarray(end, np.float64)
    axis = (b - a) / np.linalg.norm(b - a)
    side = np.cross(axis, (0.0, 1.0, 0.0) if abs(axis[1]) < 0.9 else (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    angles = 2 * np.pi * np.arange(sides + 1) / sides
    ring = np.cos(angles)[:, None] * side + flat * np.sin(angles)[:, None] * other
    out = np.cos(angles)[:, None] * side + np.sin(angles)[:, None] / max(flat, 1e-3) * other
    low, high = a + radii[0] * ring, b + radii[1] * ring
    width = 2 * np.pi * max(radii) / sides
    for i in range(sides):
        j = i + 1
        order = (j, i) if inside else (i, j)
        p, q = order
        normals = np.array([out[p], out[q], out[q], out[p]]) * (-1 if inside else 1)
        into.quad([low[p], low[q], high[q], high[p]], material, label, normals=normals, shift=(i * width, 0.0))
    if caps:
        _cap(into, a, low, -axis, material, label)
        _cap(into, b, high, axis, material, label)


def _cap(
    into: Builder, centre: npt.NDArray[np.float64], ring: npt.NDArray[np.float64], normal: npt.NDArray[np.float64],
    material: int, label: Label,
) -> None:  # fmt: skip
    for i in range(0, len(ring) - 1, 2):
        k = min(i + 2, len(ring) - 1)
        into.quad([centre, ring[i], ring[i + 1], ring[k]], material, label, normals=[normal] * 4)


def ellipsoid(
    into: Builder, centre: npt.ArrayLike, radii: tuple[float, float, float], material: int, label: Label, *,
    sides: int = 10, rings: int = 6, span: Range = (-0.5, 0.5),
) -> None:  # fmt: skip
    """An ellipsoid, or the part of it between two latitudes (`span`, in units of pi)."""
    c, r = np.asarray(centre, np.float64), np.asarray(radii, np.float64)
    latitude = np.pi * np.linspace(span[0], span[1], rings + 1)
    longitude = 2 * np.pi * np.arange(sides + 1) / sides
    unit = np.stack(
        [
            np.cos(latitude)[:, None] * np.cos(longitude)[None],
            np.cos(latitude)[:, None] * np.sin(longitude)[None],
            np.sin(latitude)[:, None] * np.ones(sides + 1)[None],
        ],
        2,
    )
    points, normals = c + r * unit, unit / r
    for i in range(rings):
        for j in range(sides):
            index = ([i, i, i + 1, i + 1], [j, j + 1, j + 1, j])
            into.quad(points[index], material, label, normals=normals[index])
