"""Equation 3: points where they belong, one per cell, nothing lost in silence."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.camera import Camera
from stsem.chance import generator
from stsem.classes import NO_LABEL
from stsem.mapping.cloud import LabelledCloud, LabelledPoints, backproject
from stsem.pose import from_quaternion

CAMERA = Camera(8, 6, 10.0, 12.0, 3.5, 2.5)
T_WC = from_quaternion([1, 2, 3], [0.1, -0.2, 0.3, 0.9])
IMAGE = generator(0, "image").integers(0, 256, (6, 8, 3)).astype(np.uint8)
LABELS = generator(0, "labels").integers(0, 5, (6, 8)).astype(np.uint8)
DEPTH = generator(0, "depth").uniform(1, 4, (6, 8)).astype(np.float32)


def points(xyz: npt.ArrayLike, labels: npt.ArrayLike | None = None) -> LabelledPoints:
    at = np.asarray(xyz, np.float64).reshape(-1, 3)
    ids = np.arange(len(at)) % 200 if labels is None else np.asarray(labels)
    return LabelledPoints(at, np.zeros((len(at), 3), np.uint8), ids.astype(np.uint8))


def test_every_pixel_lands_where_the_projection_says() -> None:
    found = backproject(DEPTH, LABELS, IMAGE, CAMERA, T_WC)
    v, u = np.mgrid[:6, :8]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(CAMERA.K).T
    expected = (rays * DEPTH[..., None]).reshape(-1, 3) @ T_WC[:3, :3].T + T_WC[:3, 3]
    np.testing.assert_allclose(found.xyz, expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found.labels, LABELS.ravel())
    np.testing.assert_array_equal(found.rgb, IMAGE.reshape(-1, 3))


def test_the_principal_point_lies_ahead_of_the_camera() -> None:
    camera = Camera(3, 3, 5.0, 5.0, 1.0, 1.0)
    depth = np.full((3, 3), np.nan, np.float32)
    depth[1, 1] = 2.5
    pose = from_quaternion([0, 0, 1], [-0.5, 0.5, -0.5, 0.5])  # z of the camera looks along x of the world
    found = backproject(depth, np.zeros((3, 3), np.uint8), np.zeros((3, 3, 3), np.uint8), camera, pose)
    np.testing.assert_allclose(found.xyz, [[2.5, 0, 1]], atol=1e-12)


def test_pixels_without_depth_or_label_make_no_point() -> None:
    depth, labels = DEPTH.copy(), LABELS.copy()
    depth[0, :5] = [np.nan, 0, -1, np.inf, 10.5]
    labels[1, :2] = NO_LABEL
    found = backproject(depth, labels, IMAGE, CAMERA, T_WC)
    keep = np.ones((6, 8), bool)
    keep[0, :5] = keep[1, :2] = False
    np.testing.assert_array_equal(found.labels, LABELS[keep])
    assert len(backproject(DEPTH, LABELS, IMAGE, CAMERA, T_WC, max_depth_m=2.0)) == np.count_nonzero(DEPTH <= 2)


@pytest.mark.parametrize(
    "camera", [Camera(8, 5, 10, 10, 3, 2), Camera(8, 6, 10, 10, 3, 2, distortion=(0.1, 0, 0, 0), model="plumb_bob")]
)
def test_a_camera_that_does_not_fit_is_refused(camera: Camera) -> None:
    with pytest.raises(ValueError, match="undistorted camera"):
        backproject(DEPTH, LABELS, IMAGE, camera, T_WC)


def test_the_first_point_of_a_cell_stays() -> None:
    cloud = LabelledCloud(cell_m=1.0)
    assert cloud.add(points([[0.1, 0, 0], [5.5, 0, 0], [0.9, 0, 0], [-0.1, 0, 0]], [1, 2, 3, 4])) == 3
    assert cloud.add(points([[0.5, 0.5, 0.5], [5.5, 1.5, 0], [5.1, 0.2, 0.3]], [5, 6, 7])) == 1
    assert sorted(zip(cloud.points.xyz[:, 0].tolist(), cloud.points.labels.tolist(), strict=True)) == [
        (-0.1, 4),
        (0.1, 1),
        (5.5, 2),
        (5.5, 6),
    ]
    assert (len(cloud), cloud.left_out) == (4, 0)


coordinates = st.floats(-3, 3, width=32)


@settings(max_examples=100, derandomize=True)
@given(st.lists(st.lists(st.tuples(coordinates, coordinates, coordinates), max_size=30), max_size=4))
def test_thinning_equals_a_dictionary_of_cells(frames: list[list[tuple[float, float, float]]]) -> None:
    cloud, cells = LabelledCloud(cell_m=0.5), {}
    for frame in frames:
        cloud.add(points(frame))
        for i, xyz in enumerate(frame):
            cells.setdefault(tuple(int(np.floor(c / 0.5)) for c in xyz), (xyz, i))
    found = [(tuple(xyz), int(label)) for xyz, label in zip(cloud.points.xyz, cloud.points.labels, strict=True)]
    assert sorted(found) == sorted(cells.values())
    assert len(cloud) == len(cells)


def test_seeing_the_same_again_does_not_grow_the_map() -> None:
    cloud = LabelledCloud()
    frame = backproject(DEPTH, LABELS, IMAGE, CAMERA, T_WC)
    first = cloud.add(frame)
    assert [cloud.add(frame) for _ in range(3)] == [0, 0, 0]
    assert len(cloud) == first > 30


def test_a_full_map_counts_what_it_leaves_out() -> None:
    cloud = LabelledCloud(cell_m=1.0, max_points=3)
    cloud.add(points([[0.5, 0, 0], [1.5, 0, 0]]))
    assert cloud.add(points([[0.5, 0, 0], [2.5, 0, 0], [3.5, 0, 0], [4.5, 0, 0]])) == 1
    assert (len(cloud), cloud.left_out) == (3, 2)


def test_points_off_the_grid_are_counted_and_left_out() -> None:
    cloud = LabelledCloud(cell_m=0.05)
    far = 0.05 * 2**20
    cloud.add(
        points([[np.nan, 0, 0], [7e6, 4e6, 50], [7e6 + 0.9 * far, 4e6, 50], [7e6 + 1.1 * far, 4e6, 50], [0, 0, np.inf]])
    )
    assert (len(cloud), cloud.left_out) == (2, 3)
    assert cloud.add(points([[7e6, 4e6, 50]])) == 0


def test_nothing_makes_an_empty_map() -> None:
    cloud = LabelledCloud()
    assert cloud.add(points([])) == 0
    assert cloud.add(points([[np.nan, 0, 0]])) == 0
    assert (len(cloud), len(cloud.points), cloud.left_out) == (0, 0, 1)
    assert cloud.add(points([[1, 2, 3]])) == 1
    with pytest.raises(ValueError, match="must be positive"):
        LabelledCloud(cell_m=0.0)
