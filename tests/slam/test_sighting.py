"""Points in the least squares of depth, and the ratio of focal lengths of colour and depth."""

import numpy as np

from stsem.camera import Camera
from stsem.pose import Pose
from stsem.slam.align import moved
from stsem.slam.sighting import Sighting
from stsem.slam.zoom import ENOUGH, Zoom

CAMERA = Camera(640, 480, 500.0, 510.0, 319.5, 239.5)


def _seen(T_WC: Pose, seed: int, *, noise_px: float = 0.5, wrong: int = 0, shift_px: float = 0.0) -> Sighting:
    rng = np.random.default_rng(seed)
    p = np.column_stack([rng.uniform(-1.5, 1.5, 150), rng.uniform(-1, 1, 150), rng.uniform(2, 5, 150)])
    xy = p[:, :2] / p[:, 2:] * [CAMERA.fx, CAMERA.fy] + [CAMERA.cx, CAMERA.cy] + rng.normal(0, noise_px, (150, 2))
    xy[:wrong] += 9.0
    xy[:, 0] += shift_px
    return Sighting(p @ T_WC[:3, :3].T + T_WC[:3, 3], xy, CAMERA)


def test_steps_lead_to_the_pose_in_spite_of_wrong_matches() -> None:
    true = moved(np.eye(4), np.array([0.3, -0.1, 0.2, 0.05, -0.1, 0.02]))
    points, pose = _seen(true, 0, wrong=20), moved(true, np.array([0.03, -0.02, 0.02, 0.004, -0.006, 0.003]))
    for _ in range(8):
        information, gradient = points.system(pose)
        pose = moved(pose, -np.asarray(np.linalg.solve(information, gradient), np.float64))
    assert np.linalg.norm(pose[:3, 3] - true[:3, 3]) < 0.005


def test_an_error_that_all_points_share_takes_their_say() -> None:
    """A shift by 3 pixels that is expected leaves less information, and a smaller step, than one that is not."""
    points = _seen(np.eye(4), 1, shift_px=3.0)
    aware = Sighting(points.xyz, points.xy, CAMERA, common_px=(3.0, 3.0))
    trusting, wary = points.system(np.eye(4)), aware.system(np.eye(4))
    assert np.linalg.eigvalsh(trusting[0] - wary[0]).min() > 0
    assert abs(wary[1][4]) < 0.2 * abs(trusting[1][4])


def test_nothing_seen_says_nothing() -> None:
    points = Sighting(np.empty((0, 3)), np.empty((0, 2)), CAMERA)
    assert not points.system(np.eye(4))[0].any()


def test_a_longer_lens_is_found_and_a_right_one_left_alone() -> None:
    rng = np.random.default_rng(0)
    wrong, right = Zoom(), Zoom()
    for _ in range(ENOUGH):
        flow = rng.normal(0, 20, 2) + rng.normal(0, 0.5, (50, 2)) + [30, 0]
        wrong.add(1.114 * flow, flow)
        right.add(flow + rng.normal(0, 0.3, 2), flow)
    assert wrong.settled
    assert abs(wrong.ratio - 1.114) < 0.002
    assert right.ratio == 1.0
    assert right.spread < 0.05
