"""Random views of a training pair: which frame is current, scale, place, mirror, light, noise."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL
from stsem.train.dataset import Pair
from stsem.train.recipe import Recipe

Image = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Augmentation:
    """Ranges of the random views.

    Args:
        crop: (width, height) of what the network sees.
        scales: smallest and largest width of the whole image, as a multiple of the crop's width.
        of_image: `scales` are multiples of the image's own width.
        stretch: largest logarithm of the change of aspect.
        mirror: half of the views are mirrored.
        light: photometric changes.
        still: share of samples whose previous frame is the current one (a robot that stands), up to noise.
        fill: RGB of what lies beyond the image.
    """

    crop: tuple[int, int]
    scales: tuple[float, float] = (1.0, 2.0)
    of_image: bool = False
    stretch: float = 0.1
    mirror: bool = True
    light: bool = True
    still: float = 0.05
    fill: Colour = (0, 0, 0)

    @classmethod
    def of(cls, recipe: Recipe, mean: tuple[float, float, float]) -> "Augmentation":
        """As a recipe says; beyond the image lies `mean` (RGB in 0..1), which a network sees as zero."""
        red, green, blue = (round(255 * part) for part in mean)
        return cls(
            recipe.crop, recipe.scales, recipe.of_image, recipe.stretch, recipe.mirror, recipe.light, recipe.still,
            (red, green, blue),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class View:
    """What a network is trained on.

    Args:
        current, previous: (H, W, 3) uint8 RGB.
        labels: (H, W) uint8 of `current`.
        depth: (H, W) float32 metres of `current`, NaN unknown; None where the pair has none.
    """

    current: Image
    previous: Image
    labels: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32] | None = None


def view(pair: Pair, how: Augmentation, rng: np.random.Generator) -> View:
    """A random view of `pair`, drawn from `rng` alone."""
    usable = pair.labelled or (0, 1)
    now = usable[int(rng.integers(len(usable)))]
    before = now if rng.random() < how.still else 1 - now
    box = _random_box(pair.labels.shape[2], pair.labels.shape[1], how, rng)
    current, previous = (_cut(pair.images[i], box, how.crop, how.fill) for i in (now, before))
    labels = _cut(pair.labels[now], box, how.crop, NO_LABEL, nearest=True)
    depth = None if pair.depths is None else _cut(pair.depths[now], box, how.crop, float("nan"), nearest=True)
    if how.light:
        current, previous = _relit(current, previous, rng)
    if how.mirror and rng.random() < 0.5:
        current, previous, labels = (np.ascontiguousarray(part[:, ::-1]) for part in (current, previous, labels))
        depth = None if depth is None else np.ascontiguousarray(depth[:, ::-1])
    return View(current, previous, labels, depth)


Box = tuple[float, float, float, float]
"""Left, top, width, height in pixels of the pair; parts outside the image are void."""


def _random_box(width: int, height: int, how: Augmentation, rng: np.random.Generator) -> Box:
    """Log-uniform scale, aspect of the crop up to `stretch`, anywhere that keeps it inside as far as it fits."""
    scale = float(np.exp(rng.uniform(*np.log(how.scales))))
    stretch = float(np.exp(rng.uniform(-how.stretch, how.stretch))) if how.stretch else 1.0
    box_width = (how.crop[0] if how.of_image else width) / scale
    box_height = box_width * how.crop[1] / how.crop[0] * stretch
    left, top = (rng.uniform(min(0.0, side - part), max(0.0, side - part))
                 for side, part in ((width, box_width), (height, box_height)))  # fmt: skip
    return float(left), float(top), box_width, box_height


def _cut(image: Any, box: Box, size: tuple[int, int], fill: Colour | float, *, nearest: bool = False) -> Any:
    """The part of `image` under `box`, at `size`; `fill` where the box leaves the image."""
    left, top, width, height = box
    sx, sy = size[0] / width, size[1] / height
    matrix = np.array([[sx, 0, (0.5 - left) * sx - 0.5], [0, sy, (0.5 - top) * sy - 0.5]], np.float64)
    flags = cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR
    return cv2.warpAffine(image, matrix, size, flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=fill)


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
