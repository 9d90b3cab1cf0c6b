"""Fuse: equation 3 for keyframes that have what it needs."""

from dataclasses import replace

import numpy as np
import pytest

from stsem.camera import Camera
from stsem.classes import NO_LABEL
from stsem.frame import Frame, Segmentation
from stsem.mapping.anchored import AnchoredCloud
from stsem.mapping.cloud import LabelledCloud
from stsem.pose import Pose
from stsem.stages.fuse import AnchoredFuse, Fuse

CAMERA = Camera(4, 3, 2.0, 2.0, 1.5, 1.0)


def whole(z: float = 2.0, x: float = 10.0) -> Frame:
    T_WC = np.eye(4)
    T_WC[0, 3] = x
    return Frame(0, 0, np.zeros((3, 4, 3), np.uint8), None, np.full((3, 4), z, np.float32), T_WC, CAMERA)


def test_points_land_where_equation_3_says() -> None:
    """X_W = T_WC z K^-1 (u, v, 1); a pixel without label or depth makes no point."""
    frame = whole()
    assert frame.depth is not None
    frame.depth[0, 0] = np.nan
    labels = np.zeros((3, 4), np.uint8)
    labels[2, 3], labels[0, 1] = 7, NO_LABEL
    fuse = Fuse(LabelledCloud(cell_m=0.01))
    assert fuse.can_fuse(frame)
    fuse(frame, Segmentation(labels))
    points = fuse.cloud.points
    assert len(points) == 10
    (row,) = np.flatnonzero(points.labels == 7)
    assert points.xyz[row] == pytest.approx([10 + (3 - 1.5) / 2 * 2, (2 - 1.0) / 2 * 2, 2.0])


@pytest.mark.parametrize(
    "lacking",
    [
        {"depth": None}, {"T_WC": None}, {"camera": None}, {"camera": Camera(4, 3, 2.0, 2.0, 1.5, 1.0, (0.1, 0.0))},
        {"depth": np.ones((6, 8), np.float32)}, {"camera": Camera(8, 6, 2.0, 2.0, 1.5, 1.0)},
    ],
    ids=["depth", "pose", "camera", "distorted", "depth size", "camera size"],
)  # fmt: skip
def test_what_cannot_be_fused(lacking: dict[str, object]) -> None:
    """Said beforehand, so that no core time is spent on it."""
    assert not Fuse(LabelledCloud()).can_fuse(replace(whole(), **lacking))  # type: ignore[arg-type]


def test_without_a_pose_nothing_is_added() -> None:
    """Called all the same, it leaves the map as it is."""
    fuse = Fuse(LabelledCloud())
    fuse(replace(whole(), T_WC=None), Segmentation(np.zeros((3, 4), np.uint8)))
    assert len(fuse.cloud) == 0


def test_an_anchored_keyframe_goes_where_its_anchor_is_in_the_end() -> None:
    """Fused 1 m ahead of SLAM's keyframe 1, which a loop moves 5 m along x afterwards."""
    ahead, moved = np.eye(4), np.eye(4)
    ahead[2, 3], moved[0, 3] = 1.0, 5.0
    anchors: dict[int, tuple[int, Pose]] = {0: (1, ahead)}
    fuse = AnchoredFuse(AnchoredCloud(cell_m=0.01), anchors.get)
    assert fuse.can_fuse(whole())
    assert not fuse.can_fuse(replace(whole(), T_WC=None))
    fuse(whole(), Segmentation(np.zeros((3, 4), np.uint8)))
    fuse(replace(whole(), index=7), Segmentation(np.zeros((3, 4), np.uint8)))  # lost: it hangs on nothing
    points = fuse.cloud.cloud([np.eye(4), moved]).points
    assert len(points) == 12
    assert points.xyz[:, 2] == pytest.approx(3.0)
    assert points.xyz[:, 0].mean() == pytest.approx(5.0)
