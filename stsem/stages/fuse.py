"""Fuse: the labelled points of keyframes, brought into the world by their poses (equation 3)."""

from dataclasses import dataclass
from typing import Protocol

from stsem.frame import Frame, Segmentation
from stsem.mapping.cloud import LabelledCloud, backproject


class Fuser(Protocol):
    """What stands beside the answer path and takes in keyframes."""

    def can_fuse(self, frame: Frame) -> bool:
        """Whether the frame has what it needs."""

    def __call__(self, frame: Frame, segmentation: Segmentation) -> None:
        """Take in a keyframe."""


@dataclass(frozen=True)
class Fuse:
    """Adds keyframes to a cloud.

    Args:
        cloud: what they are added to.
    """

    cloud: LabelledCloud

    def can_fuse(self, frame: Frame) -> bool:
        """Whether the frame has what equation 3 needs: registered depth, a pose, and undistorted intrinsics."""
        if frame.depth is None or frame.T_WC is None or frame.camera is None or frame.camera.is_distorted:
            return False
        return frame.depth.shape == frame.image.shape[:2] == (frame.camera.height, frame.camera.width)

    def __call__(self, frame: Frame, segmentation: Segmentation) -> None:
        """Merge the labelled points of `frame`; frames that cannot be fused are left out (ask `can_fuse`)."""
        if frame.depth is None or frame.T_WC is None or frame.camera is None:
            return
        self.cloud.add(backproject(frame.depth, segmentation.labels, frame.image, frame.camera, frame.T_WC))
