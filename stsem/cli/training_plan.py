"""What the flags of `stsem train` ask for: stages and recipe."""

from dataclasses import dataclass, replace
from pathlib import Path

from stsem.errors import UsageError
from stsem.train.job import Stage, stages_of
from stsem.train.recipe import Recipe, find_recipe, with_assignments


@dataclass(frozen=True)
class Wanted:
    """The flags of `stsem train`, as typed."""

    data: tuple[str, ...]
    validation: tuple[str, ...]
    out: Path
    architecture: str
    weights: Path | None
    size: str | None
    classes: Path | None
    class_map: Path | None
    topics: tuple[str, ...]
    recipe: str
    stages: str | None
    iterations: int | None
    batch: int | None
    rate: float | None
    crop: str | None
    assignments: tuple[str, ...]
    seed: int
    device: str
    precision: str
    workers: int


def chosen_stages(wanted: Wanted) -> tuple[tuple[Stage, str], ...]:
    """Stage and architecture, of those that were asked for.

    Raises:
        UsageError: there is no such architecture or stage.
    """
    known = stages_of(wanted.architecture)
    if wanted.stages is None:
        return known
    names = [name.strip() for name in wanted.stages.split(",")]
    chosen = tuple(row for row in known if row[0] in names)
    if len(chosen) != len(names):
        raise UsageError(f"--stages {wanted.stages} cannot be: {wanted.architecture} has "
                         f"{', '.join(stage for stage, _ in known)}.")  # fmt: skip
    return chosen


def chosen_recipe(wanted: Wanted) -> Recipe:
    """The recipe with what the flags say; the fused stage changes in proportion.

    Raises:
        UsageError: there is no such recipe, or a number cannot be.
    """
    recipe = find_recipe(wanted.recipe)
    if wanted.iterations is not None:
        count = wanted.iterations
        fused = round(count * recipe.fused_iterations / recipe.iterations)
        recipe = replace(
            recipe, iterations=count, fused_iterations=max(1, fused),
            report_every=min(recipe.report_every, max(1, count // 20)),
            checkpoint_every=min(recipe.checkpoint_every, max(1, count // 10)),
            validate_every=min(recipe.validate_every, max(1, count // 5)),
        )  # fmt: skip
    if wanted.batch is not None:
        recipe = replace(recipe, batch=wanted.batch, fused_batch=wanted.batch)
    if wanted.rate is not None:
        recipe = replace(recipe, rate=wanted.rate, fused_rate=wanted.rate * recipe.fused_rate / recipe.rate)
    if wanted.crop is not None:
        recipe = replace(recipe, crop=parse_size(wanted.crop, "--crop"))
    return with_assignments(recipe, wanted.assignments)


def parse_size(text: str, flag: str) -> tuple[int, int]:
    """(width, height) from WIDTHxHEIGHT. Raises UsageError."""
    width, times, height = text.partition("x")
    if not (times and text.isascii() and width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise UsageError(f"{flag} takes WIDTHxHEIGHT, such as 329x185, but {text!r} came.")
    return int(width), int(height)
