"""Track: where the camera is, from its images and depth alone. Knows no labels and no pose of the log."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from stsem.camera import Camera
from stsem.frame import Frame
from stsem.pose import Pose, inverse
from stsem.slam.system import Placed, Slam
from stsem.slam.tracker import Status


@dataclass(frozen=True, eq=False)
class Tracking:
    """What is known of a frame's pose when it has been tracked.

    Args:
        T_WC: (4, 4) world from camera, metres, the world being the camera of SLAM's first keyframe; None when lost.
        T_OC: the same in a world that no loop moves: it drifts, but fits the frames just before, whose poses are not
            corrected either. What is predicted from them goes by it.
        anchor: (SLAM keyframe that it hangs on, T_KC of its camera in it), which no loop changes; None when lost.
    """

    T_WC: Pose | None
    T_OC: Pose | None
    anchor: tuple[int, Pose] | None


@dataclass(frozen=True)
class Counts:
    """How tracking went.

    Args:
        frames: given to SLAM.
        with_depth: of them, frames that have depth.
        tracked: of those with depth, frames that got a pose.
        lost: frames without a pose, whether or not they have depth.
        relocalised: frames found again after being lost.
        keyframes: SLAM keyframes.
        loops: keyframes that closed a loop.
    """

    frames: int
    with_depth: int
    tracked: int
    lost: int
    relocalised: int
    keyframes: int
    loops: int


class Tracker(Protocol):
    """Follows the camera through the frames of a log: each once, in log order."""

    def prepare(self, frame: Frame) -> Callable[[], Tracking]:
        """Take in the next frame; its tracking comes from calling what is returned, in the same order."""

    def of(self, index: int) -> Tracking | None:
        """What has been found for a frame; None before it is tracked."""


class SlamTracker:
    """Tracks by SLAM.

    Args:
        camera: of image and depth, without distortion.
        seed: of the run.
        at_once: a frame is tracked when it is prepared, and what is returned only hands the result over. Several runs
            that prepare the same frames then share the work.
        measure: does the work, and may time it.
    """

    def __init__(
        self,
        camera: Camera,
        seed: int,
        *,
        at_once: bool = True,
        measure: Callable[[Callable[[], Tracking]], Tracking] = lambda work: work(),
    ) -> None:
        self._camera, self._at_once, self._measure = camera, at_once, measure
        self._slam = Slam(camera, seed)
        self._found: dict[int, Tracking] = {}
        self._T_OW: Pose = np.eye(4)
        self._last: int | None = None
        self._with_depth = self._tracked = self._relocalised = 0

    def prepare(self, frame: Frame) -> Callable[[], Tracking]:
        """See `Tracker.prepare`."""
        if not self._at_once:
            return lambda: self._once(frame)
        found = self._once(frame)
        return lambda: found

    def of(self, index: int) -> Tracking | None:
        """See `Tracker.of`."""
        return self._found.get(index)

    def anchor(self, index: int) -> tuple[int, Pose] | None:
        """(SLAM keyframe that a frame hangs on, T_KC of its camera in it); None when lost, or not tracked yet."""
        found = self._found.get(index)
        return None if found is None else found.anchor

    @property
    def counts(self) -> Counts:
        """So far."""
        return Counts(
            len(self._found), self._with_depth, self._tracked, self._slam.lost, self._relocalised,
            len(self._slam.keyframe_poses()), self._slam.closed,
        )  # fmt: skip

    @property
    def keyframe_poses(self) -> tuple[Pose, ...]:
        """T_WC (4, 4) of SLAM's keyframes as known now: what anchors are placed by in the end."""
        return self._slam.keyframe_poses()

    def trajectory(self) -> tuple[Placed, ...]:
        """Every tracked frame with its pose as known now, by log index."""
        return tuple(sorted(self._slam.trajectory(), key=lambda placed: placed.index))

    def _once(self, frame: Frame) -> Tracking:
        if frame.index not in self._found:
            seen = fitting(frame, self._camera)
            self._found[frame.index] = self._measure(lambda: self._track(seen))
        return self._found[frame.index]

    def _track(self, frame: Frame) -> Tracking:
        closed, before = self._slam.closed, self._slam.keyframe_poses()
        found = self._slam.track(frame)
        if self._slam.closed != closed and self._last is not None:
            self._T_OW = self._T_OW @ before[self._last] @ inverse(self._slam.keyframe_poses()[self._last])
        self._with_depth += frame.depth is not None
        self._tracked += frame.depth is not None and found.T_WC is not None
        self._relocalised += found.status is Status.RELOCALISED
        if found.T_WC is None:
            return Tracking(None, None, None)
        anchor = self._slam.anchor(frame.index)
        self._last = None if anchor is None else anchor[0]
        return Tracking(found.T_WC, self._T_OW @ found.T_WC, anchor)


def fitting(frame: Frame, camera: Camera) -> Frame:
    """The frame without its pose, and without depth that is not of the camera's size."""
    fits = frame.depth is not None and frame.depth.shape == (camera.height, camera.width)
    return replace(frame, T_WC=None, depth=frame.depth if fits else None, previous=None)
