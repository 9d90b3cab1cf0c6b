"""Select: is this frame a keyframe? Policies are small objects; one more is one class and one table row."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from stsem.errors import UsageError
from stsem.geometry.homography import Homography, normalised, rotation_deviation, translation_norm


@dataclass(frozen=True)
class Motion:
    """How far the image moved since a keyframe, by the terms of its homography (DESIGN 3).

    Args:
        rotation: |H[:2,:2] - I|_F.
        translation: |H[:2,2]|, in image widths.
    """

    rotation: float
    translation: float

    @classmethod
    def of(cls, homography: Homography, size: tuple[int, int]) -> "Motion":
        """The motion that `homography` shows on images of `size` (width, height)."""
        H = normalised(homography.H, *size)
        return cls(rotation_deviation(H), translation_norm(H))


@dataclass(frozen=True)
class Candidate:
    """What a policy may look at.

    Args:
        index: log index of the frame in question.
        last_index: log index of the last selected keyframe.
        elapsed_ns: capture time since that keyframe.
        motion: since that keyframe; None if there is no trustworthy homography, or nobody asked for it.
    """

    index: int
    last_index: int
    elapsed_ns: int
    motion: Motion | None


class KeyframePolicy(Protocol):
    """Decides which frames go through the network. The first frame is always a keyframe and never asked about."""

    @property
    def needs_homography(self) -> bool:
        """Whether `Candidate.motion` must be known."""

    def reason(self, candidate: Candidate) -> str | None:
        """Why this frame must be a keyframe, in a word or two; None if it need not be."""


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

    needs_homography = True

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

    needs_homography = False

    def reason(self, candidate: Candidate) -> str | None:
        """`interval`, or None."""
        return "interval" if candidate.index - candidate.last_index >= self.interval else None


def _paper(argument: str, rotation: float, translation: float, time_ns: int) -> KeyframePolicy | None:
    return None if argument else PaperPolicy(rotation, translation, time_ns)


def _every(argument: str, rotation: float, translation: float, time_ns: int) -> KeyframePolicy | None:
    valid = argument.isascii() and argument.isdigit() and 1 <= int(argument) <= 10**9
    return EveryPolicy(int(argument)) if valid else None


POLICIES: dict[str, tuple[str, Callable[[str, float, float, int], KeyframePolicy | None]]] = {
    "paper": ("paper", _paper),
    "every": ("every:N", _every),
}
"""Name -> (how it is spelled, its factory; the factory returns None for an argument that cannot be)."""


def parse_policy(text: str, *, rotation: float, translation: float, time_ns: int) -> KeyframePolicy:
    """The policy for `paper` or `every:N`; the numbers are the paper rule's thresholds.

    Raises:
        UsageError: there is no such policy.
    """
    name, _, argument = text.partition(":")
    row = POLICIES.get(name)
    policy = None if row is None else row[1](argument, rotation, translation, time_ns)
    if policy is None:
        spelled = ", ".join(spelling for spelling, _ in POLICIES.values())
        raise UsageError(f"There is no keyframe policy {text!r}; give {spelled} (N is 1 or more).")
    return policy
