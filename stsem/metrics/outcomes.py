"""Outcome counts, and the conservation check: every frame of the log ends in exactly one outcome (promise P2)."""

from collections import Counter
from collections.abc import Iterable
from typing import ClassVar

from stsem.result import Outcome


def count_outcomes(outcomes: Iterable[Outcome], frames: int) -> dict[Outcome, int]:
    """How many frames ended how: every outcome is a key, in the order of `Outcome`.

    Args:
        outcomes: of every frame that ended.
        frames: in the log, or in the chosen window.

    Raises:
        ValueError: they do not sum to `frames`: a frame was lost or counted twice.
    """
    found = Counter(outcomes)
    if found.total() != frames:
        words = ", ".join(f"{found[outcome]} {outcome}" for outcome in Outcome if found[outcome]) or "none"
        lost = frames - found.total()
        what = f"{lost} without an outcome" if lost > 0 else f"{-lost} counted twice"
        raise ValueError(f"the log has {frames} frames, but {found.total()} outcomes came ({words}): {what}")
    return {outcome: found[outcome] for outcome in Outcome}


class OutcomeCounter:
    """Accumulates outcomes frame by frame.

    Args:
        frames: in the log, or in the chosen window.
    """

    unit: ClassVar[str] = "frames"
    higher_is_better: ClassVar[None] = None

    def __init__(self, frames: int) -> None:
        self._frames = frames
        self._ended: dict[int, Outcome] = {}

    def update(self, index: int, outcome: Outcome) -> None:
        """Frame `index` has ended.

        Raises:
            ValueError: it had ended before.
        """
        if index in self._ended:
            raise ValueError(f"frame {index} ended as {self._ended[index]} and again as {outcome}")
        self._ended[index] = outcome

    def compute(self) -> dict[Outcome, int]:
        """The counts; raises like `count_outcomes`."""
        return count_outcomes(self._ended.values(), self._frames)
