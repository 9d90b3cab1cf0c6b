"""Register: how the last selected keyframe maps onto this frame (equation 2)."""

from dataclasses import dataclass
from typing import Protocol

from stsem import chance
from stsem.frame import Frame
from stsem.geometry.features import Features, extract
from stsem.geometry.homography import Homography, estimate


@dataclass(frozen=True, eq=False)
class Registration:
    """Args:
    features: of this frame, kept in case it becomes a keyframe.
    homography: keyframe pixels to this frame's; None for the first frame, or if none can be trusted.
    """

    features: Features
    homography: Homography | None


class Registering(Protocol):
    """Registers a frame to a keyframe."""

    def __call__(self, frame: Frame, keyframe: Features | None, keyframe_index: int | None) -> Registration:
        """Features of `frame` and, if there is a keyframe, its homography to `frame`."""


@dataclass(frozen=True)
class Register:
    """Registers frames to a keyframe by ORB features and a robust homography.

    Args:
        seed: of the robust estimation; each pair of frames draws for itself, so call order is irrelevant.
    """

    seed: int

    def __call__(self, frame: Frame, keyframe: Features | None, keyframe_index: int | None) -> Registration:
        """Features of `frame` and, if there is a keyframe, its homography to `frame`."""
        features = extract(frame.image)
        if keyframe is None or keyframe_index is None:
            return Registration(features, None)
        return Registration(
            features, estimate(keyframe, features, seed=pair_seed(self.seed, keyframe_index, frame.index))
        )


def pair_seed(seed: int, keyframe_index: int, index: int) -> int:
    """Seed of the robust estimation between two frames, from the run's: each pair draws for itself."""
    return chance.hash31(seed, "register", keyframe_index, index)
