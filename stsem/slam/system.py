"""SLAM as one thing: frames in, poses out; loops are closed on the way, and the past is set right when they are."""

from dataclasses import dataclass, replace

import numpy as np

from stsem.camera import Camera
from stsem.frame import Frame
from stsem.pose import Pose, inverse
from stsem.slam.loops import Loops
from stsem.slam.posegraph import Edge, relax
from stsem.slam.tracker import Status, Tracked, Tracker
from stsem.slam.verify import View

MAX_ITERATIONS = 15
"""Of the graph's last round after a loop: a closed graph needs a few, and the next loop goes on from there."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A frame and where its camera was.

    Args:
        index: log index of the frame.
        stamp_ns: its capture stamp.
        T_WC: (4, 4) world from camera, metres; the world is the camera of the first keyframe.
    """

    index: int
    stamp_ns: int
    T_WC: Pose


@dataclass(frozen=True, eq=False)
class _Anchored:
    stamp_ns: int
    keyframe: int
    T_KC: Pose


class Slam:
    """Odometry, loop closing and pose graph of one RGB-D camera; each frame once, in order.

    Args:
        camera: of image and depth, without distortion.
        seed: same frames and seed, same bytes, for any number of threads.

    Attributes:
        closed: keyframes that closed a loop.
        lost: frames without a pose.
    """

    def __init__(self, camera: Camera, seed: int) -> None:
        self.closed, self.lost = 0, 0
        self._camera = camera
        self._tracker = Tracker(camera, seed)
        self._loops = Loops(seed)
        self._loop_edges: list[Edge] = []
        self._frames: dict[int, _Anchored] = {}

    def track(self, frame: Frame) -> Tracked:
        """The pose of `frame` as it is known now; T_WC is None when lost. A keyframe may close a loop first."""
        found = self._tracker.track(frame)
        if found.T_WC is None or found.keyframe is None:
            self.lost += 1
            return found
        T_KC = inverse(self._tracker.keyframes[found.keyframe].T_WC) @ found.T_WC
        self._frames[frame.index] = _Anchored(frame.stamp_ns, found.keyframe, T_KC)
        if found.status is Status.KEYFRAME and self._closes():
            return replace(found, T_WC=self._tracker.keyframes[found.keyframe].T_WC @ T_KC)
        return found

    def trajectory(self) -> tuple[Placed, ...]:
        """Every tracked frame, by the pose that its keyframe has now; frames that were lost are not in it."""
        poses = self.keyframe_poses()
        return tuple(Placed(index, one.stamp_ns, poses[one.keyframe] @ one.T_KC) for index, one in self._frames.items())

    def keyframe_poses(self) -> tuple[Pose, ...]:
        """T_WC (4, 4) of the keyframes, in order, as known now."""
        return tuple(one.T_WC for one in self._tracker.keyframes)

    def anchor(self, index: int) -> tuple[int, Pose] | None:
        """(position of the keyframe that a frame hangs on, T_KC of its camera in it), by log index; None when lost.

        It never changes: what is drawn in the axes of the keyframe stays right when a loop moves that.
        """
        found = self._frames.get(index)
        return None if found is None else (found.keyframe, found.T_KC)

    def _closes(self) -> bool:
        """Looks whether the newest keyframe closes a loop, and if so sets all keyframes right."""
        newest, poses = self._tracker.keyframes[-1], list(self.keyframe_poses())
        edges = self._loops.add(View(newest.landmarks, newest.grid, self._camera), poses)
        if not edges:
            return False
        self.closed += 1
        self._loop_edges += edges
        relaxed = relax(
            np.array(poses), [*self._tracker.edges, *self._loop_edges], max_iterations=MAX_ITERATIONS, tolerance=1e-5
        )
        self._tracker.move(list(relaxed.poses))
        return True
