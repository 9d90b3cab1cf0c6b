"""How good the poses are, and what else the source of the poses changes."""

from typing import Literal

from pydantic import Field

from stsem.document.part import Count, Number, Part, Share


class PoseSide(Part):
    """One source of poses in the table that sets them side by side."""

    pose: Literal["log", "slam"]
    """Where the poses come from."""
    used: bool = True
    """Whether this run's stages saw them; those of the other source are only compared."""
    poses: Count = 0
    """Frames that have one."""
    path_m: Number = None
    """Length of the path through them, frame by frame, in metres; a gap is crossed straight."""
    offline_miou: Share = None
    """Offline mIoU of this mode with these poses, where predictions depend on them. Fraction."""
    offline_pixel_accuracy: Share = None
    """Offline pixel accuracy, likewise. Fraction."""
    n: Count = 0
    """Frames with truth behind the scores."""


class TrajectoryScore(Part):
    """How good the poses are that the run used."""

    pose: str = "log"
    """Where the poses come from: `log` or `slam`."""
    tracked_share: Share = None
    """With `slam`, frames tracked over frames with depth; with `log`, frames with a pose over all frames. Fraction."""
    lost: Count = 0
    """Frames that SLAM was given and found no pose for."""
    relocalised: Count = 0
    """Frames that SLAM found again after it was lost."""
    keyframes: Count = 0
    """Keyframes of SLAM; they are not those that go through the network."""
    loops: Count = 0
    """Keyframes of SLAM that closed a loop."""
    ate_rmse_m: Number = None
    """Root mean square of the position error after rigid alignment without scale, metres."""
    ate_median_m: Number = None
    """Median of the same errors, metres."""
    ate_max_m: Number = None
    """Largest of the same errors, metres."""
    rpe_translation_m: Number = None
    """Root mean square translation error over one second, metres."""
    rpe_rotation_deg: Number = None
    """Root mean square rotation error over one second, degrees."""
    rpe_per_metre_translation_m: Number = None
    """Root mean square translation error over one metre of the log's path, metres."""
    rpe_per_metre_rotation_deg: Number = None
    """Root mean square rotation error over one metre of the log's path, degrees."""
    n: Count = 0
    """Poses compared: tracked frames for which the log has a pose, too."""
    n_second: Count = 0
    """Pairs of poses one second apart."""
    n_metre: Count = 0
    """Pairs of poses one metre apart."""
    sides: tuple[PoseSide, ...] = Field(default=())
    """With `slam`: the log's poses, where it has any, beside SLAM's."""
