"""What every backend gives: a session that runs, and a description of what goes in and comes out."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from stsem.inference.preprocess import Tensor


@dataclass(frozen=True)
class Port:
    """One input or output of a graph; a side that the file leaves open is None."""

    name: str
    type: str
    shape: tuple[int | None, ...]


@dataclass(frozen=True)
class Signature:
    """What goes into a graph, what comes out, and the metadata that its maker left in the file."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    metadata: Mapping[str, str]


class Session(Protocol):
    """A network that is ready to run."""

    def run(self, outputs: list[str], inputs: Mapping[str, Tensor]) -> list[np.ndarray[Any, Any]]:
        """Values of the named outputs. Raises NetworkError when the graph fails."""


def first_line(err: BaseException) -> str:
    """Of a library's message, for a sentence of ours."""
    lines = str(err).strip().splitlines()
    return lines[0] if lines else type(err).__name__
