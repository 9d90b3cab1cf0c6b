"""What a camera sees of a lit scene: colour in linear light, exact depth and labels."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.classes import Labels
from stsem.frame import Depth
from stsem.pose import Pose
from stsem.synth.lighting import LightMap
from stsem.synth.materials import Materials
from stsem.synth.mesh import F32, I32, Quads
from stsem.synth.tracer import Tracer
from stsem.synth.vocabulary import Label

_SUBPIXELS = ((-0.125, -0.375), (0.375, -0.125), (-0.375, 0.125), (0.125, 0.375))

_Columns = npt.NDArray[np.integer] | npt.NDArray[np.floating]


@dataclass(frozen=True)
class LitBody:
    """Surfaces with their light, ready to be seen."""

    quads: Quads
    tracer: Tracer
    light: LightMap
    texels_per_metre: F32


@dataclass(frozen=True)
class View:
    """One exposure: `radiance` (H, W, 3) float32 linear; `depth` (H, W) metres along z; `labels` (H, W)."""

    radiance: F32
    depth: Depth
    labels: Labels


@dataclass(frozen=True)
class _Seen:
    body: I32
    quad: I32
    a: F32
    b: F32
    depth: F32


def lit_body(quads: Quads, tracer: Tracer, light: LightMap, materials: Materials) -> LitBody:
    """Bundle a lit bag of quads; works out how densely each is textured."""
    c, uv = quads.corners, quads.uv * materials.per_metre[quads.material][:, None]
    edges = [np.linalg.norm(c[:, k] - c[:, 0], axis=1) for k in (1, 3)]
    texels = [np.linalg.norm(uv[:, k] - uv[:, 0], axis=1) for k in (1, 3)]
    density = np.maximum(*(t / np.maximum(e, 1e-4) for t, e in zip(texels, edges, strict=True)))
    return LitBody(quads, tracer, light, density.astype(np.float32))


def look(
    bodies: list[LitBody], materials: Materials, camera: Camera, T_WC: Pose, shade_spots: npt.NDArray[np.float64]
) -> View:
    """Render one view.

    Args:
        bodies: the static scene first, then what moves.
        shade_spots: (n, 2) world x, y of walkers' feet, which darken the floor around them.
    """
    y, x = np.mgrid[: camera.height, : camera.width]
    rays = _rays(camera, T_WC, x.ravel(), y.ravel())
    seen = _cast(bodies, T_WC, rays)
    colour = _shade(bodies, materials, camera, T_WC, rays, seen, shade_spots)
    shape = (camera.height, camera.width)
    depth, labels = seen.depth.reshape(shape), _labels(bodies, seen).reshape(shape)
    edge = _edges(bodies, seen, depth, labels)
    if len(edge):
        total = np.zeros((len(edge), 3), np.float32)
        for dx, dy in _SUBPIXELS:
            fine = _rays(camera, T_WC, edge % camera.width + dx, edge // camera.width + dy)
            total += _shade(bodies, materials, camera, T_WC, fine, _cast(bodies, T_WC, fine), shade_spots)
        colour[edge] = total / len(_SUBPIXELS)
    return View(colour.reshape(*shape, 3), depth, labels)


def _rays(camera: Camera, T_WC: Pose, x: _Columns, y: _Columns) -> F32:
    """(n, 3) world directions with unit z in the camera, so that a ray's length is depth."""
    u = ((x - camera.cx) / camera.fx).astype(np.float32)[:, None]
    v = ((y - camera.cy) / camera.fy).astype(np.float32)[:, None]
    right, down, forward = (T_WC[:3, k].astype(np.float32) for k in range(3))
    return np.asarray(u * right + v * down + forward, np.float32)


