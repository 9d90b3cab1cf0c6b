"""Fuse: the labelled points of keyframes, brought into the world by their poses (equation 3)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from stsem.frame import Frame, Segmentation
from stsem.mapping.anchored import AnchoredCloud
from stsem.mapping.cloud import LabelledCloud, backproject
from stsem.pose import Pose


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
        return can_fuse(frame)

    def __call__(self, frame: Frame, segmentation: Segmentation) -> None:
        """Merge the labelled points of `frame`; frames that cannot be fused are left out (ask `can_fuse`)."""
        if frame.depth is None or frame.T_WC is None or frame.camera is None:
            return
        self.cloud.add(backproject(frame.depth, segmentation.labels, frame.image, frame.camera, frame.T_WC))


@dataclass(frozen=True)
class AnchoredFuse:
    """Adds keyframes to a cloud that goes where loops move SLAM's keyframes.

    Args:
        cloud: what they are added to.
        anchor: log index -> (SLAM keyframe that the frame hangs on, T_KC of its camera in it); None when lost.
    """

    cloud: AnchoredCloud
    anchor: Callable[[int], tuple[int, Pose] | None]

    def can_fuse(self, frame: Frame) -> bool:
        """As of `Fuse`; the frame's pose is SLAM's."""
        return can_fuse(frame)

    def __call__(self, frame: Frame, segmentation: Segmentation) -> None:
        """Keep the labelled points of `frame` in the axes of its anchor."""
        anchor = self.anchor(frame.index)
        if frame.depth is None or frame.camera is None or anchor is None:
            return
        keyframe, T_KC = anchor
        self.cloud.add(keyframe, backproject(frame.depth, segmentation.labels, frame.image, frame.camera, T_KC))


def can_fuse(frame: Frame) -> bool:
    """Whether the frame has registered depth, a pose, and undistorted intrinsics."""
    if frame.depth is None or frame.T_WC is None or frame.camera is None or frame.camera.is_distorted:
        return False
    return frame.depth.shape == frame.image.shape[:2] == (frame.camera.height, frame.camera.width)
