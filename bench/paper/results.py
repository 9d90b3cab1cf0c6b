"""Results of the cells of one data set, and the numbers that tables are made of."""

import json
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.paper.statistics import Comparison, Spread, compare, spread
from stsem.metrics.scores import Scores, scores

Result = Mapping[str, Any]
Measure = Callable[[Scores], float]


def miou(found: Scores) -> float:
    """Per cent."""
    return 100 * found.miou


def accuracy(found: Scores) -> float:
    """Pixel accuracy, per cent."""
    return 100 * found.pixel_accuracy


@dataclass(frozen=True)
class Results:
    """What has been measured.

    Args:
        classes: names, in the order of the matrices.
        of: (network, dose) -> seed -> result.
    """

    classes: tuple[str, ...]
    of: Mapping[tuple[str, str], Mapping[int, Result]]

    def values(self, network: str, dose: str, measure: Measure = miou) -> dict[int, float]:
        """Seed -> value; empty for a network without results."""
        found = self.of.get((network, dose), {})
        return {seed: measure(scores(np.array(result["matrix"], np.int64))) for seed, result in found.items()}

    def spread(self, network: str, dose: str = "right", measure: Measure = miou) -> Spread | None:
        """Over seeds; None without results."""
        values = self.values(network, dose, measure)
        return spread(list(values.values())) if values else None

    def class_means(self, network: str, dose: str = "right", seeds: Collection[int] | None = None) -> list[float]:
        """IoU of each class in per cent, mean over seeds (None: all); NaN for a class without truth; empty without
        results."""
        found = [result for seed, result in self.of.get((network, dose), {}).items() if seeds is None or seed in seeds]
        if not found:
            return []
        iou = np.array([scores(np.array(result["matrix"], np.int64)).iou for result in found])
        return [float(value) for value in 100 * iou.mean(0)]

    def comparison(self, a: tuple[str, str], b: tuple[str, str]) -> Comparison | None:
        """mIoU of A less that of B, each (network, dose); None where they share no seed."""
        return _compared(self.values(*a), self.values(*b))

    def robustness(self, a: str, b: str, dose: str) -> Comparison | None:
        """What B loses to wrong labels less what A loses: positive if A is the more robust one."""
        return _compared(self._loss(b, dose), self._loss(a, dose))

    def _loss(self, network: str, dose: str) -> dict[int, float]:
        right, wrong = self.values(network, "right"), self.values(network, dose)
        return {seed: right[seed] - wrong[seed] for seed in right.keys() & wrong.keys()}

    def neighbour(self, network: str, dose: str) -> tuple[float, float] | None:
        """Per cent of the neighbour's floor called floor, and lamp, mean over seeds; None without results, or without a
        neighbour."""
        found = [result["neighbour"] for result in self.of.get((network, dose), {}).values()]
        if not found or found[0] is None:
            return None
        parts = np.array([[n["called_floor"], n["called_lamp"]] for n in found]) / found[0]["floor_pixels"]
        floor, lamp = 100 * parts.mean(0)
        return float(floor), float(lamp)


def _compared(a: Mapping[int, float], b: Mapping[int, float]) -> Comparison | None:
    return compare(a, b) if a.keys() & b.keys() else None


def load(folder: Path) -> list[Result]:
    """All results in a folder, in order of their names."""
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))]


def collect(found: list[Result]) -> Results:
    """Results by network, dose and seed. Raises ValueError without any, or when they are of different data."""
    if len({json.dumps([result["data_sha256"], result["classes"]]) for result in found}) != 1:
        raise ValueError("results of one data set are needed, but there are none, or of several")
    of: dict[tuple[str, str], dict[int, Result]] = {}
    for result in found:
        of.setdefault((result["network"], result["dose"]), {})[result["seed"]] = result
    return Results(tuple(found[0]["classes"]), of)
