"""What a keyframe policy may look at, and what it answers."""

from dataclasses import dataclass
from typing import Protocol

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
    """A frame that may become a keyframe.

    Args:
        index: its log index.
        stamp_ns: its capture stamp.
        last_index: log index of the last selected keyframe, finished or not.
        elapsed_ns: capture time since that keyframe.
        motion: since that keyframe; None if there is no trustworthy homography, or nobody asked for it.
        coverage: share of its pixels that keyframes cover, 0..1; None if the method cannot tell, or nobody asked.
    """

    index: int
    stamp_ns: int
    last_index: int
    elapsed_ns: int
    motion: Motion | None
    coverage: float | None = None


class KeyframePolicy(Protocol):
    """Decides which frames go through the network. The first frame is always a keyframe and never asked about.

    A policy may remember what it saw, so each run has its own; it is asked about each taken frame in order of capture,
    except while a choice waits for a frame that can be segmented.
    """

    @property
    def needs_homography(self) -> bool:
        """Whether `Candidate.motion` must be known."""

    @property
    def needs_coverage(self) -> bool:
        """Whether `Candidate.coverage` must be known."""

    def reason(self, candidate: Candidate) -> str | None:
        """Why this frame must be a keyframe, in a word or two; None if it need not be."""
