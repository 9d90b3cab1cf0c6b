"""Alignment against the exact derivative, and against poses that are known."""

import numpy as np

from stsem.pose import inverse
from stsem.slam.align import Reference, agreement, align, difference, moved
from stsem.slam.planes import plane_grid
from tests.slam.made_up_room import CAMERA, frame, pose

HERE, THERE = pose(-0.2, 0.0, -0.5, 45), pose(-0.15, 0.03, -0.45, 47, 2)


def test_planes_are_those_of_the_room() -> None:
    depth = frame(0, HERE).depth
    assert depth is not None
    planes = plane_grid(depth, CAMERA).planes
    known = planes[planes[:, 4] > 0]
    normals = np.abs(known[:, :3] @ HERE[:3, :3].T)
    assert len(known) > 0.8 * len(planes)
    assert np.median(normals.max(axis=1)) > 0.9999


def test_depth_finds_the_pose() -> None:
    here, there = frame(0, HERE).depth, frame(1, THERE).depth
    assert here is not None
    assert there is not None
    found = align([(plane_grid(there, CAMERA).points(), 10)], [Reference(HERE, plane_grid(here, CAMERA))], HERE)
    np.testing.assert_allclose(found.T_WC, THERE, atol=1e-3)
    assert found.agreement.share > 0.8


def test_no_surface_in_common_is_no_agreement() -> None:
    here = frame(0, HERE).depth
    assert here is not None
    grid = plane_grid(here, CAMERA)
    found = agreement(grid.points(), Reference(HERE, grid), HERE @ pose(0, 0, -3))
    assert found.share < 0.05
    assert not found.gradient.any() or np.isfinite(found.residual)


def test_moved_and_difference_are_inverse_and_stay_rotations() -> None:
    step = np.array([0.01, -0.02, 0.03, 0.02, 0.01, -0.03])
    there = moved(HERE, step)
    np.testing.assert_allclose(difference(HERE, there)[3:], step[3:], atol=1e-9)
    np.testing.assert_allclose(difference(HERE, there)[:3], there[:3, :3].T @ HERE[:3, :3] @ step[:3], atol=1e-12)
    for _ in range(200):
        there = there @ (inverse(HERE) @ moved(HERE, step))
        there = moved(there, step)
    assert np.abs(there[:3, :3] @ there[:3, :3].T - np.eye(3)).max() < 1e-12
