"""A frame that has been through the network."""

from dataclasses import dataclass

from stsem.frame import Frame, Image, Segmentation
from stsem.geometry.features import Features
from stsem.geometry.reproject import View


@dataclass(frozen=True, eq=False)
class Keyframe:
    """What later frames are predicted from.

    Args:
        index: log index.
        stamp_ns: capture stamp.
        segmentation: its labels, at the size of its image.
        features: of its image; None if nobody looks at any.
        view: where its pixels are in space; None without depth, pose or camera.
        image: (H, W, 3) uint8 RGB; None if nobody looks at it.
    """

    index: int
    stamp_ns: int
    segmentation: Segmentation
    features: Features | None = None
    view: View | None = None
    image: Image | None = None


def view_of(frame: Frame) -> View | None:
    """Where the pixels of `frame` are in space; None without registered depth, a pose, or a camera without distortion.

    A `View` is of the size of the frame's image.
    """
    depth, camera = frame.depth, frame.camera
    if depth is None or frame.T_WC is None or camera is None or camera.is_distorted:
        return None
    if depth.shape != frame.image.shape[:2] or depth.shape != (camera.height, camera.width):
        return None
    return View(depth, frame.T_WC, camera)
