"""What a stage may see: a frame that has arrived, and what was made of earlier ones. Truth is kept apart."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.classes import Bools, Labels
from stsem.pose import Pose
from stsem.uncertainty import Confidence, Uncertainty

Image = npt.NDArray[np.uint8]
Depth = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Frame:
    """One capture of the robot's camera.

    Args:
        index: log index: position among the colour frames of the log, by stamp.
        stamp_ns: capture stamp, as in the log.
        image: (H, W, 3) uint8 RGB, lens distortion undone; as recorded where the log does not state it, or where the
            lens is not understood (then `camera` is None).
        previous: (H, W, 3) uint8 RGB, the previous decodable colour frame of the log, taken or not; None for the first.
        depth: (H, W) float32 metres along z in the colour camera, NaN unknown; None without a depth partner.
        T_WC: (4, 4) float64, world from camera, metres, optical axes; None without a pose.
        camera: intrinsics of `image`, without distortion; None when the log has none.
    """

    index: int
    stamp_ns: int
    image: Image
    previous: Image | None = None
    depth: Depth | None = None
    T_WC: Pose | None = None
    camera: Camera | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the colour image."""
        return self.image.shape[1], self.image.shape[0]


@dataclass(frozen=True, eq=False)
class Segmentation:
    """An answer: labels for the pixels of one frame, in the ids of the log's classes.

    Args:
        labels: (H, W) uint8, NO_LABEL (255) where there is none.
        confidence: (H, W) float32 in 0..1, or None when the source states none.
        uncertainty: maps (H, W) of the network that made the labels; None where it gives none, or none was made.
        covered: (H, W) bool, of labels that were predicted: a keyframe saw this point, so far as the method can tell;
            None where nobody says, and for what came from a network.
    """

    labels: Labels
    confidence: Confidence | None = None
    uncertainty: Uncertainty | None = None
    covered: Bools | None = None
