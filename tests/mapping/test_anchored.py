"""The map that hangs on keyframes: where it is built, and where it goes when they move."""

import numpy as np
import pytest

from stsem.camera import Camera
from stsem.classes import NO_LABEL
from stsem.mapping.anchored import AnchoredCloud, moved
from stsem.mapping.cloud import LabelledCloud, LabelledPoints, backproject
from stsem.pose import from_quaternion, inverse

CAMERA = Camera(40, 30, 30.0, 30.0, 19.5, 14.5)
TURNED = from_quaternion([0.3, -0.1, 0.2], [0.0, 0.1, 0.0, 1.0])


def pixels(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 4, (30, 40)).astype(np.uint8)
    labels[:2] = NO_LABEL
    depth = (2 + rng.random((30, 40))).astype(np.float32)
    return depth, labels, rng.integers(0, 256, (30, 40, 3), np.uint8)


def cells(cloud: LabelledCloud) -> set[tuple[int, ...]]:
    return set(map(tuple, np.floor(cloud.points.xyz / cloud.cell_m).astype(int).tolist()))


def points(*xyz: tuple[float, float, float]) -> LabelledPoints:
    return LabelledPoints(np.array(xyz), np.zeros((len(xyz), 3), np.uint8), np.arange(len(xyz), dtype=np.uint8))


def test_at_rest_it_is_the_map_of_the_world() -> None:
    """A frame that hangs on another keyframe by T_KC lands where its own pose puts it; few cells differ by thinning."""
    anchored, direct = AnchoredCloud(cell_m=0.2), LabelledCloud(cell_m=0.2)
    keyframes = [np.eye(4), TURNED]
    for k, T_WC in enumerate([np.eye(4), TURNED, TURNED @ TURNED]):
        anchor = min(k, 1)
        anchored.add(anchor, backproject(*pixels(k), CAMERA, inverse(keyframes[anchor]) @ T_WC))
        direct.add(backproject(*pixels(k), CAMERA, T_WC))
    found, wanted = cells(anchored.cloud(keyframes)), cells(direct)
    assert len(found & wanted) > 0.9 * len(wanted)
    assert found <= wanted


def test_points_go_with_their_keyframe_and_only_with_it() -> None:
    cloud = AnchoredCloud(cell_m=0.1)
    cloud.add(0, points((0.0, 0.0, 1.0)))
    cloud.add(1, points((0.0, 0.0, 2.0), (0.5, 0.0, 2.0)))
    shifted = np.eye(4)
    shifted[:3, 3] = 1, 2, 3
    found = cloud.cloud([np.eye(4), shifted]).points
    assert found.xyz.tolist() == [[0, 0, 1], [1, 2, 5], [1.5, 2, 5]]
    assert found.labels.tolist() == [0, 0, 1]
    assert len(cloud) == 2


def test_a_camera_that_stays_adds_nothing() -> None:
    """Memory grows with what is seen, not with the frames that see it; who was first stays."""
    cloud, wall = AnchoredCloud(cell_m=0.1), LabelledPoints(*_wall())
    assert cloud.add(0, wall) == 1600
    again = LabelledPoints(wall.xyz, wall.rgb, wall.labels + np.uint8(1))
    assert [cloud.add(0, again) for _ in range(3)] == [0, 0, 0]
    assert cloud.add(1, again) == 1600
    assert len(cloud) == 5
    assert set(cloud.cloud([np.eye(4)] * 2).points.labels.tolist()) == {0}


def test_two_visits_become_one_surface_when_the_loop_closes() -> None:
    """A wall seen twice, the second time 30 cm off, is double before and single after."""
    wall = LabelledPoints(*_wall())
    cloud = AnchoredCloud(cell_m=0.1)
    cloud.add(0, wall)
    cloud.add(1, wall)
    drifted = np.eye(4)
    drifted[2, 3] = 0.3
    once = len(cloud.cloud([np.eye(4), np.eye(4)]))
    assert len(cloud.cloud([np.eye(4), drifted])) == 2 * once
    assert once == 400


def test_moved_is_the_matrix_product() -> None:
    some = LabelledPoints(*_wall())
    assert moved(some, TURNED).xyz == pytest.approx(some.xyz @ TURNED[:3, :3].T + TURNED[:3, 3], abs=1e-12)


def test_what_cannot_be() -> None:
    cloud = AnchoredCloud()
    assert len(cloud.cloud([])) == 0
    cloud.add(2, points((np.nan, 0.0, 1.0), (0.0, 0.0, 1.0)))
    with pytest.raises(ValueError, match="hang on keyframe 2, but 2 poses"):
        cloud.cloud([np.eye(4)] * 2)
    assert cloud.cloud([np.eye(4)] * 3).left_out == 1


def _wall() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.arange(0.025, 2, 0.05), np.arange(0.025, 2, 0.05))
    xyz = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.05)])
    return xyz, np.zeros((x.size, 3), np.uint8), np.zeros(x.size, np.uint8)
