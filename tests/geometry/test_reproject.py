"""The exact warp, on scenes whose answer can be written down."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.camera import Camera
from stsem.chance import generator
from stsem.classes import NO_LABEL
from stsem.frame import Depth
from stsem.geometry.reproject import View, among, correspond, in_image, looked_past
from stsem.pose import Pose, from_quaternion

CAMERA = Camera(96, 64, 60.0, 62.0, 47.2, 31.4)
LABELS = generator(0, "labels").integers(0, 13, (64, 96)).astype(np.uint8)
EVERYWHERE = np.arange(64 * 96)
Rays = npt.NDArray[np.float64]


def rays(camera: Camera = CAMERA) -> Rays:
    """(H, W, 3) directions with z = 1."""
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    return np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)], axis=-1)


def plane(
    T_WC: Pose, camera: Camera = CAMERA, normal: tuple[float, ...] = (0.1, -0.2, 1), distance: float = 3.0
) -> Depth:
    """Depth of the plane normal . X_W = distance."""
    n = np.array(normal)
    along = rays(camera) @ T_WC[:3, :3].T @ n
    return np.asarray((distance - n @ T_WC[:3, 3]) / along, np.float32)


def pose(x: float, y: float, z: float, *q: float) -> Pose:
    return from_quaternion((x, y, z), q or (0, 0, 0, 1))


def fetched(current: View, keyframe: View, labels: npt.NDArray[np.uint8] = LABELS) -> npt.NDArray[np.uint8]:
    result = np.full(current.depth.shape, NO_LABEL, np.uint8)
    correspond(current, keyframe).fetch(labels, result)
    return result


def by_definition(current: View, keyframe: View) -> tuple[npt.NDArray[np.uint8], Rays]:
    """Labels without a test of depth, in float64, pixel by pixel; also how far each pixel was from a tie."""
    points = rays(current.camera) * current.depth[..., None].astype(np.float64)
    world = points @ current.T_WC[:3, :3].T + current.T_WC[:3, 3]
    there = (world - keyframe.T_WC[:3, 3]) @ keyframe.T_WC[:3, :3]
    image = there @ keyframe.camera.K.T
    u, v = image[..., 0] / image[..., 2], image[..., 1] / image[..., 2]
    column, row = np.rint(u).astype(int), np.rint(v).astype(int)
    inside = (image[..., 2] > 0) & (column >= 0) & (row >= 0) & (column < 96) & (row < 64)
    result = np.full(current.depth.shape, NO_LABEL, np.uint8)
    result[inside] = LABELS[row[inside], column[inside]]
    return result, np.minimum(np.abs(u % 1 - 0.5), np.abs(v % 1 - 0.5))


def test_the_same_view_keeps_every_label_that_has_depth() -> None:
    depth = plane(np.eye(4))
    depth[10:20, 30:50] = np.nan
    view = View(depth, pose(4, 5, 6, 0.1, 0.2, 0.3, 0.9), CAMERA)
    np.testing.assert_array_equal(fetched(view, view), np.where(np.isnan(depth), NO_LABEL, LABELS))


@settings(max_examples=25)
@given(st.tuples(*[st.floats(-0.3, 0.3)] * 3), st.tuples(*[st.floats(-0.15, 0.15)] * 3))
def test_a_plane_under_known_motion_is_fetched_exactly(moved: tuple[float, ...], turned: tuple[float, ...]) -> None:
    there, here = pose(0, 0, 0), pose(*moved, *turned, 1)
    current, keyframe = View(plane(here), here, CAMERA), View(plane(there), there, CAMERA)
    expected, from_a_tie = by_definition(current, keyframe)
    clear = from_a_tie > 1e-3
    np.testing.assert_array_equal(fetched(current, keyframe)[clear], expected[clear])
    assert (expected != NO_LABEL).mean() > 0.3


def test_some_pixels_get_what_all_would() -> None:
    here, there = pose(0.1, 0, 0.2, 0, 0.05, 0, 1), pose(0, 0, 0)
    current, keyframe = View(plane(here), here, CAMERA), View(plane(there), there, CAMERA)
    whole = fetched(current, keyframe)
    wanted = generator(1, "wanted").random((64, 96)) < 0.3
    some = np.full_like(whole, NO_LABEL)
    among(current, keyframe, np.flatnonzero(wanted)).fetch(LABELS, some)
    np.testing.assert_array_equal(some, np.where(wanted, whole, NO_LABEL))
    among(current, keyframe, np.empty(0, np.intp)).fetch(LABELS, some)
    np.testing.assert_array_equal(some, np.where(wanted, whole, NO_LABEL))


def test_what_a_nearer_surface_hid_has_no_partner() -> None:
    """A box 1 m away hides part of a wall at 3 m; 0.5 m to the side one sees the wall behind it."""
    box, wall = np.s_[20:44, 40:56], np.full((64, 96), 3, np.float32)
    there, labels = wall.copy(), np.full((64, 96), 1, np.uint8)
    there[box], labels[box] = 1, 2
    here = wall.copy()
    here[20:44, 10:26] = 1  # 0.5 m at 1 m is 30 pixels
    current, keyframe = View(here, pose(0.5, 0, 0), CAMERA), View(there, pose(0, 0, 0), CAMERA)
    answer = fetched(current, keyframe, labels)
    assert (answer[20:44, 10:26] == 2).all()
    assert not (answer[here == 3] == 2).any()
    hidden = np.s_[21:43, 31:45]  # where the box stood, seen 10 pixels to the left on the wall
    assert (answer[hidden] == NO_LABEL).all()
    assert (answer[:, 86:] == NO_LABEL).all()


def test_depth_unknown_in_the_keyframe_gives_no_partner_and_behind_it_neither() -> None:
    flat = np.full((64, 96), 2, np.float32)
    unknown = View(np.full_like(flat, np.nan), np.eye(4), CAMERA)
    assert (fetched(View(flat, np.eye(4), CAMERA), unknown) == NO_LABEL).all()
    turned_round = View(flat, pose(0, 0, 0, 0, 1, 0, 0), CAMERA)
    assert (fetched(View(flat, np.eye(4), CAMERA), turned_round) == NO_LABEL).all()


def test_frames_of_other_sizes_meet() -> None:
    half = CAMERA.scaled(48, 32)
    current, keyframe = View(plane(np.eye(4), half), np.eye(4), half), View(plane(np.eye(4)), np.eye(4), CAMERA)
    blocks = np.kron(LABELS[:32, :48], np.ones((2, 2), np.uint8))
    np.testing.assert_array_equal(fetched(current, keyframe, blocks), LABELS[:32, :48])


def test_a_camera_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="undistorted camera"):
        View(np.ones((10, 10), np.float32), np.eye(4), CAMERA)
    with pytest.raises(ValueError, match="undistorted camera"):
        View(np.ones((64, 96), np.float32), np.eye(4), Camera(96, 64, 60, 60, 47, 31, (0.1,), "plumb_bob"))


def flat(distance: float, camera: Camera = CAMERA) -> Depth:
    return np.full((camera.height, camera.width), distance, np.float32)


def past(current: View, keyframe: View, rows: npt.NDArray[np.intp] = EVERYWHERE) -> npt.NDArray[np.bool_]:
    found = looked_past(current, keyframe, rows, clearance_m=0.5)
    assert found.shape == rows.shape
    assert found.dtype == np.bool_
    return found


@pytest.mark.parametrize(("distance", "expected"), [(1, True), (2.4, True), (2.6, False), (3, False), (5, False)])
def test_a_keyframe_looked_past_what_stands_in_front_of_what_it_saw(distance: float, expected: bool) -> None:
    """It saw a wall at 3 m; what is there now must be nearer by half a metre."""
    assert (past(View(flat(distance), np.eye(4), CAMERA), View(flat(3), np.eye(4), CAMERA)) == expected).all()


def test_a_keyframe_looked_past_what_came_though_both_cameras_moved() -> None:
    """A box at 1 m came before a wall at 3 m; 0.5 m to the side is 30 pixels on the box; 10 columns look elsewhere."""
    here, came = flat(3), np.zeros((64, 96), np.bool_)
    here[20:44, 10:26] = here[50:60, 60:80] = 1
    came[20:44, 10:26] = came[50:60, 60:66] = True
    current, keyframe = View(here, pose(1.5, 2, 3), CAMERA), View(flat(3), pose(1, 2, 3), CAMERA)
    np.testing.assert_array_equal(past(current, keyframe).reshape(64, 96), came)
    nearer = View(here - np.float32(0.25), pose(1.5, 2, 3.25), CAMERA)
    assert not past(nearer, keyframe)[here.reshape(-1) == 3].any()
    box = View(here, pose(1, 2, 3), CAMERA)
    assert not past(View(flat(3), pose(1.5, 2, 3), CAMERA), box).any()


def test_some_pixels_are_looked_past_as_all_are_in_any_order() -> None:
    here, there = pose(0.1, 0, 0.2, 0, 0.05, 0, 1), pose(0, 0, 0)
    near = plane(here)
    near[generator(3, "near").random(near.shape) < 0.4] /= 2
    current, keyframe = View(near, here, CAMERA), View(plane(there), there, CAMERA)
    whole = past(current, keyframe)
    assert 0.2 < whole.mean() < 0.4
    order = generator(4, "order").permutation(64 * 96)
    for count in (1, 2, 256, 257, 1000, 64 * 96):
        np.testing.assert_array_equal(past(current, keyframe, order[:count]), whole[order[:count]])


def test_a_keyframe_did_not_look_past_what_is_outside_of_it_or_behind_it() -> None:
    current = View(flat(1), np.eye(4), CAMERA)
    aside = past(current, View(flat(3), pose(0.5, 0, 0), CAMERA)).reshape(64, 96)
    np.testing.assert_array_equal(aside, np.broadcast_to(np.arange(96) >= 30, (64, 96)))
    for distance in (50.0, -50.0, 1e30):
        assert not past(current, View(flat(3), pose(distance, 0, 0), CAMERA)).any()
    assert not past(current, View(flat(3), pose(0, 0, 0, 0, 1, 0, 0), CAMERA)).any()
    assert not past(current, View(flat(3), pose(0, 0, 2), CAMERA)).any()


def test_a_keyframe_did_not_look_past_where_either_depth_is_unknown() -> None:
    here, there = flat(1), flat(3)
    here[10:20, 10:20] = there[15:25, 40:50] = np.nan
    found = past(View(here, np.eye(4), CAMERA), View(there, np.eye(4), CAMERA))
    np.testing.assert_array_equal(found, ~np.isnan(here + there).reshape(-1))


def test_without_pixels_nothing_is_looked_past() -> None:
    assert not len(past(View(flat(1), np.eye(4), CAMERA), View(flat(3), np.eye(4), CAMERA), np.empty(0, np.intp)))


def test_a_keyframe_of_another_size_is_looked_at_where_it_shows_the_point() -> None:
    half, there = CAMERA.scaled(48, 32), flat(3)
    there[:, :40] = 1
    small, large = View(flat(1, half), np.eye(4), half), View(there, np.eye(4), CAMERA)
    rows = np.arange(48 * 32)
    np.testing.assert_array_equal(past(small, large, rows), rows % 48 >= 20)
    there = flat(3, half)
    there[:, :20] = 1
    found = past(View(flat(1), np.eye(4), CAMERA), View(there, np.eye(4), half))
    np.testing.assert_array_equal(found, EVERYWHERE % 96 >= 40)


def test_a_lit_view_is_the_same_one_with_its_shadows_filled() -> None:
    depth = flat(3)
    depth[:, :30], depth[:, 30:36] = 1, np.nan
    dark = View(depth, pose(1, 2, 3), CAMERA)
    lit = dark.lit()
    np.testing.assert_array_equal(lit.depth, np.where(np.isnan(depth), np.float32(3), depth))
    np.testing.assert_array_equal(lit.T_WC, dark.T_WC)
    assert lit.camera == CAMERA
    assert np.isnan(dark.depth[:, 30:36]).all()


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**16))
def test_where_no_pixel_falls_into_the_image_nothing_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = [pose(*rng.uniform(-2, 2, 3), *rng.normal(size=4)) for _ in range(6)]
    views = [View(np.full((64, 96), 3, np.float32), one, CAMERA) for one in poses]
    rows = np.sort(rng.choice(EVERYWHERE, 40, replace=False))
    possible = in_image(views[0], views, rows)
    assert possible[0]
    for view, inside in zip(views, possible, strict=True):
        assert inside or not among(views[0], view, rows).found.any()


@pytest.mark.parametrize(
    ("x", "turn", "expected"), [(0.0, 0.0, True), (4.7, 0.0, True), (4.9, 0.0, False), (0.0, 1.0, False)]
)
def test_a_keyframe_beside_or_behind_has_nothing_in_its_image(x: float, turn: float, expected: bool) -> None:
    """At 3 m, 96 pixels are 4.8 m wide; a half turn about the vertical looks away."""
    depth = np.full((64, 96), 3, np.float32)
    keyframe = View(depth, pose(x, 0, 0, 0, turn, 0, 1 - turn), CAMERA)
    assert in_image(View(depth, np.eye(4), CAMERA), [keyframe], EVERYWHERE).tolist() == [expected]


def test_without_pixels_or_depth_or_keyframes_nothing_is_in_an_image() -> None:
    view = View(np.full((64, 96), 3, np.float32), np.eye(4), CAMERA)
    blind = View(np.full((64, 96), np.nan, np.float32), np.eye(4), CAMERA)
    assert in_image(view, [view], EVERYWHERE[:0]).tolist() == [False]
    assert in_image(blind, [view], EVERYWHERE).tolist() == [False]
    assert in_image(view, [], EVERYWHERE).tolist() == []
