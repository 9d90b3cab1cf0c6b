"""A toy set that can be learned: squares of pure colour on a dark ground, moved a little between the two frames."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from stsem.classes import ClassSet
from stsem.inference.sidecar import Difference, Sidecar
from stsem.train.dataset import Pair, PairFolder, save_pair
from stsem.train.recipe import RECIPES, Recipe

SIZE = (89, 41)
SIDECAR = Sidecar(SIZE, (0.5,) * 3, (0.25,) * 3, ClassSet(("dark", "red", "green")), Difference(4.0))
SCRATCH = replace(
    RECIPES["scratch"], iterations=8, fused_iterations=8, batch=4, fused_batch=4, crop=SIZE, scales=(1.0, 1.2),
    rate=5e-3, fused_rate=5e-3, average=0.9, checkpoint_every=4, report_every=2, validate_every=4,
)  # fmt: skip
PAPER = replace(
    RECIPES["paper"], iterations=6, fused_iterations=6, crop=SIZE, checkpoint_every=4, report_every=2, validate_every=4
)


def pair(seed: int, *, depth: bool = False) -> Pair:
    """The second frame is the first moved by two pixels; depth is 2 m, with a hole."""
    rng = np.random.default_rng(seed)
    image, labels = np.full((52, 96, 3), 30, np.uint8), np.zeros((52, 96), np.uint8)
    for _ in range(6):
        label, x, y = int(rng.integers(1, 3)), int(rng.integers(80)), int(rng.integers(36))
        image[y : y + 16, x : x + 16] = (220, 40, 40) if label == 1 else (40, 220, 40)
        labels[y : y + 16, x : x + 16] = label
    metres = np.full((2, 52, 96), 2.0, np.float32)
    metres[:, :10] = np.nan
    return Pair(
        np.stack([image, np.roll(image, 2, 1)]), np.stack([labels, np.roll(labels, 2, 1)]), metres if depth else None
    )


def write_squares(folder: Path, count: int = 12, *, depth: bool = False) -> PairFolder:
    """So many pairs on disk."""
    folder.mkdir(exist_ok=True)
    for i in range(count):
        save_pair(folder / f"{i:02}.npz", pair(i, depth=depth))
    return PairFolder(folder)


def short(recipe: Recipe, iterations: int) -> Recipe:
    """The recipe with other numbers of iterations."""
    return replace(recipe, iterations=iterations, fused_iterations=iterations)
