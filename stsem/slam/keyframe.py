"""What odometry keeps of the frames it measures others against."""

from dataclasses import dataclass

import numpy as np

from stsem.frame import Depth
from stsem.pose import Pose
from stsem.slam.align import Reference
from stsem.slam.landmarks import Landmarks
from stsem.slam.planes import PlaneGrid


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A frame that others are tracked against.

    Args:
        index: log index of the frame.
        stamp_ns: its capture stamp.
        T_WC: (4, 4), the world being the camera of the first keyframe.
        landmarks: points, descriptors, and places in the camera.
        depth: (H, W) float32 metres, as it came, by which landmarks may be placed anew; None when they never will be.
        grid: planes of the surface, to which later frames add what they see.
    """

    index: int
    stamp_ns: int
    T_WC: Pose
    landmarks: Landmarks
    depth: Depth | None
    grid: PlaneGrid

    @property
    def reference(self) -> Reference:
        """What depth is aligned to."""
        return Reference(self.T_WC, self.grid)


def is_far(T_KC: Pose, *, max_translation_m: float, max_rotation_deg: float) -> bool:
    """Whether a camera has left its keyframe by more than either limit."""
    cosine = np.clip((np.trace(T_KC[:3, :3]) - 1) / 2, -1, 1)
    return bool(np.linalg.norm(T_KC[:3, 3]) > max_translation_m or np.degrees(np.arccos(cosine)) > max_rotation_deg)
