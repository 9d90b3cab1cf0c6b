"""Light, worked out once for the static scene on a grid of points per quad: soft direct light and ambient occlusion."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.synth.furnish import Light
from stsem.synth.mesh import F32, I32, Quads
from stsem.synth.tracer import Tracer

_SPACING = 0.14
_OFFSET = 0.006
_AMBIENT = np.array([0.30, 0.30, 0.31], np.float32)
_REACH = 1.6
_FALLOFF = 0.25


@dataclass(frozen=True)
class LightMap:
    """Irradiance RGB on a grid over every quad.

    Args:
        values: (n, 3) all grids one after the other.
        offset: (q,) where a quad's grid starts.
        columns, rows: (q,) its size, at least 2 each.
    """

    values: F32
    offset: I32
    columns: I32
    rows: I32

    def sample(self, quad: I32, a: F32, b: F32) -> F32:
        """(n, 3) irradiance at position (a, b) of `quad`, bilinear."""
        columns = self.columns[quad]
        x, y = a * (columns - 1), b * (self.rows[quad] - 1)
        x0 = np.clip(x.astype(np.int32), 0, columns - 2)
        y0 = np.clip(y.astype(np.int32), 0, self.rows[quad] - 2)
        fx, fy = (x - x0).astype(np.float32)[:, None], (y - y0).astype(np.float32)[:, None]
        start = self.offset[quad] + y0 * columns + x0
        take = self.values.take
        low = take(start, 0) * (1 - fx) + take(start + 1, 0) * fx
        high = take(start + columns, 0) * (1 - fx) + take(start + columns + 1, 0) * fx
        return np.asarray(low * (1 - fy) + high * fy, np.float32)


def illuminate(quads: Quads, tracer: Tracer, lights: list[Light], samples: int = 4, rays: int = 12) -> LightMap:
    """Light every quad.

    Args:
        quads: what to light (not necessarily what `tracer` holds: a walker is lit through the static scene).
        tracer: what casts shadows.
        lights: luminaires and windows.
        samples: shadow rays per point and light.
        rays: rays per point for ambient occlusion.
    """
    points, normals, offset, columns, rows = _grid(quads)
    values = _AMBIENT * _openness(tracer, points, normals, rays)[:, None]
    for light in lights:
        values = values + _direct(tracer, points, normals, light, samples)
    return LightMap(values.astype(np.float32), offset, columns, rows)


def _grid(quads: Quads) -> tuple[F32, F32, I32, I32, I32]:
    """Points just above the surfaces, their normals, and per quad where its grid starts and its size."""
    c = quads.corners
    wide = np.maximum(np.linalg.norm(c[:, 1] - c[:, 0], axis=1), np.linalg.norm(c[:, 2] - c[:, 3], axis=1))
    high = np.maximum(np.linalg.norm(c[:, 3] - c[:, 0], axis=1), np.linalg.norm(c[:, 2] - c[:, 1], axis=1))
    columns = np.clip(np.rint(wide / _SPACING) + 1, 2, 64).astype(np.int32)
    rows = np.clip(np.rint(high / _SPACING) + 1, 2, 64).astype(np.int32)
    count = columns * rows
    offset = np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int32)
    quad = np.repeat(np.arange(len(quads)), count)
    step = np.arange(len(quad)) - offset[quad]
    a = (step % columns[quad]) / (columns[quad] - 1)
    b = (step // columns[quad]) / (rows[quad] - 1)
    inset = np.minimum(0.012 / np.maximum(wide, 1e-3), 0.2)[quad], np.minimum(0.012 / np.maximum(high, 1e-3), 0.2)[quad]
    a, b = np.clip(a, inset[0], 1 - inset[0]), np.clip(b, inset[1], 1 - inset[1])
    weights = np.stack([(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b], 1).astype(np.float32)[..., None]
    points = (quads.corners[quad] * weights).sum(1)
    normals = (quads.normals[quad] * weights).sum(1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-6)
    return (points + _OFFSET * normals).astype(np.float32), normals.astype(np.float32), offset, columns, rows


def _openness(tracer: Tracer, points: F32, normals: F32, rays: int) -> F32:
    """(n,) 0..1: how far one can see from a point, averaged over a fixed cosine-weighted fan of rays."""
    helper = np.where(
        np.abs(normals[:, 2:3]) < 0.9, np.array([[0, 0, 1]], np.float32), np.array([[1, 0, 0]], np.float32)
    )
    side = np.cross(normals, helper)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(normals, side)
    total = np.zeros(len(points), np.float32)
    for k in range(rays):
        height = np.sqrt(1 - (k + 0.5) / rays)
        radius, angle = np.sqrt(1 - height * height), 2.399963 * k
        ray = normals * height + side * (radius * np.cos(angle)) + other * (radius * np.sin(angle))
        total += np.minimum(tracer.distance(points, ray.astype(np.float32)) / _REACH, 1)
    return np.asarray(0.25 + 0.75 * total / rays, np.float32)


def _direct(tracer: Tracer, points: F32, normals: F32, light: Light, samples: int) -> F32:
    """(n, 3) light from one lamp or window; shadows from a fixed pattern of points on it."""
    centre, power = np.array(light.position, np.float32), np.array(light.power, np.float32)
    towards = centre - points
    square = (towards * towards).sum(1)
    distance = np.sqrt(square)
    share = np.maximum((towards * normals).sum(1), 0) / (distance * (square + _FALLOFF))
    if light.facing is not None:
        share *= np.maximum(-(towards * np.array(light.facing, np.float32)).sum(1), 0) / distance
    lit = np.flatnonzero(share * power.max() > 0.008)
    clear = np.zeros(len(lit), np.float32)
    near = np.ascontiguousarray(points[lit])
    for shift in _pattern(samples):
        target = centre + np.array(light.size, np.float32) * shift
        clear += ~tracer.occluded(near, np.broadcast_to(target, near.shape))
    result = np.zeros((len(points), 3), np.float32)
    result[lit] = (share[lit] * clear / samples)[:, None] * power
    return result


def _pattern(samples: int) -> list[npt.NDArray[np.float32]]:
    """Offsets in [-1, 1]^3, spread evenly (R3 sequence)."""
    steps = np.array([0.8191725, 0.6710436, 0.5497005])
    return [((0.5 + steps * (k + 1)) % 1.0 * 2 - 1).astype(np.float32) for k in range(samples)]
