"""Track: SLAM behind the stage, on the made-up box whose poses are known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from stsem.camera import Camera
from stsem.frame import Frame
from stsem.pose import Pose, inverse
from stsem.slam.tracker import Status, Tracked
from stsem.stages import track
from stsem.stages.track import SlamTracker, Tracking, fitting
from tests.slam.made_up_room import CAMERA, dark, frame, pose

POSES = [pose(0.05 * i, 0.0, 0.02 * i, pan_deg=1.5 * i) for i in range(6)]


@pytest.fixture(scope="module")
def walk() -> list[Frame]:
    """Six frames; each claims a pose that is wrong by ten metres."""
    wrong = np.eye(4)
    wrong[:3, 3] = 10.0
    return [replace(frame(i, T_WC), T_WC=wrong @ T_WC, camera=CAMERA) for i, T_WC in enumerate(POSES)]


@pytest.fixture(scope="module")
def tracker(walk: list[Frame]) -> SlamTracker:
    """After the walk and a covered lens."""
    made = SlamTracker(CAMERA, 0)
    for one in [*walk, dark(6)]:
        made.prepare(one)()
    return made


def test_the_way_is_found_without_the_poses_of_the_log(tracker: SlamTracker) -> None:
    """Relative to the first frame, to a centimetre; what cannot be seen is lost."""
    for i, true in enumerate(POSES):
        found = tracker.of(i)
        assert found is not None
        assert found.T_WC is not None
        assert np.abs(found.T_WC - inverse(POSES[0]) @ true)[:3, 3].max() < 0.01
    lost = tracker.of(6)
    assert lost is not None
    assert (lost.T_WC, lost.anchor, tracker.anchor(6)) == (None, None, None)
    assert tracker.of(7) is None


def test_counts_add_up(tracker: SlamTracker) -> None:
    """Every frame is tracked or lost; the trajectory holds the tracked ones."""
    counts = tracker.counts
    assert (counts.frames, counts.with_depth, counts.tracked, counts.lost) == (7, 7, 6, 1)
    assert counts.keyframes == len(tracker.keyframe_poses) >= 1
    assert [placed.index for placed in tracker.trajectory()] == list(range(6))


def test_a_frame_is_tracked_once(walk: list[Frame]) -> None:
    """Runs that share a tracker ask in turns."""
    worked: list[int] = []

    def measure(work: Callable[[], Tracking]) -> Tracking:
        worked.append(1)
        return work()

    shared = SlamTracker(CAMERA, 0, measure=measure)
    first = [shared.prepare(one)() for one in walk[:2]]
    second = [shared.prepare(one)() for one in walk[:2]]
    assert first[0] is second[0]
    assert first[1] is second[1]
    assert len(worked) == 2


def test_work_waits_where_durations_are_measured(walk: list[Frame]) -> None:
    """Nothing is done before the job; the result is the same."""
    eager, lazy = SlamTracker(CAMERA, 0), SlamTracker(CAMERA, 0, at_once=False)
    jobs = [lazy.prepare(one) for one in walk[:3]]
    assert lazy.counts.frames == 0
    for one, job in zip(walk, jobs, strict=False):
        found, same = eager.prepare(one)(), job()
        assert found.T_WC is not None
        assert same.T_WC is not None
        assert found.T_WC.tobytes() == same.T_WC.tobytes()


class LoopAtFrame3:
    """A SLAM whose only keyframe moves by 2 m along x when frame 3 closes a loop; each frame is 1 m further along z."""

    def __init__(self, camera: Camera, seed: int) -> None:
        self.closed = self.lost = 0
        self._poses = (np.eye(4),)

    def track(self, frame: Frame) -> Tracked:
        """The keyframe's pose times the way from it."""
        if frame.index == 3:
            self.closed, self._poses = 1, (pose(2.0, 0.0, 0.0), pose(2.0, 0.0, 3.0))
        _, T_KC = self.anchor(frame.index)
        return Tracked(self._poses[0] @ T_KC, Status.TRACKED, 0)

    def anchor(self, index: int) -> tuple[int, Pose]:
        """On the first keyframe."""
        return 0, pose(0.0, 0.0, float(index))

    def keyframe_poses(self) -> tuple[Pose, ...]:
        """As known now."""
        return self._poses


def test_a_loop_moves_the_pose_but_not_what_predictions_go_by(
    walk: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """T_WC jumps with the map; T_OC goes on as if nothing had happened, so that it fits the keyframes of before."""
    monkeypatch.setattr(track, "Slam", LoopAtFrame3)
    tracker = SlamTracker(CAMERA, 0)
    found = [tracker.prepare(one)() for one in walk[:5]]
    assert [one.T_WC[:3, 3].tolist() for one in found if one.T_WC is not None] == [
        [0, 0, 0], [0, 0, 1], [0, 0, 2], [2, 0, 3], [2, 0, 4]
    ]  # fmt: skip
    assert [one.T_OC[:3, 3].tolist() for one in found if one.T_OC is not None] == [[0, 0, z] for z in range(5)]


def test_slam_gets_no_pose_and_no_depth_of_another_size(walk: list[Frame]) -> None:
    """Depth that is not registered to the image's pixels would be taken for other points."""
    assert fitting(walk[0], CAMERA).T_WC is None
    assert fitting(walk[0], CAMERA).depth is walk[0].depth
    small = replace(walk[0], depth=np.ones((60, 80), np.float32))
    assert fitting(small, CAMERA).depth is None
