"""Recipes: all numbers of a training as data."""

import difflib
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from stsem.errors import UsageError

Optimiser = Literal["sgd", "adamw"]


@dataclass(frozen=True)
class Recipe:
    """Numbers of a training. The weight of auxiliary heads, 0.4, belongs to the networks (`stsem.models.pspnet`).

    Args:
        name: of the recipe, for people.
        pretrained: it presumes weights that were trained elsewhere.
        iterations, batch: how long, and how many views each.
        fused_iterations, fused_batch: the same where two trained streams are joined.
        crop: (width, height) of a view.
        scales: smallest and largest width of the whole image, as a multiple of the crop's width; with `of_image` of
            its own width.
        of_image: what `scales` refer to.
        stretch: the aspect changes by up to this factor's logarithm.
        mirror: half of the views are mirrored.
        light: views change in gain, colour balance, gamma and offset, and have grain of their own.
        still: share of views whose previous frame is the current one.
        optimiser: "sgd" with `momentum`, or "adamw".
        rate, fused_rate: largest learning rate; it falls as (1 - i / iterations) ** power (Zhao et al., section 5.1).
        power: of the fall.
        warm_up: iterations over which the rate rises from zero first, at most a tenth of all.
        momentum, decay: of SGD, and weight decay.
        new_layers: factor on the rate of layers that do not come from given weights, where there are any.
        clip: largest norm of the gradient of all weights together; 0 for any.
        freeze_norm: batch normalisation keeps the statistics that it came with, where weights were given.
        balance: class weights are share ** -balance, scaled so that their mean over pixels is 1.
        fine: the loss is taken on every `fine`-th pixel in both directions, where the network's own grid is no finer.
        average: factor of the running mean of the weights, which is what gets published; 0 for the last weights.
        checkpoint_every, report_every, validate_every: iterations between these.
    """

    name: str
    pretrained: bool
    iterations: int
    batch: int
    fused_iterations: int
    fused_batch: int
    crop: tuple[int, int]
    scales: tuple[float, float]
    of_image: bool
    stretch: float
    mirror: bool
    light: bool
    still: float
    optimiser: Optimiser
    rate: float
    fused_rate: float
    power: float
    warm_up: int
    momentum: float
    decay: float
    new_layers: float
    clip: float
    freeze_norm: bool
    balance: float
    fine: int
    average: float
    checkpoint_every: int = 100
    report_every: int = 20
    validate_every: int = 500

    def __post_init__(self) -> None:
        for name, least in _LEAST.items():
            if not getattr(self, name) >= least:
                raise UsageError(f"The recipe has {name} = {getattr(self, name)}; it must be at least {least}.")
        for name, most in _MOST.items():
            if not getattr(self, name) <= most:
                raise UsageError(f"The recipe has {name} = {getattr(self, name)}; it must be at most {most}.")
        if min(self.crop) < 1 or not 0 < self.scales[0] <= self.scales[1] < math.inf:
            raise UsageError(f"The recipe has crop = {list(self.crop)} and scales = {list(self.scales)}; "
                             "expected [width, height] and [smallest, largest], all above 0.")  # fmt: skip
        if self.optimiser not in ("sgd", "adamw"):
            raise UsageError(f"The recipe has optimiser = {self.optimiser!r}; choose 'sgd' or 'adamw'.")

    def fused(self) -> "Recipe":
        """The recipe of the stage that joins two trained streams."""
        return replace(self, iterations=self.fused_iterations, batch=self.fused_batch, rate=self.fused_rate)

    def rate_at(self, iteration: int) -> float:
        """Learning rate of an iteration, counted from 0."""
        fall: float = max(0.0, 1 - iteration / self.iterations) ** self.power
        warm_up = min(self.warm_up, self.iterations // 10)
        return self.rate * min(1.0, (iteration + 1) / max(1, warm_up)) * fall


_LEAST = {
    "iterations": 1, "batch": 1, "fused_iterations": 1, "fused_batch": 1, "fine": 1, "checkpoint_every": 1,
    "report_every": 1, "validate_every": 1, "rate": 0.0, "fused_rate": 0.0, "clip": 0.0, "average": 0.0, "warm_up": 0,
    "stretch": 0.0, "new_layers": 0.0, "balance": 0.0, "decay": 0.0, "momentum": 0.0, "power": 0.0, "still": 0.0,
}  # fmt: skip
_MOST = {"momentum": 1.0, "average": 1.0, "still": 1.0, "rate": 1e300, "fused_rate": 1e300}

PAPER = Recipe(
    name="paper", pretrained=True, iterations=20_000, batch=3, fused_iterations=20_000, fused_batch=1, crop=(521, 521),
    scales=(0.5, 2.0), of_image=True, stretch=0.0, mirror=True, light=False, still=0.0, optimiser="sgd", rate=2.5e-4,
    fused_rate=1e-4, power=0.9, warm_up=0, momentum=0.9, decay=1e-4, new_layers=10.0, clip=0.0, freeze_norm=True,
    balance=0.0, fine=1, average=0.0,
)  # fmt: skip
"""Li et al. 2018, section "Training Details"; what it does not say is as in its reference PSPNet (docs/train.md)."""

SCRATCH = Recipe(
    name="scratch", pretrained=False, iterations=3_000, batch=8, fused_iterations=1_200, fused_batch=8, crop=(329, 185),
    scales=(1.0, 2.0), of_image=False, stretch=0.1, mirror=True, light=True, still=0.05, optimiser="adamw", rate=2e-3,
    fused_rate=1e-3, power=0.9, warm_up=200, momentum=0.9, decay=1e-2, new_layers=1.0, clip=5.0, freeze_norm=False,
    balance=0.3, fine=2, average=0.998,
)  # fmt: skip
"""What trains small networks without any weights to begin with (docs/training.md)."""

RECIPES: Mapping[str, Recipe] = {recipe.name: recipe for recipe in (PAPER, SCRATCH)}


def find_recipe(name: str) -> Recipe:
    """A recipe by name, or from a TOML file: `base = "scratch"` and any number that differs.

    Raises:
        UsageError: no such name or file, not TOML, or a key or value that cannot be.
    """
    if name in RECIPES:
        return RECIPES[name]
    if not name.endswith(".toml"):
        raise UsageError(f"There is no recipe {name!r}; choose {' or '.join(RECIPES)}, or give a file NAME.toml.")
    try:
        table = tomllib.loads(Path(name).read_text(encoding="utf-8"))
    except OSError as err:
        raise UsageError(f"The recipe {name} cannot be read: {err.strerror or err}.") from err
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as err:
        raise UsageError(f"The recipe {name} is not valid TOML: {err}.") from err
    base = table.pop("base", None)
    if not isinstance(base, str) or base not in RECIPES:
        raise UsageError(f"The recipe {name} has base = {base!r}; write base = {' or '.join(map(repr, RECIPES))}.")
    return replace(RECIPES[base], **{"name": Path(name).stem} | {key: _value(name, key, table[key]) for key in table})


def with_assignments(recipe: Recipe, assignments: Sequence[str]) -> Recipe:
    """A recipe changed by `KEY=VALUE`, values as in TOML: `scales=[1, 1.7]`.

    Raises:
        UsageError: one is no assignment, or a key or value cannot be.
    """
    table: dict[str, Any] = {}
    for text in assignments:
        try:
            table |= tomllib.loads(text)
        except tomllib.TOMLDecodeError as err:
            raise UsageError(f"--set takes KEY=VALUE with a value as in TOML, but {text!r} came.") from err
    return replace(recipe, **{key: _value("of the command line", key, value) for key, value in table.items()})


def _value(where: str, key: str, value: Any) -> Any:
    """`value` in the type of the recipe's field `key`."""
    known = {field.name: getattr(SCRATCH, field.name) for field in fields(Recipe)}
    if key not in known:
        near = difflib.get_close_matches(key, known, 1, 0.6)
        hint = f"did you mean {near[0]!r}?" if near else f"valid are {', '.join(sorted(known))}."
        raise UsageError(f"The recipe {where} has an unknown key {key!r}; {hint}")
    expected = known[key]
    if isinstance(expected, tuple) and isinstance(value, list) and len(value) == len(expected):
        return tuple(_value_like(where, key, one, like) for one, like in zip(value, expected, strict=True))
    return _value_like(where, key, value, expected)


def _value_like(where: str, key: str, value: Any, like: Any) -> Any:
    if type(like) is float and type(value) is int:
        return float(value)
    if type(value) is not type(like):
        raise UsageError(f"The recipe {where} has {key} = {value!r}; expected a value like {json.dumps(like)}.")
    return value
