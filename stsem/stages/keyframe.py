"""A frame that has been through the network."""

from dataclasses import dataclass

from stsem.frame import Segmentation
from stsem.geometry.features import Features


@dataclass(frozen=True, eq=False)
class Keyframe:
    """What later frames are predicted from.

    Args:
        index: log index.
        stamp_ns: capture stamp.
        segmentation: its labels, at the size of its image.
        features: its features, for registration; None when nobody needs them.
    """

    index: int
    stamp_ns: int
    segmentation: Segmentation
    features: Features | None = None