def _cast(bodies: list[LitBody], T_WC: Pose, rays: F32) -> _Seen:
    origins = np.ascontiguousarray(np.broadcast_to(T_WC[:3, 3].astype(np.float32), rays.shape))
    first = bodies[0].tracer.cast(origins, rays)
    body = np.zeros(len(rays), np.int32)
    quad, a, b, depth = first.quad, first.a, first.b, first.distance
    for k, other in enumerate(bodies[1:], 1):
        hits = other.tracer.cast(origins, rays)
        nearer = hits.distance < depth
        body[nearer] = k
        quad, a = np.where(nearer, hits.quad, quad), np.where(nearer, hits.a, a)
        b, depth = np.where(nearer, hits.b, b), np.where(nearer, hits.distance, depth)
    return _Seen(body, quad, a, b, depth)


def _labels(bodies: list[LitBody], seen: _Seen) -> Labels:
    labels = np.asarray(bodies[0].quads.label[seen.quad * (seen.body == 0)], np.uint8)
    for k, body in enumerate(bodies[1:], 1):
        mine = seen.body == k
        labels[mine] = body.quads.label[seen.quad[mine]]
    return labels


def _edges(bodies: list[LitBody], seen: _Seen, depth: F32, labels: Labels) -> npt.NDArray[np.intp]:
    """Flat indices of pixels whose neighbour shows another material or a jump in depth."""
    material = np.where(seen.body == 0, bodies[0].quads.material[seen.quad * (seen.body == 0)], -1 - seen.body)
    key, inverse = material.reshape(depth.shape), 1 / depth
    differs = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        near = (slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))
        far = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        jump = np.abs(inverse[near] - inverse[far]) > 0.04 * np.maximum(inverse[near], inverse[far])
        step = (key[near] != key[far]) | jump | (labels[near] != labels[far])
        differs[near] |= step
        differs[far] |= step
    return np.flatnonzero(differs)


def _shade(
    bodies: list[LitBody], materials: Materials, camera: Camera, T_WC: Pose, rays: F32, seen: _Seen,
    shade_spots: npt.NDArray[np.float64],
) -> F32:  # fmt: skip
    """(n, 3) radiance."""
    if len(bodies) == 1 or not seen.body.any():
        return _shade_one(bodies[0], materials, camera, T_WC, rays, seen, shade_spots)
    colour = np.zeros((len(rays), 3), np.float32)
    for k, body in enumerate(bodies):
        mine = np.flatnonzero(seen.body == k)
        part = _Seen(seen.body[mine], seen.quad[mine], seen.a[mine], seen.b[mine], seen.depth[mine])
        colour[mine] = _shade_one(body, materials, camera, T_WC, rays[mine], part, shade_spots)
    return colour


def _shade_one(
    body: LitBody, materials: Materials, camera: Camera, T_WC: Pose, rays: F32, seen: _Seen,
    shade_spots: npt.NDArray[np.float64],
) -> F32:  # fmt: skip
    quads, quad = body.quads, seen.quad
    a, b = seen.a[:, None], seen.b[:, None]
    uv = quads.uv[quad, 0] + (quads.uv[quad, 1] - quads.uv[quad, 0]) * a + (quads.uv[quad, 3] - quads.uv[quad, 0]) * b
    material = quads.material[quad]
    facing = np.abs((quads.normals[quad, 0] * rays).sum(1)) / np.sqrt((rays * rays).sum(1))
    footprint = seen.depth / np.float32(camera.fx) * body.texels_per_metre[quad] / np.sqrt(np.maximum(facing, 0.08))
    albedo = materials.sample(material, uv, footprint)
    light = body.light.sample(quad, seen.a, seen.b)
    glow = materials.emission[material]
    radiance = albedo * np.where(glow[:, None] > 0, 0.25 * light + glow[:, None], light)
    floor = np.flatnonzero(quads.label[quad] == Label.FLOOR)
    for spot in shade_spots:
        point = T_WC[:2, 3] + rays[floor, :2] * seen.depth[floor, None]
        square = ((point - spot) ** 2).sum(1)
        radiance[floor] *= (1 - 0.5 * np.exp(-square / 0.09)).astype(np.float32)[:, None]
    return np.asarray(radiance, np.float32)
