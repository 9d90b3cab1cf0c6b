"""Pictures fitted to a surface: paintings, screens, keyboards, cupboard fronts, doors, the view outside.

Every function returns (h, w, 3) float in 0..1, sRGB.
"""

from itertools import pairwise

import cv2
import numpy as np

from stsem.synth.patterns import Picture, Rgb, Rng, cloud, speckled, wood


def _colour(rng: Rng, low: float = 0.05, high: float = 0.95) -> tuple[float, ...]:
    return tuple(float(v) for v in rng.uniform(low, high, 3))


def landscape(rng: Rng, height: int = 256, width: int = 320) -> Picture:
    """Hills under a sky."""
    share = np.linspace(0, 1, height)[:, None, None]
    sky = np.asarray(_colour(rng, 0.4, 0.95)) * (1 - share) + np.asarray(_colour(rng, 0.6, 1.0)) * share
    picture = np.broadcast_to(sky, (height, width, 3)) * (1 + 0.06 * cloud(rng, 1.6, height, width)[..., None])
    for k in range(5):
        ridge = height * (0.35 + 0.13 * k) + height * 0.07 * cloud(rng, 1.7, 4, width)[0]
        hill = np.asarray(_colour(rng, 0.05, 0.75)) * (1 + 0.18 * cloud(rng, 0.9, height, width)[..., None])
        picture = np.where((np.arange(height)[:, None] > ridge)[..., None], hill, picture)
    return np.clip(picture, 0, 1)


