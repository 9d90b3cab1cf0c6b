"""Register: what relates this frame to those before it: points, homographies (equation 2), and what a method follows.

A frame is registered to the last selected keyframe if the policy tells from it how far the image moved, and to the one
that its labels would come from if the method warps them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from stsem import chance
from stsem.frame import Frame
from stsem.geometry.features import Features, extract
from stsem.geometry.homography import Homography, estimate


@dataclass(frozen=True, eq=False)
class Anchor:
    """A keyframe to register to: its log index and the points of its image."""

    index: int
    features: Features


@dataclass(frozen=True, eq=False)
class Registration:
    """What relates a frame to those before it.

    Args:
        features: of this frame, kept in case it becomes a keyframe; None if nobody looks at any.
        homographies: log index of a keyframe -> its pixels to this frame's; None if none can be trusted.
        coverage: share of the pixels that keyframes cover, foretold; None if nobody asks or knows.
    """

    features: Features | None = None
    homographies: Mapping[int, Homography | None] = field(default_factory=dict)
    coverage: float | None = None


class Registering(Protocol):
    """Registers a frame to keyframes."""

    def __call__(self, frame: Frame, anchors: Sequence[Anchor]) -> Registration:
        """Features of `frame`, and the homography to it from each of the `anchors`."""


class Follower(Protocol):
    """Whoever must see every frame that is taken."""

    def see(self, frame: Frame, registration: Registration) -> None:
        """The next frame taken."""


class Foreteller(Protocol):
    """Whoever knows how much of a frame keyframes cover."""

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        """The share, 0..1, of the frame taken last; None if it cannot tell."""


@dataclass(frozen=True, eq=False)
class Register:
    """Registers frames by ORB features and robust homographies, and shows them to who follows the image.

    Args:
        seed: of the robust estimation; each pair of frames draws for itself, so call order is irrelevant.
        points: whether anybody looks at features and homographies.
        follower: sees every frame; None if nobody does.
        foreteller: tells the coverage of every frame; None if nobody asks.
    """

    seed: int
    points: bool = True
    follower: Follower | None = None
    foreteller: Foreteller | None = None

    def __call__(self, frame: Frame, anchors: Sequence[Anchor]) -> Registration:
        """Features of `frame`, and the homography to it from each of the `anchors`."""
        registration = self._registered(frame, anchors) if self.points else Registration()
        if self.follower is not None:
            self.follower.see(frame, registration)
        if self.foreteller is not None:
            registration = replace(registration, coverage=self.foreteller.expected_coverage(frame, registration))
        return registration

    def _registered(self, frame: Frame, anchors: Sequence[Anchor]) -> Registration:
        features = extract(frame.image)
        return Registration(features, {a.index: between(a, frame.index, features, self.seed) for a in anchors})


def between(anchor: Anchor, index: int, features: Features, seed: int) -> Homography | None:
    """The homography from `anchor` to the frame `index` with `features`; None if none can be trusted."""
    return estimate(anchor.features, features, seed=pair_seed(seed, anchor.index, index))


def pair_seed(seed: int, keyframe_index: int, index: int) -> int:
    """Seed of the robust estimation between two frames, from the run's: each pair draws for itself."""
    return chance.hash31(seed, "register", keyframe_index, index)
