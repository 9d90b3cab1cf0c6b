"""SLAM as a whole in a made-up room: a turn, frames that cannot be used, and the same bytes again."""

import cv2
import numpy as np
import pytest
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from stsem.camera import Camera
from stsem.frame import Frame
from stsem.pose import Pose, inverse
from stsem.slam import loops
from stsem.slam.system import Slam
from stsem.slam.tracker import Status, Tracked
from tests.slam.made_up_room import CAMERA, dark, frame, pose

ROUND = [pose(0.3 * np.sin(np.radians(10 * i)), 0.0, 0.3 * np.cos(np.radians(10 * i)), 10 * i, 25) for i in range(38)]
TURN = [pose(0.3 * np.sin(np.radians(12 * i)), 0.0, 0.2 * np.cos(np.radians(12 * i)), 12 * i) for i in range(12)]


def _run(frames: list[Frame]) -> tuple[Slam, list[Tracked]]:
    slam = Slam(CAMERA, 0)
    return slam, [slam.track(one) for one in frames]


def _off(slam: Slam, truth: list[Pose]) -> float:
    return max(
        float(np.linalg.norm((inverse(inverse(truth[0]) @ truth[one.index]) @ one.T_WC)[:3, 3]))
        for one in slam.trajectory()
    )


def test_a_turn_is_followed_and_its_frames_hang_on_keyframes() -> None:
    slam, answers = _run([frame(i, T, 0.001) for i, T in enumerate(TURN[:8])])
    assert slam.lost == 0
    assert _off(slam, TURN) < 0.02
    poses = slam.keyframe_poses()
    for one in slam.trajectory():
        anchor = slam.anchor(one.index)
        assert anchor is not None
        np.testing.assert_allclose(poses[anchor[0]] @ anchor[1], one.T_WC, atol=1e-12)
    assert answers[-1].T_WC is not None


def test_a_loop_is_closed_and_sets_right_what_was_drawn_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once around: the loop brings the end back to the start, and moves the frames before it too."""
    frames = [frame(i, T, 0.001) for i, T in enumerate(ROUND)]
    closed, answers = _run(frames)
    monkeypatch.setattr(loops, "MIN_KEYFRAMES_BETWEEN", len(frames))
    opened, unaided = _run(frames)
    assert (closed.closed, opened.closed, closed.lost) == (1, 0, 0)
    assert _error(answers[-1].T_WC, 37) < 0.01 < _error(unaided[-1].T_WC, 37)
    before = [one for one in closed.trajectory() if 20 <= one.index < 33]
    for one, live in zip(before, answers[20:33], strict=True):
        assert _error(one.T_WC, one.index) < _error(live.T_WC, one.index)


def _error(T_WC: Pose | None, index: int) -> float:
    assert T_WC is not None
    return float(np.linalg.norm((inverse(inverse(ROUND[0]) @ ROUND[index]) @ T_WC)[:3, 3]))


def test_black_frames_are_lost_and_left_out_and_the_place_is_found_again() -> None:
    seen = [frame(i, T) for i, T in enumerate(TURN[:8])]
    back = [Frame(12 + k, one.stamp_ns, one.image, depth=one.depth) for k, one in enumerate(seen[5:])]
    slam, answers = _run([*seen, *(dark(i) for i in range(8, 12)), *back])
    assert slam.lost == 4
    assert slam.anchor(9) is None
    assert answers[12].status is Status.RELOCALISED
    assert [one.index for one in slam.trajectory()] == [*range(8), 12, 13, 14]
    assert _off(slam, [*TURN[:12], *TURN[5:8]]) < 0.02


def test_same_bytes_again_and_with_other_threads() -> None:
    frames, before, runs = [frame(i, T, 0.003) for i, T in enumerate(TURN[:5])], cv2.getNumThreads(), []
    for threads in (1, 2):
        cv2.setNumThreads(threads)
        with threadpool_limits(threads):
            runs.append(np.array([one.T_WC for one in _run(frames)[0].trajectory()]).tobytes())
    cv2.setNumThreads(before)
    assert runs[0] == runs[1]


@pytest.mark.parametrize("size", [(320, 240), (8, 6), (1, 1)])
def test_constant_tiny_and_depthless_images_are_reported(size: tuple[int, int]) -> None:
    width, height = size
    camera = Camera(width, height, 200.0, 200.0, (width - 1) / 2, (height - 1) / 2)
    grey = np.full((height, width, 3), 128, np.uint8)
    slam = Slam(camera, 0)
    for i, depth in enumerate([None, np.full((height, width), 2, np.float32), np.full((height, width), np.nan)] * 2):
        found = slam.track(Frame(i, i, grey, depth=None if depth is None else depth.astype(np.float32)))
        assert found.T_WC is not None or found.reason


def test_an_image_that_is_not_the_cameras_is_lost_with_a_reason() -> None:
    found = Slam(CAMERA, 0).track(Frame(0, 0, np.zeros((10, 10, 3), np.uint8), depth=np.ones((10, 10), np.float32)))
    assert found.T_WC is None
    assert "10x10" in found.reason
