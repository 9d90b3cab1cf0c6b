"""A stage of a training: what is trained, and with which numbers."""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from stsem.inference.sidecar import Sidecar, render
from stsem.models.zoo import find
from stsem.train.recipe import Recipe

Stage = Literal["colour", "difference", "fused"]
_WITHOUT_EFFECT = ("name", "checkpoint_every", "report_every", "validate_every", "pretrained", "fused_iterations",
                   "fused_batch", "fused_rate")  # fmt: skip
"""Of a stage's recipe: they do not change its weights, or have been put in the place of others."""


@dataclass(frozen=True)
class Machine:
    """What a training runs on. All of it helps to decide the weights to the last bit.

    Args:
        device: "cpu", or "cuda" for a GPU, where weights repeat up to rounding only.
        workers: threads that each take a part of the batch through a replica of the network. On a busy machine this
            beats threads inside the operators, which wait for each other at every one of them. Batch normalisation
            sees a worker's part.
        threads: inside the operators, of each worker.
        bf16: convolutions in bfloat16.
    """

    device: str = "cpu"
    workers: int = 2
    threads: int = 1
    bf16: bool = False


@dataclass(frozen=True)
class Job:
    """One stage.

    Args:
        architecture: name in the zoo of what is trained at this stage: `pspnet-r18-temporal-w2` in stage "difference".
        stage: "colour" for whatever is trained by itself, "difference", or "fused" for two streams together.
        sidecar: how inputs are formed, and the classes; its size is that at which validation images are judged.
        recipe: of the whole training; see `numbers`.
        seed: of every draw.
        starts: weights to begin with: "weights" for a file from elsewhere, "colour" and "difference" for checkpoints of
            the stages before.
        machine: what it runs on.
    """

    architecture: str
    stage: Stage
    sidecar: Sidecar
    recipe: Recipe
    seed: int = 0
    starts: Mapping[str, Path] = field(default_factory=dict)
    machine: Machine = Machine()

    @property
    def numbers(self) -> Recipe:
        """The recipe of this stage: where two trained streams are joined, with its `fused_` numbers."""
        joined = self.stage == "fused" and {"colour", "difference"} <= self.starts.keys()
        return self.recipe.fused() if joined else self.recipe

    def identity(self) -> dict[str, Any]:
        """What decides the weights, beside the data and the weights to begin with, as plain values."""
        numbers = {key: value for key, value in asdict(self.numbers).items() if key not in _WITHOUT_EFFECT}
        return {
            "architecture": self.architecture, "stage": self.stage, "seed": self.seed,
            "recipe": ", ".join(f"{key} {value}" for key, value in numbers.items()),
            "inputs": render(replace(self.sidecar, size=(1, 1), note="")), "machine": asdict(self.machine),
        }  # fmt: skip


_TWO_STREAMS = re.compile(r"(pspnet-r\d+)(?:-(?:sum|max|feature-sum|feature-concat))?(-7x7)?((?:-w\d+){0,2})")


def stages_of(architecture: str) -> tuple[tuple[Stage, str], ...]:
    """Stage and architecture of everything that has to be trained for `architecture`, in order.

    Raises:
        UsageError: there is no such architecture.
    """
    find(architecture)
    match = _TWO_STREAMS.fullmatch(architecture)
    if match is None:
        return (("difference" if "-temporal" in architecture else "colour", architecture),)
    base, stem, widths = match[1], match[2] or "", match[3].split("-w")[1:]
    colour, difference = (f"-w{width}" if width else "" for width in (*widths, *widths, "", "")[:2])
    return (
        ("colour", f"{base}-spatial{stem}{colour}"), ("difference", f"{base}-temporal{stem}{difference}"),
        ("fused", architecture),
    )  # fmt: skip
