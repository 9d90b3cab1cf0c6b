"""The camera's pose: chains of transforms against composing by hand, stamped poses, gaps, circles."""

import numpy as np
import pytest
from made_up_logs import LEVEL
from made_up_tracks import MS, pose, track, turn

from stsem.log.poses.chains import transform_chain
from stsem.log.poses.source import MAX_GAP_NS, PoseSource
from stsem.log.poses.topics import topic_poses
from stsem.log.poses.tree import FrameTree
from stsem.log.tracks import Track
from stsem.pose import interpolate

STATIC = track(
    "/tf_static",
    (-3000 * MS, 5, "base", "link", (0.1, 0.0, 0.5), turn(30)),
    (0, 5, "link", "cam", (0.0, 0.2, 0.0), turn(90)),
)


def test_a_chain_is_composed_of_its_edges_at_the_stamp() -> None:
    """Two moving edges of different rates, two static ones that were stamped long before."""
    moving = track(
        "/tf",
        (0, 1 * MS, "map", "odom", (0.0, 0.0, 0.0), turn(0)),
        (100 * MS, 104 * MS, "map", "odom", (1.0, 0.0, 0.0), turn(10)),
        *((k * 10 * MS, k * 10 * MS + 2, "odom", "base", (0.0, k / 10, 0.0), turn(3 * k)) for k in range(11)),
    )  # fmt: skip
    source, warnings = transform_chain([STATIC, moving], "cam")
    assert source is not None
    assert (source.frames, source.topic, warnings) == (("map", "odom", "base", "link", "cam"), "/tf", [])
    map_odom = interpolate(pose((0, 0, 0)), pose((1, 0, 0), turn(10)), 0.34)
    odom_base = interpolate(pose((0, 0.3, 0), turn(9)), pose((0, 0.4, 0), turn(12)), 0.4)
    expected = map_odom @ odom_base @ pose((0.1, 0, 0.5), turn(30)) @ pose((0, 0.2, 0), turn(90))
    found = source.at(34 * MS)
    assert found is not None
    np.testing.assert_allclose(found.T_WC, expected, atol=1e-12)
    assert found.log_ns == 104 * MS  # the later sample of the slower edge
    trajectory = source.trajectory()
    assert trajectory.stamps_ns.tolist() == [k * 10 * MS for k in range(11)]
    np.testing.assert_allclose(trajectory.poses[5], source.at(50 * MS).T_WC)
    assert source.offset_ns() == 2


def test_nothing_is_extrapolated_and_no_gap_over_150_ms_is_bridged() -> None:
    stamps = [0, 100 * MS, 250 * MS, 400 * MS + 1, 500 * MS]
    source, _ = transform_chain(
        [track("/tf", *((s, s + 7, "world", "cam", (s / 1e9, 0, 0), LEVEL) for s in stamps))], "cam"
    )
    assert source is not None
    known = [
        source.at(stamp) is not None for stamp in (-1, 0, 50 * MS, 200 * MS, 300 * MS, 400 * MS + 1, 450 * MS, 501 * MS)
    ]
    assert known == [False, True, True, True, False, True, True, False]
    assert MAX_GAP_NS == 150 * MS


def test_samples_may_come_in_any_order_and_twice() -> None:
    samples = [(s * MS, s * MS, "w", "cam", (s, 0.0, 0.0), LEVEL) for s in (20, 0, 10, 10, 30)]
    source, _ = transform_chain([track("/tf", *samples)], "cam")
    assert source is not None
    assert source.stamps_ns().tolist() == [0, 10 * MS, 20 * MS, 30 * MS]
    assert source.at(15 * MS).T_WC[0, 3] == pytest.approx(15)


def test_a_pose_is_there_when_both_of_its_samples_are() -> None:
    """Samples that overtook each other: the earlier one was logged last."""
    samples = [(0, 90 * MS, "w", "cam", (0.0, 0.0, 0.0), LEVEL), (10 * MS, 12 * MS, "w", "cam", (1.0, 0.0, 0.0), LEVEL)]
    source, _ = transform_chain([track("/tf", *samples)], "cam")
    assert source is not None
    assert [source.at(stamp * MS).log_ns // MS for stamp in (0, 5, 10)] == [90, 90, 12]


def test_the_static_transform_that_came_last_holds() -> None:
    moving = track("/tf", *((s * MS, s * MS, "w", "base", (0.0, 0.0, 0.0), LEVEL) for s in (0, 100)))
    static = track("/tf_static", (0, 0, "base", "cam", (1, 0, 0), LEVEL), (0, 9, "base", "cam", (2, 0, 0), LEVEL))
    source, _ = transform_chain([moving, static], "/cam")
    assert source.at(0).T_WC[0, 3] == 2


def test_trees_that_do_not_lead_to_the_camera_are_explained() -> None:
    assert transform_chain([STATIC], "cam")[0] is None
    moving = track("/tf", (0, 0, "map", "base", (0, 0, 0), LEVEL))
    source, warnings = transform_chain([moving], "cam")
    assert source is None
    assert warnings == [
        "No transform moves the camera's frame 'cam' (frames known: base, map): the transforms give no poses."
    ]
    circle = track("/tf", (0, 0, "a", "b", (0, 0, 0), LEVEL), (0, 0, "b", "a", (0, 0, 0), LEVEL))
    source, warnings = transform_chain([circle], "a")
    assert source is None
    assert "run in a circle" in warnings[0]


def test_a_frame_with_two_parents_keeps_the_one_with_more_samples() -> None:
    samples = [(s * MS, s * MS, "odom", "cam", (1.0, 0.0, 0.0), LEVEL) for s in range(3)]
    source, warnings = transform_chain([track("/tf", *samples, (0, 0, "other", "cam", (9, 0, 0), LEVEL))], "cam")
    assert source is not None
    assert source.frames == ("odom", "cam")
    assert warnings == ["The frame 'cam' has several parents (odom, other); 'odom' is used."]


def stamped_poses(of: Track) -> tuple[PoseSource | None, list[str]]:
    """Poses of one channel without a tree."""
    return topic_poses(of, FrameTree([]), "cam")


def test_poses_that_are_none_are_left_out_and_counted() -> None:
    bad = [(1 * MS, 1, "w", "", (float("nan"), 0, 0), LEVEL), (2 * MS, 2, "w", "", (0, 0, 0), (0.0, 0.0, 0.0, 0.0))]
    good = [(s * MS, s * MS + 5, "w", "", (s, 0.0, 0.0), LEVEL) for s in (0, 10)]
    source, warnings = stamped_poses(track("/pose", *bad, *good))
    assert source is not None
    assert source.at(5 * MS).T_WC[0, 3] == pytest.approx(5)
    assert warnings == ["2 poses of /pose are not finite or have a zero quaternion: left out."]
    assert stamped_poses(track("/pose", *bad))[0] is None


def test_an_unstamped_pose_counts_from_its_log_time() -> None:
    source, _ = stamped_poses(track("/pose", (None, 40 * MS, "w", "", (0, 0, 0), LEVEL)))
    assert source.stamps_ns().tolist() == [40 * MS]
    assert source.at(40 * MS).log_ns == 40 * MS
