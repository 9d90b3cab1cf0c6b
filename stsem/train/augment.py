"""Random views of a training pair: which frame is current, scale, place, mirror, light, noise."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL
from stsem.train.dataset import Pair

Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Augmentation:
    """Ranges of the random views.

    Args:
        crop: (width, height) of what the network sees.
        scales: smallest and largest width of the whole image, as a multiple of the crop's width.
        still: share of samples whose previous frame is the current one (a robot that stands), up to noise.
        plain: no photometric change and no mirror: for the last part of a training.
    """

    crop: tuple[int, int]
    scales: tuple[float, float] = (1.0, 2.0)
    still: float = 0.05
    plain: bool = False


@dataclass(frozen=True, eq=False)
class View:
    """What a network is trained on: `current`, `previous` (H, W, 3) uint8 RGB and `labels` (H, W) of `current`."""

    current: Image
    previous: Image
    labels: npt.NDArray[np.uint8]


def view(pair: Pair, how: Augmentation, rng: np.random.Generator) -> View:
    """A random view of `pair`, drawn from `rng` alone."""
    now = int(rng.integers(2))
    before = now if rng.random() < how.still else 1 - now
    box = _random_box(pair.labels.shape[2], pair.labels.shape[1], how, rng)
    current, previous = (_cut(pair.images[i], box, how.crop) for i in (now, before))
    labels = _cut(pair.labels[now], box, how.crop, labels=True)
    if how.plain:
        return View(current, previous, labels)
    current, previous = _relit(current, previous, rng)
    if rng.random() < 0.5:
        return View(*(np.ascontiguousarray(part[:, ::-1]) for part in (current, previous, labels)))
    return View(current, previous, labels)


Box = tuple[float, float, float, float]
"""Left, top, width, height in pixels of the pair; parts outside the image are void."""


def _random_box(width: int, height: int, how: Augmentation, rng: np.random.Generator) -> Box:
    """Log-uniform scale, aspect of the crop up to a tenth, anywhere that keeps it inside as far as it fits."""
    scale = float(np.exp(rng.uniform(*np.log(how.scales))))
    stretch = float(np.exp(rng.uniform(-0.1, 0.1))) if not how.plain else 1.0
    box_width = width / scale
    box_height = box_width * how.crop[1] / how.crop[0] * stretch
    if how.plain and scale == 1.0:
        box_height = float(height)
    left, top = (rng.uniform(min(0.0, side - part), max(0.0, side - part))
                 for side, part in ((width, box_width), (height, box_height)))  # fmt: skip
    return float(left), float(top), box_width, box_height


def _cut(image: Image, box: Box, size: tuple[int, int], *, labels: bool = False) -> Image:
    """The part of `image` under `box`, at `size`; black or NO_LABEL where the box leaves the image."""
    left, top, width, height = box
    sx, sy = size[0] / width, size[1] / height
    matrix = np.array([[sx, 0, (0.5 - left) * sx - 0.5], [0, sy, (0.5 - top) * sy - 0.5]], np.float64)
    border, flags = (NO_LABEL, cv2.INTER_NEAREST) if labels else ((0, 0, 0), cv2.INTER_LINEAR)
    return np.asarray(cv2.warpAffine(image, matrix, size, flags=flags, borderMode=cv2.BORDER_CONSTANT,
                                     borderValue=border), np.uint8)  # fmt: skip


def _relit(current: Image, previous: Image, rng: np.random.Generator) -> tuple[Image, Image]:
    """One change of gain per channel, offset and gamma for both; noise of its own for each."""
    levels = np.arange(256) / 255.0
    gain = np.exp(rng.uniform(-0.25, 0.25)) * np.exp(rng.uniform(-0.08, 0.08, 3))
    gamma, offset = np.exp(rng.uniform(-0.25, 0.25)), rng.uniform(-0.06, 0.06)
    table = levels[:, None] ** gamma * gain + offset
    table = np.rint(table.clip(0, 1) * 255).astype(np.uint8).reshape(256, 1, 3)
    sigma = rng.uniform(0, 5) if rng.random() < 0.5 else 0.0
    lit = (np.asarray(cv2.LUT(image, table), np.uint8) for image in (current, previous))
    now, before = (_noisy(image, sigma, rng) for image in lit)
    return now, before


def _noisy(image: Image, sigma: float, rng: np.random.Generator) -> Image:
    if sigma == 0.0:
        return image
    noise = rng.standard_normal(image.shape, np.float32) * np.float32(sigma)
    return (image + noise).clip(0, 255).astype(np.uint8)
