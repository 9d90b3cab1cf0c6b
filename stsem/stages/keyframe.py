"""A frame that has been through the network."""

from dataclasses import dataclass

from stsem.frame import Segmentation


@dataclass(frozen=True, eq=False)
class Keyframe:
    """What later frames are predicted from.

    Args:
        index: log index.
        stamp_ns: capture stamp.
        segmentation: its labels, at the size of its image.
    """

    index: int
    stamp_ns: int
    segmentation: Segmentation
