"""Select: is this frame a keyframe? Policies are small objects; one more is one class and one table row."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from stsem.errors import UsageError
from stsem.stages.budget import BudgetPolicy
from stsem.stages.candidate import Candidate, KeyframePolicy

SHARE = 0.9
"""`coverage` without a share (docs/keyframes.md has what others cost)."""


@dataclass(frozen=True)
class PaperPolicy:
    """The paper's rule: rotation term, translation term and time of the homography against thresholds.

    The paper compares norms of the terms of H itself; the identity has norm sqrt(2), so the *deviation* from it is
    compared here, in coordinates centred and divided by the image width (DESIGN 3).

    Args:
        rotation: threshold on |H[:2,:2] - I|_F.
        translation: threshold on |H[:2,2]|, in image widths.
        time_ns: longest time between keyframes.
    """

    rotation: float
    translation: float
    time_ns: int

    needs_homography, needs_coverage = True, False

    def reason(self, candidate: Candidate) -> str | None:
        """`time`, `no homography`, `rotation`, `translation`, or None."""
        if candidate.elapsed_ns > self.time_ns:
            return "time"
        if candidate.motion is None:
            return "no homography"
        if candidate.motion.rotation > self.rotation:
            return "rotation"
        if candidate.motion.translation > self.translation:
            return "translation"
        return None


@dataclass(frozen=True)
class EveryPolicy:
    """A fixed interval in log frames.

    Args:
        interval: a keyframe when the log index is at least this far from the last keyframe's.
    """

    interval: int

    needs_homography, needs_coverage = False, False

    def reason(self, candidate: Candidate) -> str | None:
        """`interval`, or None."""
        return "interval" if candidate.index - candidate.last_index >= self.interval else None


@dataclass(frozen=True)
class CoveragePolicy:
    """A keyframe when prediction would have to guess too much of the image, or after too long a time.

    Args:
        share: least share of the pixels that keyframes must cover.
        time_ns: longest time between keyframes: what moves by itself uncovers nothing that geometry could tell.
    """

    share: float
    time_ns: int

    needs_homography, needs_coverage = False, True

    def reason(self, candidate: Candidate) -> str | None:
        """`time`, `coverage`, or None."""
        if candidate.elapsed_ns > self.time_ns:
            return "time"
        covered = candidate.coverage is None or candidate.coverage >= self.share
        return None if covered else "coverage"


@dataclass(frozen=True)
class Numbers:
    """What policies take besides the argument in their name.

    Args:
        rotation, translation, time_ns: see `PaperPolicy`; the longest time is that of `coverage`, too.
        covers: whether what the method of prediction does not cover is what it loses.
    """

    rotation: float
    translation: float
    time_ns: int
    covers: bool = True


def _paper(argument: str | None, numbers: Numbers) -> KeyframePolicy | None:
    return PaperPolicy(numbers.rotation, numbers.translation, numbers.time_ns) if argument is None else None


def _every(argument: str | None, numbers: Numbers) -> KeyframePolicy | None:
    text = argument or ""
    valid = text.isascii() and text.isdigit() and 1 <= int(text) <= 10**9
    return EveryPolicy(int(text)) if valid else None


def _coverage(argument: str | None, numbers: Numbers) -> KeyframePolicy | None:
    share = SHARE if argument is None else _number(argument)
    return None if share is None or not 0 < share <= 1 else CoveragePolicy(share, numbers.time_ns)


def _budget(argument: str | None, numbers: Numbers) -> KeyframePolicy | None:
    hz = _number(argument or "")
    return None if hz is None or not 1e-3 <= hz <= 1e3 else BudgetPolicy(hz, by_coverage=numbers.covers)


def _number(text: str) -> float | None:
    """A plain decimal number, None for anything else."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if text.isascii() and set(text) <= set("0123456789.") and math.isfinite(value) else None


POLICIES: dict[str, tuple[str, Callable[[str | None, Numbers], KeyframePolicy | None]]] = {
    "paper": ("paper", _paper),
    "every": ("every:N", _every),
    "coverage": ("coverage:SHARE", _coverage),
    "budget": ("budget:HZ", _budget),
}
"""Name -> (how it is spelled, its factory; the factory takes what stands behind the colon, None without one, and
returns None for an argument that cannot be)."""


def parse_policy(
    text: str, *, rotation: float, translation: float, time_ns: int, covers: bool = True
) -> KeyframePolicy:
    """A policy for one run, from how it is spelled; the other arguments are those of `Numbers`.

    Raises:
        UsageError: there is no such policy.
    """
    name, colon, argument = text.partition(":")
    row = POLICIES.get(name)
    numbers = Numbers(rotation, translation, time_ns, covers)
    policy = None if row is None else row[1](argument if colon else None, numbers)
    if policy is None:
        spelled = ", ".join(spelling for spelling, _ in POLICIES.values())
        raise UsageError(
            f"There is no keyframe policy {text!r}; give {spelled} (N is 1 or more; SHARE, above 0 and up to 1, may be "
            f"left out and is {SHARE:g} then; HZ is 0.001 to 1000 keyframes a second)."
        )
    return policy
