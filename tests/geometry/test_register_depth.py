"""Depth of one camera on the pixels of another, against the analytic depth of planes that both see."""

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.camera import Camera
from stsem.geometry.register_depth import DepthRegistration, register_depth
from stsem.pose import Pose, from_quaternion, inverse
from tests.made_up_lens import DEPTH, RIG, SAME, SMALL, WIDE, planes_seen

Float64 = npt.NDArray[np.float64]


def covisible(camera: Camera, z: Float64, T_camera_depth: Pose) -> npt.NDArray[np.bool_]:
    """Which pixels of `camera` the depth camera sees, too, two pixels away from its border."""
    y, x = np.mgrid[: camera.height, : camera.width]
    points = np.stack([(x - camera.cx) / camera.fx * z, (y - camera.cy) / camera.fy * z, z], axis=-1)
    back = inverse(T_camera_depth)
    points = points @ back[:3, :3].T + back[:3, 3]
    u = points[..., 0] / points[..., 2] * DEPTH.fx + DEPTH.cx
    v = points[..., 1] / points[..., 2] * DEPTH.fy + DEPTH.cy
    inside = (u > 2) & (u < DEPTH.width - 3) & (v > 2) & (v < DEPTH.height - 3)
    return np.asarray(inside & (points[..., 2] > 0))


@pytest.mark.parametrize(
    ("color", "tolerance"), [(WIDE, 0.01), (SAME, 0.01), (SMALL, 0.02)], ids=["larger", "same", "smaller"]
)
def test_planes_keep_their_depth(color: Camera, tolerance: float) -> None:
    """More than 97 % of what both cameras see is within 1 %, without holes; 2 % in a smaller image, whose pixels keep
    the nearest of what they cover."""
    depth = planes_seen(DEPTH, np.eye(4)).astype(np.float32)
    got, true = register_depth(depth, DEPTH, color, RIG), planes_seen(color, RIG)
    both = covisible(color, true, RIG)
    assert both.mean() > 0.6
    assert (np.abs(got[both] / true[both] - 1) < tolerance).mean() > 0.97
    assert np.isnan(got[both]).mean() < 0.002


def test_the_nearer_surface_wins_at_an_edge() -> None:
    """A wall at 3 m and a board at 1 m before its left half; the colour camera 10 cm to the right sees the board moved
    by its disparity, the wall by its own, and between them what the depth camera cannot know."""
    T = np.eye(4)
    T[0, 3] = -0.1
    depth = np.full((120, 160), 3, np.float32)
    depth[:, :80] = 1
    got = register_depth(depth, DEPTH, DEPTH, T)
    board, wall = 13, 13 / 3
    assert (got[:, : int(79 - board)] == 1).all()
    assert np.isnan(got[:, int(82 - board) : int(79 - wall)]).all()
    np.testing.assert_array_equal(got[:, int(82 - wall) : int(158 - wall)], 3)
    T[0, 3] = 0.1  # from the left the board covers the wall
    got = register_depth(depth, DEPTH, DEPTH, T)
    assert (got[:, board + 1 : 79 + board] == 1).all()
    np.testing.assert_array_equal(got[:, 82 + board :], 3)


def test_every_pixel_is_where_opencv_projects_it() -> None:
    """Single points, at cv2.projectPoints; depth is that along the axis of the colour camera."""
    for u, v, z in ((80, 60, 2.0), (20, 100, 1.0), (140, 30, 4.5)):
        depth = np.full((120, 160), np.nan, np.float32)
        depth[v, u] = z
        point = np.array([[(u - DEPTH.cx) / DEPTH.fx * z, (v - DEPTH.cy) / DEPTH.fy * z, z]])
        rotation, _ = cv2.Rodrigues(RIG[:3, :3])
        pixel, _ = cv2.projectPoints(point, rotation, RIG[:3, 3], WIDE.K, np.zeros(4))
        got = register_depth(depth, DEPTH, WIDE, RIG)
        rows, columns = np.nonzero(np.isfinite(got))
        np.testing.assert_allclose(got[rows, columns], (RIG[:3, :3] @ point[0] + RIG[:3, 3])[2], rtol=1e-5)
        np.testing.assert_allclose([columns.mean(), rows.mean()], pixel.ravel(), atol=0.75)
        assert 1 <= len(rows) <= 9


def test_the_same_camera_changes_nothing() -> None:
    depth = planes_seen(DEPTH, np.eye(4)).astype(np.float32)
    depth[10:20, 30:50] = np.nan
    np.testing.assert_allclose(register_depth(depth, DEPTH, DEPTH, np.eye(4)), depth, rtol=1e-6)


def test_what_is_behind_or_unknown_is_left_out() -> None:
    T = from_quaternion((0, 0, 0), (0, 1, 0, 0))  # the colour camera looks the other way
    assert np.isnan(register_depth(np.full((120, 160), 2, np.float32), DEPTH, SAME, T)).all()
    hostile = np.full((120, 160), np.nan, np.float32)
    hostile[0], hostile[1], hostile[2] = np.inf, -1, 0
    assert np.isnan(register_depth(hostile, DEPTH, SAME, RIG)).all()


def test_wrong_sizes_and_lenses_are_refused() -> None:
    with pytest.raises(ValueError, match=r"depth is \(2, 3\), but its camera is \(120, 160\)"):
        register_depth(np.ones((2, 3), np.float32), DEPTH, SAME, RIG)
    bent = replace(DEPTH, model="plumb_bob", distortion=(0.1, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="without distortion"):
        DepthRegistration(bent, SAME, RIG)


@settings(max_examples=40)
@given(
    f=st.floats(1e-3, 1e7), t=st.tuples(*[st.floats(-1e9, 1e9)] * 3), q=st.tuples(*[st.floats(-1, 1)] * 4),
    z=st.floats(0, 2.0**100, width=32),
)  # fmt: skip
def test_any_rig_gives_depth_or_nothing(
    f: float, t: tuple[float, ...], q: tuple[float, ...], z: float
) -> None:  # fmt: skip
    T = from_quaternion(t, q if np.linalg.norm(q) > 1e-3 else (0, 0, 0, 1))
    depth = np.full((120, 160), z, np.float32)
    got = register_depth(depth, DEPTH, replace(SAME, fx=f, fy=f), T)
    assert got.shape == (120, 160)
    assert (np.isnan(got) | (np.isfinite(got) & (got > 0))).all()
