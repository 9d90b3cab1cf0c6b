"""The tracker in a made-up room, where every pose is known."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from stsem.frame import Frame
from stsem.pose import Pose, inverse
from stsem.slam.tracker import Status, Tracked, Tracker
from tests.slam.made_up_room import CAMERA, dark, frame, pose

WALK = [
    pose(-0.3 + 0.03 * i, 0.02 * np.sin(0.5 * i), -0.8 + 0.01 * i, 20 + 1.2 * i, 2 * np.sin(0.4 * i)) for i in range(16)
]


def _track(frames: list[Frame]) -> tuple[Tracker, list[Tracked]]:
    tracker = Tracker(CAMERA, 3)
    return tracker, [tracker.track(one) for one in frames]


def _errors(answers: list[Tracked], truth: list[Pose]) -> np.ndarray:  # type: ignore[type-arg]
    """(n,) metres between where the camera is said to be and where it is; all must be tracked."""
    found = [answer.T_WC for answer in answers]
    assert all(one is not None for one in found)
    return np.array([np.linalg.norm((inverse(truth[0]) @ T - F)[:3, 3]) for T, F in zip(truth, found, strict=True)])


def test_a_camera_at_rest_stays_at_rest() -> None:
    tracker, answers = _track([frame(i, WALK[0], noise=0.003) for i in range(5)])
    assert _errors(answers, [WALK[0]] * 5).max() < 0.005
    assert len(tracker.keyframes) == 1


@pytest.mark.parametrize(("noise", "most_m"), [(0.0, 0.005), (0.004, 0.01)])
def test_a_known_walk_is_found(noise: float, most_m: float) -> None:
    tracker, answers = _track([frame(i, T, noise) for i, T in enumerate(WALK)])
    assert _errors(answers, WALK).max() < most_m
    assert answers[0].status is Status.KEYFRAME
    assert len(tracker.keyframes) > 1
    for edge in tracker.edges:
        T = inverse(WALK[tracker.keyframes[edge.first].index]) @ WALK[tracker.keyframes[edge.second].index]
        np.testing.assert_allclose(edge.T, T, atol=2 * most_m)
        assert np.linalg.eigvalsh(edge.information)[0] > 0


def test_depth_images_are_kept_until_landmarks_are_settled() -> None:
    """They are the larger half of a keyframe, and a long log has thousands."""
    there = [frame(i, T) for i, T in enumerate(WALK)]
    tracker, swing = Tracker(CAMERA, 3), [*there, *there[-2:0:-1]]
    held = []
    for i in range(64):
        tracker.track(replace(swing[i % len(swing)], index=i))
        held.append({one.depth is not None for one in tracker.keyframes})
    assert held[0] == {True}
    assert held[-1] == {False}
    assert {True, False} not in held


def test_dark_frames_are_lost_with_a_reason_and_then_found_again() -> None:
    seen = [frame(i, T) for i, T in enumerate(WALK)]
    _, answers = _track([*seen[:10], *(dark(i) for i in range(10, 14)), *seen[9:]])
    assert [one.status for one in answers[10:14]] == [Status.LOST] * 4
    assert all(one.T_WC is None and one.reason for one in answers[10:14])
    assert answers[14].status is Status.RELOCALISED
    assert _errors([answers[0], *answers[14:]], [WALK[0], *WALK[9:]]).max() < 0.01


def test_a_picture_without_depth_is_followed_by_its_points() -> None:
    last = frame(3, WALK[3])
    _, answers = _track([*(frame(i, T) for i, T in enumerate(WALK[:3])), Frame(3, last.stamp_ns, last.image)])
    assert _errors(answers, WALK[:4]).max() < 0.03


def test_nothing_to_begin_with_is_lost() -> None:
    tracker, answers = _track([dark(0), frame(1, WALK[0])])
    assert [one.status for one in answers] == [Status.LOST, Status.KEYFRAME]
    assert len(tracker.keyframes) == 1


def test_same_bytes_again_and_with_other_threads() -> None:
    frames = [frame(i, T, 0.003) for i, T in enumerate(WALK[:8])]
    before = cv2.getNumThreads()
    runs = []
    for threads in (1, 2, 1):
        cv2.setNumThreads(threads)
        runs.append(np.array([one.T_WC for one in _track(frames)[1]]).tobytes())
    cv2.setNumThreads(before)
    assert runs[0] == runs[1] == runs[2]