def abstract(rng: Rng, height: int = 256, width: int = 320) -> Picture:
    """Shapes in strong colours."""
    picture = np.ascontiguousarray(np.broadcast_to(np.asarray(_colour(rng)), (height, width, 3)))
    for _ in range(int(rng.integers(9, 22))):
        x, y = int(rng.integers(0, width)), int(rng.integers(0, height))
        size = int(rng.integers(10, 90))
        if rng.random() < 0.5:
            cv2.circle(picture, (x, y), size // 2, _colour(rng), -1, cv2.LINE_AA)
        else:
            corner = (x + size, y + int(rng.integers(10, 90)))
            cv2.rectangle(picture, (x, y), corner, _colour(rng), -1)
    return np.clip(picture * (1 + 0.05 * cloud(rng, 0.8, height, width)[..., None]), 0, 1)


def grid_art(rng: Rng, height: int = 256, width: int = 320) -> Picture:
    """Fields of colour between black bars."""
    picture = np.full((height, width, 3), 0.92)
    xs = [0, *sorted(int(v) for v in rng.integers(20, width - 20, 4)), width]
    ys = [0, *sorted(int(v) for v in rng.integers(20, height - 20, 3)), height]
    for a, b in pairwise(ys):
        for c, d in pairwise(xs):
            if rng.random() < 0.65:
                picture[a:b, c:d] = _colour(rng)
            cv2.rectangle(picture, (c, a), (d, b), (0.06, 0.06, 0.06), 6)
    return np.clip(picture * (1 + 0.03 * cloud(rng, 0.6, height, width)[..., None]), 0, 1)


def painting(rng: Rng) -> Picture:
    """One of the three kinds, in a pale mount."""
    kind = (landscape, abstract, grid_art)[int(rng.integers(3))]
    picture = kind(rng)
    if rng.random() < 0.5:
        mounted = cv2.copyMakeBorder(picture, 26, 26, 26, 26, cv2.BORDER_CONSTANT, value=(0.9, 0.88, 0.84))
        return np.asarray(mounted, np.float64)
    return picture


def outside(rng: Rng, bright: float, height: int = 256, width: int = 256) -> Picture:
    """Sky, clouds, houses and trees as seen through a window."""
    share = np.linspace(0, 1, height)[:, None, None]
    sky = np.array([0.55, 0.75, 0.98]) * (1 - share) + np.array([0.88, 0.94, 1.0]) * share
    white = np.clip(0.5 * cloud(rng, 1.5, height, width) + 0.1, 0, 1)[..., None]
    picture = np.ascontiguousarray(sky * (1 - white) + white)
    x = 0
    while x < width:
        wide, top = int(rng.integers(30, 80)), int(height * rng.uniform(0.45, 0.75))
        wall = _colour(rng, 0.45, 0.8)
        cv2.rectangle(picture, (x, top), (x + wide, height), wall, -1)
        for wy in range(top + 8, height, 18):
            for wx in range(x + 6, x + wide - 8, 14):
                cv2.rectangle(picture, (wx, wy), (wx + 7, wy + 10), (0.3, 0.35, 0.42), -1)
        x += wide + int(rng.integers(0, 40))
    ridge = height * 0.86 + height * 0.07 * cloud(rng, 1.2, 4, width)[0]
    trees = np.array([0.22, 0.42, 0.16]) * (1 + 0.25 * cloud(rng, 0.7, height, width)[..., None])
    picture = np.where((np.arange(height)[:, None] > ridge)[..., None], trees, picture)
    return np.clip(picture * bright, 0, 1)


def screen(rng: Rng, height: int = 160, width: int = 256) -> Picture:
    """A desktop with windows full of text lines."""
    picture = np.ascontiguousarray(np.broadcast_to(np.asarray(_colour(rng, 0.05, 0.45)), (height, width, 3)))
    for _ in range(int(rng.integers(2, 4))):
        x, y = int(rng.integers(0, width // 2)), int(rng.integers(0, height // 2))
        w, h = int(rng.integers(80, 150)), int(rng.integers(60, 110))
        dark = rng.random() < 0.4
        cv2.rectangle(picture, (x, y), (x + w, y + h), (0.12,) * 3 if dark else (0.93,) * 3, -1)
        cv2.rectangle(picture, (x, y), (x + w, y + 8), _colour(rng, 0.2, 0.7), -1)
        for line in range(y + 14, y + h - 4, 6):
            ink = _colour(rng, 0.5, 0.95) if dark else _colour(rng, 0.05, 0.5)
            start = x + 5 + 6 * int(rng.integers(0, 4))
            cv2.line(picture, (start, line), (start + int(rng.integers(10, max(11, w - 40))), line), ink, 2)
    return picture


def keyboard(rng: Rng, dark: bool) -> Picture:
    """Rows of keys."""
    base = 0.1 if dark else 0.75
    picture = np.full((72, 200, 3), base)
    for row in range(5):
        for column in range(15):
            x, y = 5 + column * 13, 5 + row * 13
            cv2.rectangle(picture, (x, y), (x + 9, y + 9), (base + rng.uniform(0.08, 0.18),) * 3, -1)
    return picture


def tower_front(rng: Rng, base: Rgb) -> Picture:
    """Drive bay, buttons, a light and air slots."""
    picture = speckled(rng, base, 0.03, 256)[:, :112].copy()
    light = tuple(min(1.0, c + 0.2) for c in base)
    cv2.rectangle(picture, (10, 14), (102, 34), light, -1)
    cv2.rectangle(picture, (10, 44), (102, 60), light, 2)
    cv2.circle(picture, (56, 90), 9, (0.75, 0.78, 0.8), -1, cv2.LINE_AA)
    cv2.circle(picture, (84, 90), 4, (0.2, 0.95, 0.4), -1, cv2.LINE_AA)
    for y in range(130, 240, 9):
        cv2.line(picture, (18, y), (94, y), tuple(0.4 * c for c in base), 3)
    return picture


def cupboard_front(rng: Rng, base: Rgb, doors: int) -> Picture:
    """Closed doors with gaps and handles."""
    picture = (wood(rng, base) if rng.random() < 0.6 else speckled(rng, base, size=512)).copy()
    size = picture.shape[0]
    for k in range(doors):
        a, b = k * size // doors, (k + 1) * size // doors
        cv2.rectangle(picture, (a + 3, 6), (b - 4, size - 10), tuple(0.45 * c for c in base), 3)
        x = b - 34 if k % 2 == 0 else a + 28
        cv2.rectangle(picture, (x, size // 2 - 42), (x + 9, size // 2 + 42), (0.78, 0.78, 0.8), -1)
        cv2.rectangle(picture, (x, size // 2 - 42), (x + 9, size // 2 + 42), (0.25, 0.25, 0.26), 2)
    return picture


def shelves(rng: Rng, base: Rgb, rows: int) -> Picture:
    """Open shelves full of binders and books."""
    size = 512
    picture = np.ascontiguousarray(np.broadcast_to(np.asarray(base) * 0.35, (size, size, 3)))
    for row in range(rows):
        low, high = (row + 1) * size // rows - 10, row * size // rows + 12
        x = 12
        while x < size - 40:
            wide = int(rng.integers(14, 40))
            top = high + int(rng.integers(4, (low - high) // 3))
            if rng.random() < 0.9:
                colour = _colour(rng, 0.08, 0.85)
                cv2.rectangle(picture, (x, top), (x + wide - 2, low), colour, -1)
                plate = (x + wide // 4, top + 14), (x + 3 * wide // 4, top + 14 + (low - top) // 3)
                cv2.rectangle(picture, *plate, (0.9, 0.9, 0.87), -1)
            x += wide
        cv2.rectangle(picture, (0, low), (size, low + 11), tuple(base), -1)
    cv2.rectangle(picture, (0, 0), (size - 1, size - 1), tuple(base), 14)
    return picture


def door_leaf(rng: Rng, base: Rgb, glazed: bool) -> Picture:
    """A door: veneer, two panels or a light strip, a kick plate."""
    picture = cv2.rotate(wood(rng, base), cv2.ROTATE_90_CLOCKWISE)
    dark, light = tuple(0.55 * c for c in base), tuple(min(1.0, 1.15 * c) for c in base)
    if glazed:
        cv2.rectangle(picture, (300, 60), (420, 330), (0.62, 0.7, 0.72), -1)
        cv2.rectangle(picture, (300, 60), (420, 330), dark, 8)
    else:
        for top, low in ((50, 215), (265, 450)):
            cv2.rectangle(picture, (85, top), (427, low), dark, 9)
            cv2.rectangle(picture, (92, top + 5), (434, low + 5), light, 3)
    cv2.rectangle(picture, (0, 470), (511, 511), (0.55, 0.55, 0.57), -1)
    return np.asarray(picture, np.float64)


def desk_top(rng: Rng, base: Rgb) -> Picture:
    """A desk from above: veneer with sheets of paper lying on it."""
    picture = wood(rng, base).copy() if rng.random() < 0.7 else speckled(rng, base, size=512).copy()
    for _ in range(int(rng.integers(2, 6))):
        centre = (float(rng.uniform(60, 450)), float(rng.uniform(80, 430)))
        corners = cv2.boxPoints((centre, (60.0, 150.0), float(rng.uniform(-40, 40)))).astype(np.int32)
        cv2.fillPoly(picture, [corners], (0.93, 0.93, 0.9))
        cv2.polylines(picture, [corners], True, (0.6, 0.6, 0.58), 2)
        for k in range(5):
            a = corners[1] * (0.85 - 0.14 * k) + corners[0] * (0.15 + 0.14 * k)
            b = corners[2] * (0.85 - 0.14 * k) + corners[3] * (0.15 + 0.14 * k)
            start, end = a * 0.85 + b * 0.15, a * 0.2 + b * 0.8
            cv2.line(picture, start.astype(int).tolist(), end.astype(int).tolist(), (0.35, 0.35, 0.4), 2)
    return picture
