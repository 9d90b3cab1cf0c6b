"""How depth comes to lie on the pixels of colour: as it is, resized, or projected through the log's extrinsic."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stsem.camera import Camera
from stsem.frame import Depth
from stsem.geometry.register_depth import DepthRegistration
from stsem.log.calibration import Optics, Size, same_shape
from stsem.log.candidate import Candidate
from stsem.log.pixels import decode
from stsem.log.pixels.look import ImageMessage
from stsem.log.remark import Remark
from stsem.log.topicnames import ALIGNED_WORDS
from stsem.pose import Pose

REGISTERED = ("auto", "yes", "no")
SAME_POSE = 1e-6
SAME_CAMERA = 1e-3
"""Share of f and of the width by which intrinsics may differ and still be the same pixels ..."""
SAME_CAMERA_IF_CLAIMED = 0.02
"""... and when frame and size say so: two calibrations of one camera."""

Step = Callable[[Depth], Depth]
Extrinsic = Callable[[str, str], Pose | None]
"""(target frame, source frame) -> T_target_source of the log, None when it is not known."""


@dataclass(frozen=True, eq=False)
class View:
    """An image channel as registration sees it.

    Args:
        image: its topic and frame.
        size: (width, height) of its images.
        optics: of its camera.
    """

    image: Candidate
    size: Size
    optics: Optics

    @property
    def frame_id(self) -> str:
        """The frame that its camera looks along."""
        return self.image.look.frame_id

    def __str__(self) -> str:
        return f"{self.image.topic} ({self.size[0]}x{self.size[1]}, frame {self.frame_id!r})"


@dataclass(frozen=True, eq=False)
class DepthReader:
    """From a depth message to (H, W) float32 metres on the pixels of undistorted colour; NaN unknown.

    Args:
        size: (width, height) that the messages must have.
        steps: what is done to their depth, in order.
    """

    size: Size
    steps: tuple[Step, ...] = ()

    def __call__(self, message: ImageMessage) -> Depth:
        """Depth of one message.

        Raises:
            ValueError: it is no depth image of this size.
        """
        depth = decode.depth(message, self.size)
        for step in self.steps:
            depth = step(depth)
        return depth


def claims_colour_pixels(
    depth: Candidate, size: Size, color: Candidate, color_size: Size, registered: str, extrinsic: Extrinsic,
    owner: Candidate | None = None,
) -> bool:  # fmt: skip
    """Whether depth's pixels are said to be those of colour: by the user, by frame and size, or by its topic.

    Drivers that align depth give it colour's frame. A word in the topic counts in another frame only where the log does
    not say that the two cameras are apart, and the depth is not that of another camera.
    """
    if registered != "auto":
        return registered == "yes"
    aligned = bool(depth.words & ALIGNED_WORDS)
    if depth.look.frame_id == color.look.frame_id:
        return aligned or size == color_size
    if not aligned or owner is not None:
        return False
    T = extrinsic(color.look.frame_id, depth.look.frame_id)
    return T is None or _is_identity(T)


def depth_reader(
    depth: View, color: View, registered: str, extrinsic: Extrinsic, owner: Candidate | None = None
) -> tuple[DepthReader | None, list[str]]:
    """(how depth is brought onto the pixels of colour, or None where that cannot be known, warnings).

    Args:
        depth, color: the channels; the optics of depth are its own or nobody's.
        registered: "yes": depth's pixels are colour's; "no": they never are without an extrinsic; "auto".
        extrinsic: of the log.
        owner: the other camera that depth belongs to; its pixels are never taken as colour's by "auto".
    """
    claimed = claims_colour_pixels(depth.image, depth.size, color.image, color.size, registered, extrinsic, owner)
    if claimed and same_shape(depth.size, color.size) and not (registered == "auto" and _contradicted(depth, color)):
        return DepthReader(depth.size, _as_colour(depth, color, registered)), []
    if registered == "yes":
        sentence = f"{depth} cannot have the pixels of {color}, being of another shape: depth is not used."
        return None, [Remark("depth-unregistered", sentence)]
    if registered == "no" and depth.optics.track is color.optics.track:
        depth = replace(depth, optics=Optics())  # one calibration for both would be the assumption that "no" forbids
    T, missing = _extrinsic(depth, color, extrinsic)
    if T is not None and depth.optics.camera and color.optics.camera:
        return _through(depth, color, T)
    if registered == "auto" and depth.size == color.size and owner is None:
        sentence = (
            f"{depth.image.topic} is in frame {depth.frame_id!r} and colour in {color.frame_id!r}: "
            "taken as registered, being of the same size (--depth-registered yes|no)."
        )
        return DepthReader(depth.size, _as_colour(depth, color, registered)), [Remark("depth-assumed", sentence)]
    where = f"belongs to {owner.topic}, not to {color}" if owner else f"is not on the pixels of {color}"
    sentence = (
        f"{depth} {where}, and to register it the log lacks {missing}: depth is not used "
        "(record that, or say --depth-registered yes if its pixels are those of colour)."
    )
    return None, [Remark("depth-unregistered", sentence)]


def _contradicted(depth: View, color: View) -> bool:
    """Whether depth in the frame and size of colour has a calibration of its own that says otherwise (simulators)."""
    a, b = depth.optics, color.optics
    if depth.image.words & ALIGNED_WORDS or not a.camera or not b.camera or a.track is b.track:
        return False
    return not _same_pixels(a.camera, b.camera, SAME_CAMERA_IF_CLAIMED)


def _as_colour(depth: View, color: View, registered: str) -> tuple[Step, ...]:
    """Depth with the pixels of colour as sent, or of colour without distortion when its own calibration says so."""
    steps: tuple[Step, ...] = () if depth.size == color.size else (_resize_to(color.size),)
    own = depth.optics.track is not None and depth.optics.track is not color.optics.track
    if registered == "auto" and own and depth.optics.camera and depth.optics.straight:
        return steps
    return steps if color.optics.straight else (*steps, color.optics.rectifier.depth)


def _resize_to(size: Size) -> Step:
    def resize(depth: Depth) -> Depth:
        return np.asarray(cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST_EXACT), np.float32)

    return resize


def _extrinsic(depth: View, color: View, extrinsic: Extrinsic) -> tuple[Pose | None, str]:
    """(T_color_depth, what is missing to register depth)."""
    missing = [f"a usable calibration of {view.image.topic}" for view in (depth, color) if view.optics.camera is None]
    known = bool(depth.frame_id and color.frame_id)
    T = extrinsic(color.frame_id, depth.frame_id) if known else None
    if T is None:
        missing.append(
            f"a static transform between {color.frame_id!r} and {depth.frame_id!r}" if known else "frame ids of both"
        )
    return T, " and ".join(missing)


def _through(depth: View, color: View, T_color_depth: Pose) -> tuple[DepthReader, list[str]]:
    source, target = depth.optics.camera, color.optics.camera
    if source is None or target is None:
        raise ValueError("registration needs two cameras")
    steps: tuple[Step, ...] = () if depth.optics.straight else (depth.optics.rectifier.depth,)
    if _is_identity(T_color_depth) and _same_pixels(source, target, SAME_CAMERA):
        return DepthReader(depth.size, steps), []
    metres = float(np.linalg.norm(T_color_depth[:3, 3]))
    sentence = f"{depth} is registered to {color} by calibrations and transforms ({metres:.3f} m apart)."
    steps = (*steps, DepthRegistration(source, target, T_color_depth))
    said = [warning for warning in depth.optics.warnings if warning not in color.optics.warnings]
    return DepthReader(depth.size, steps), [*said, Remark("depth-registered", sentence)]


def _is_identity(T: Pose) -> bool:
    return bool(np.allclose(T, np.eye(4), rtol=0, atol=SAME_POSE))


def _same_pixels(a: Camera, b: Camera, share: float) -> bool:
    """Whether two cameras have the same size, and f and the principal point up to a share of f and of the width."""
    if (a.width, a.height) != (b.width, b.height):
        return False
    focal = max(abs(a.fx / b.fx - 1), abs(a.fy / b.fy - 1))
    return max(focal, abs(a.cx - b.cx) / a.width, abs(a.cy - b.cy) / a.width) <= share
