"""Procedural surfaces: carpet, wood, paint, tiles, fabric.

Every function returns (h, w, 3) float in 0..1, sRGB, tileable.
"""

from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.float64]
Rgb = tuple[float, float, float]
Rng = np.random.Generator

SIZE = 512
"""Texels a side of large surfaces."""

SMALL = 128
"""Texels a side of small ones."""


def cloud(rng: Rng, power: float, height: int = SIZE, width: int = SIZE, stretch: float = 1.0) -> Picture:
    """(h, w) tileable 1/f^power noise, zero mean, unit variance; `stretch` > 1 draws it out along the rows."""
    fy = np.fft.fftfreq(height)[:, None] * height
    fx = np.fft.rfftfreq(width)[None, :] * width * stretch
    radius = np.sqrt(fx * fx + fy * fy)
    radius[0, 0] = np.inf
    white = np.fft.rfft2(rng.standard_normal((height, width)))
    field = np.fft.irfft2(white / radius**power, s=(height, width))
    return np.asarray(field / field.std())


def tinted(base: Rgb, *variations: Picture) -> Picture:
    """The colour `base` times 1 + each variation (h, w) in turn."""
    shade = np.ones_like(variations[0])
    for variation in variations:
        shade = shade * (1 + variation)
    return np.clip(np.asarray(base)[None, None] * shade[..., None], 0, 1)


def paint(rng: Rng, base: Rgb) -> Picture:
    """A rolled wall: stipple, soft stains and a few scuffs."""
    picture = tinted(base, 0.035 * cloud(rng, 1.4), 0.022 * cloud(rng, 0.4))
    for _ in range(26):
        x, y = (int(v) for v in rng.integers(0, SIZE, 2))
        angle, length = rng.uniform(0, np.pi), rng.uniform(4, 22)
        end = (int(x + length * np.cos(angle)), int(y + length * np.sin(angle)))
        tone = tuple(float(np.clip(c * rng.uniform(0.78, 1.1), 0, 1)) for c in base)
        cv2.line(picture, (x, y), end, tone, int(rng.integers(1, 3)), cv2.LINE_AA)
    return picture


def carpet(rng: Rng, base: Rgb, fleck: Rgb) -> Picture:
    """A short-pile carpet with coloured flecks and trodden patches."""
    picture = tinted(base, 0.10 * cloud(rng, 1.2), 0.14 * cloud(rng, 0.2))
    spots = cv2.GaussianBlur((rng.random((SIZE, SIZE)) > 0.988).astype(np.float64), (3, 3), 0)[..., None] * 2.2
    return np.asarray(np.clip(picture * (1 - spots) + np.asarray(fleck) * spots, 0, 1), np.float64)


def carpet_tiles(rng: Rng, base: Rgb, fleck: Rgb) -> Picture:
    """Carpet laid in squares of half a metre (a quarter of the picture), each with its own tone."""
    picture = carpet(rng, base, fleck)
    step = SIZE // 4
    tone = rng.uniform(0.84, 1.14, (4, 4))
    picture *= np.kron(tone, np.ones((step, step)))[..., None]
    return np.clip(picture, 0, 1)


def planks(rng: Rng, base: Rgb, rows: int = 16) -> Picture:
    """A wooden floor: planks along the rows, each with its tone, grain along it, dark joints."""
    grain = 0.07 * cloud(rng, 1.1, stretch=0.12) + 0.04 * cloud(rng, 0.3, stretch=0.2)
    tone = np.ones((SIZE, SIZE))
    high = SIZE // rows
    for row in range(rows):
        y = row * high
        cuts = np.sort(rng.choice(np.arange(0, SIZE, 16), 3, replace=False))
        for k, start in enumerate(cuts):
            end = cuts[(k + 1) % 3] + (SIZE if k == 2 else 0)
            columns = np.arange(start, end) % SIZE
            tone[y : y + high, columns] = rng.uniform(0.78, 1.16)
            tone[y : y + high, columns[0]] = 0.45
        tone[y] = 0.5
    return np.clip(tinted(base, grain) * tone[..., None], 0, 1)


def wood(rng: Rng, base: Rgb, size: int = SIZE) -> Picture:
    """Veneer: long grain along the rows."""
    rings = np.sin(9 * cloud(rng, 1.8, size, size, stretch=0.18))
    fine = cloud(rng, 0.7, size, size, stretch=0.1)
    return tinted(base, 0.06 * rings, 0.05 * fine, 0.02 * cloud(rng, 0.1, size, size))


def speckled(rng: Rng, base: Rgb, amount: float = 0.04, size: int = SMALL) -> Picture:
    """Plastic, lacquer or laminate: almost even."""
    return tinted(base, amount * cloud(rng, 1.3, size, size), 0.5 * amount * cloud(rng, 0.1, size, size))


def woven(rng: Rng, base: Rgb) -> Picture:
    """Upholstery: a weave of threads and wear."""
    y, x = np.mgrid[:SMALL, :SMALL]
    weave = 0.07 * np.sin(x * np.pi / 4) * np.sin(y * np.pi / 4)
    return tinted(base, weave, 0.09 * cloud(rng, 0.9, SMALL, SMALL), 0.06 * cloud(rng, 0.1, SMALL, SMALL))


def striped(rng: Rng, base: Rgb, other: Rgb, count: int = 8) -> Picture:
    """Cloth with stripes along the columns."""
    y = np.mgrid[:SMALL, :SMALL][0]
    share = (np.sin(y * 2 * np.pi * count / SMALL) > 0.2)[..., None]
    return np.asarray(np.clip(woven(rng, base) * ~share + woven(rng, other) * share, 0, 1), np.float64)


def ceiling_tiles(rng: Rng, base: Rgb) -> Picture:
    """Mineral-fibre tiles (2 x 2 in the picture) with pinholes in a metal grid."""
    picture = tinted(base, 0.012 * cloud(rng, 1.0))
    for _ in range(2600):
        x, y = (int(v) for v in rng.integers(0, SIZE, 2))
        cv2.circle(picture, (x, y), int(rng.integers(1, 3)), tuple(c * rng.uniform(0.62, 0.85) for c in base), -1)
    step = SIZE // 2
    for k in range(2):
        tone = rng.uniform(0.95, 1.03, 2)
        picture[k * step : (k + 1) * step, :step] *= tone[0]
        picture[k * step : (k + 1) * step, step:] *= tone[1]
    for k in (0, step):
        picture[k : k + 8] = np.asarray(base) * 0.72
        picture[:, k : k + 8] = np.asarray(base) * 0.72
    return np.clip(picture, 0, 1)


def plaster(rng: Rng, base: Rgb) -> Picture:
    """A plastered ceiling: coarse trowel marks."""
    return tinted(base, 0.03 * cloud(rng, 1.1), 0.035 * cloud(rng, 0.5, stretch=0.5))


def floor_tiles(rng: Rng, base: Rgb, joint: Rgb) -> Picture:
    """Stone tiles, 5 x 5 in the picture, each with its tone."""
    count = 5
    edges = np.linspace(0, SIZE, count + 1).astype(int)
    picture = tinted(base, 0.06 * cloud(rng, 1.3), 0.05 * cloud(rng, 0.4))
    for a, b in pairwise(edges):
        for c, d in pairwise(edges):
            picture[a:b, c:d] *= rng.uniform(0.88, 1.08)
    for edge in edges[:-1]:
        picture[edge : edge + 4] = joint
        picture[:, edge : edge + 4] = joint
    return np.clip(picture, 0, 1)
