"""Track: SLAM behind the stage, on the made-up box whose poses are known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from stsem.frame import Frame
from stsem.pose import inverse
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


def test_earlier_frames_go_where_a_loop_moves_their_keyframe() -> None:
    """T_WC now = the keyframe's pose now times what it hangs on it by."""
    T_KC, moved = pose(0.0, 0.0, 0.1), pose(3.0, 0.0, 0.0, pan_deg=90.0)
    earlier = Tracking(T_KC, (1, T_KC), (np.eye(4), np.eye(4)))
    now = Tracking(np.eye(4), (0, np.eye(4)), (np.eye(4), moved))
    np.testing.assert_allclose(now.now(earlier), moved @ T_KC)
    assert now.now(Tracking(None, None, ())) is None


def test_slam_gets_no_pose_and_no_depth_of_another_size(walk: list[Frame]) -> None:
    """Depth that is not registered to the image's pixels would be taken for other points."""
    assert fitting(walk[0], CAMERA).T_WC is None
    assert fitting(walk[0], CAMERA).depth is walk[0].depth
    small = replace(walk[0], depth=np.ones((60, 80), np.float32))
    assert fitting(small, CAMERA).depth is None
