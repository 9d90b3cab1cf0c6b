"""Which poses are used, and how they are brought to the camera: odometry, stamped poses, static transforms."""

import numpy as np
import pytest
from made_up_logs import LEVEL
from made_up_tracks import MS, Sample, line, odometry, pose, stamped, track, turn

from stsem.log.poses.body import BODY_OPTICAL, is_body_name, looks_like_body_frame
from stsem.log.poses.find import find_poses
from stsem.log.poses.tree import static_transform
from stsem.log.tracks import Int64, Track
from stsem.pose import Trajectory, inverse

COLOR: Int64 = np.arange(0, 1000 * MS, 50 * MS, np.int64)
MOUNT = track(
    "/tf_static", (0, 5, "base_link", "mast", (0.1, 0.0, 1.0), turn(30)), (0, 5, "mast", "cam", (0, 0.2, 0), turn(60))
)
T_BASE_CAM = pose((0.1, 0.0, 1.0), turn(30)) @ pose((0, 0.2, 0), turn(60))
STEPS = range(0, 1001, 50)


def odom(child: str) -> Track:
    return odometry("/odom", *line("odom", child, STEPS))


@pytest.mark.parametrize(
    ("tracks", "extrinsic", "words"),
    [
        ([odom("base_link"), MOUNT], T_BASE_CAM, ""),
        ([odom("/base_link"), MOUNT], T_BASE_CAM, ""),
        ([odom("mast"), MOUNT], pose((0, 0.2, 0), turn(60)), ""),
        ([odom("cam"), MOUNT], np.eye(4), ""),
        ([odom("imu"), MOUNT, track("/tf_static", (0, 5, "base_link", "imu", (0, 0, 0.3), turn(90)))],
         inverse(pose((0, 0, 0.3), turn(90))) @ T_BASE_CAM, ""),
        ([odom("base_footprint")], BODY_OPTICAL, "the camera is taken to sit in 'base_footprint' and to look along"),
        ([odom("sensor_head")], np.eye(4), "'sensor_head' is taken as the camera's optical frame"),
        ([stamped("/pose", *line("odom", "", STEPS))], np.eye(4), ""),
    ],
    ids=["chain", "slash", "part of a chain", "camera itself", "aside", "body alone", "strange alone", "no name"],
)  # fmt: skip
def test_a_pose_is_brought_to_the_camera(tracks: list[Track], extrinsic: np.ndarray, words: str) -> None:
    source, warnings = find_poses(tracks, None, "cam", COLOR)
    found = source.at(125 * MS)
    np.testing.assert_allclose(found.T_WC, pose((0, 0.125, 0)) @ extrinsic, atol=1e-12)
    assert found.log_ns == 152 * MS
    assert not source.by_chain
    assert len(warnings) == bool(words)
    assert words in " ".join(warnings)


def test_odometry_goes_on_over_a_joint() -> None:
    """Body to camera over a joint that moves: both are looked up, and the later sample of both is waited for."""
    joint = [(s * MS, (s + 30) * MS, "base_link", "cam", (0.0, 0.0, 1.0), turn(s / 10)) for s in range(0, 1001, 100)]
    source, warnings = find_poses([odom("base_link"), track("/tf", *joint)], None, "cam", COLOR)
    # the chain of transforms reaches the camera and moves: base_link is its world
    assert (source.frames, source.by_chain, warnings) == (("base_link", "cam"), True, [])
    source, _ = find_poses([odom("base_link"), track("/tf", *joint)], odom("base_link"), "cam", COLOR)
    assert source.frames == ("odom", "base_link", "cam")
    found = source.at(125 * MS)
    np.testing.assert_allclose(found.T_WC, pose((0, 0.125, 0)) @ pose((0, 0, 1), turn(12.5)), atol=1e-12)
    assert found.log_ns == 230 * MS


CHAIN = track("/tf", *line("map", "base_link", STEPS))
FEW = odometry("/wheels", *line("odom", "cam", range(0, 1001, 100)))
TRUTH = stamped("/vicon/robot", *line("world", "", range(0, 1001, 125)))
POSES = stamped("/slam/pose", *line("world", "", range(0, 1001, 25)))
GOAL = stamped("/goal_pose", *line("world", "", range(0, 1001, 10)))


@pytest.mark.parametrize(
    ("tracks", "topic", "warning"),
    [
        ([POSES, odom("cam"), CHAIN, MOUNT], "/tf", ""),
        ([POSES, odom("cam"), CHAIN], "/odom", "/odom (21 messages) is used for the pose, not /slam/pose (41)"),
        ([FEW, odom("cam")], "/odom", "/odom (21 messages) is used for the pose, not /wheels (11)"),
        ([FEW, odom("cam"), TRUTH], "/vicon/robot", "is used for the pose, not /odom (21), /wheels (11) ("),
        ([GOAL, POSES], "/slam/pose", ""),
    ],
    ids=["chain", "odometry", "most", "truth", "goal"],
)  # fmt: skip
def test_the_preference(tracks: list[Track], topic: str, warning: str) -> None:
    source, warnings = find_poses(tracks, None, "cam", COLOR)
    assert source.topic == topic
    said = " ".join(w for w in warnings if "is used for the pose" in w)
    assert (warning in said) if warning else not said


def test_static_transforms_that_are_repeated_on_tf_hold_always() -> None:
    """Once a second, far apart, and only until half of the log."""
    repeated = [(s * MS, s * MS, "base_link", "cam", (0.0, 0.0, 2.0), LEVEL) for s in (-1000, 0, 500)]
    source, warnings = find_poses([track("/tf", *line("map", "base_link", STEPS), *repeated)], None, "cam", COLOR)
    assert source.at(975 * MS).T_WC[:3, 3].tolist() == pytest.approx([0, 0.975, 2])
    assert warnings == []


def test_a_robot_that_stands_has_poses_while_it_was_looked_at() -> None:
    still: list[Sample] = [(s * MS, s * MS, "map", "cam", (1.0, 0.0, 0.0), LEVEL) for s in range(100, 501, 50)]
    source, warnings = find_poses([track("/tf", *still)], None, "cam", COLOR)
    assert source.at(300 * MS) is not None
    assert source.at(600 * MS) is None
    assert warnings == [
        "11 of 20 frames have no pose: 11 lie before the first or behind the last sample of map -> cam."
    ]  # fmt: skip


def test_tf_static_that_changes() -> None:
    """A few changes: the last one holds. Many: it is a moving transform on the wrong topic."""
    moved = track("/tf_static", (0, 0, "base", "cam", (1, 0, 0), LEVEL), (0, 9, "base", "cam", (2, 0, 0), LEVEL))
    source, warnings = find_poses([track("/tf", *line("w", "base", STEPS)), moved], None, "cam", COLOR)
    assert source.at(0).T_WC[0, 3] == 2
    assert warnings == ["The static transform base -> cam changes 1 times; the last one holds for the whole log."]
    source, warnings = find_poses([track("/tf_static", *line("w", "cam", STEPS))], None, "cam", COLOR)
    assert source.at(525 * MS).T_WC[1, 3] == pytest.approx(0.525)
    assert source.topic == "/tf_static"
    assert warnings == ["The static transform w -> cam changes 20 times: taken as a moving one."]


def test_what_was_asked_for_and_cannot_be_read_is_said() -> None:
    empty = stamped("/pose")
    assert find_poses([empty, odom("cam")], empty, "cam", COLOR) == (
        None, ["/pose was asked for as the pose, but none of its messages can be read."],
    )  # fmt: skip


def test_transforms_at_a_low_rate_are_explained() -> None:
    source, warnings = find_poses([track("/tf", *line("w", "cam", range(0, 2001, 500)))], None, "cam", COLOR)
    assert [source.at(stamp) is not None for stamp in (0, 50 * MS, 500 * MS)] == [True, False, True]
    assert warnings == [
        "18 of 20 frames have no pose: 18 lie between samples of w -> cam that are more than 150 ms apart "
        "(it comes every 500 ms)."
    ]


def test_bad_samples_are_said() -> None:
    samples = line("w", "", STEPS)
    samples[3] = (*samples[3][:4], (0.0, 0.15, 0.0), (0.0, 0.0, 0.0, 2.0))
    samples[5] = (*samples[5][:4], (float("inf"), 0, 0), LEVEL)
    samples[7] = (samples[6][0], *samples[7][1:])
    _, warnings = find_poses([stamped("/pose", *samples)], None, "cam", COLOR)
    assert warnings == [
        "1 poses of /pose are not finite or have a zero quaternion: left out.",
        "1 poses of /pose have quaternions that are not of unit length (up to 2): normalised.",
        "1 poses of /pose have the stamp of an earlier one and another value: left out.",
    ]


def test_a_clock_that_was_set_back_is_said() -> None:
    again = [(s, log + 5000 * MS, *rest) for s, log, *rest in line("w", "", range(0, 3000, 50))]
    _, warnings = find_poses([stamped("/pose", *line("w", "", range(0, 3000, 50)), *again)], None, "cam", COLOR)
    assert (
        "The stamps of the poses of /pose go back by 2.950 s at log time 5002000000 ns: their clock was set back, "
        "and poses of two times are mixed up."
    ) in warnings


def test_static_transforms_between_any_two_frames() -> None:
    depth = track("/tf_static", (0, 5, "mast", "depth", (0.0, -0.1, 0.0), turn(-45)))
    repeated = track("/tf", *((s, s, "depth", "ir", (0.5, 0.0, 0.0), LEVEL) for s in range(3)))
    moving = track("/tf", *line("map", "base_link", STEPS), *line("base_link", "arm", STEPS))
    tracks = [MOUNT, depth, repeated, moving, POSES]
    T_mast_depth, T_mast_cam = pose((0, -0.1, 0), turn(-45)), pose((0, 0.2, 0), turn(60))
    cam_depth = inverse(T_mast_cam) @ T_mast_depth
    np.testing.assert_allclose(static_transform(tracks, "cam", "depth"), cam_depth, atol=1e-12)
    np.testing.assert_allclose(static_transform(tracks, "/depth", "/cam"), inverse(cam_depth), atol=1e-12)
    np.testing.assert_allclose(static_transform(tracks, "cam", "ir"), cam_depth @ pose((0.5, 0, 0)), atol=1e-12)
    np.testing.assert_allclose(static_transform(tracks, "base_link", "cam"), T_BASE_CAM, atol=1e-12)
    np.testing.assert_allclose(static_transform(tracks, "cam", "cam"), np.eye(4))
    assert static_transform(tracks, "", "") is None
    assert static_transform(tracks, "map", "cam") is None
    assert static_transform(tracks, "arm", "cam") is None
    assert static_transform(tracks, "cam", "elsewhere") is None


@pytest.mark.parametrize(
    "name", ["base_link", "robot1/base_footprint", "Body", "imu_link", "ego_vehicle", "camera_link"]
)
def test_names_of_bodies(name: str) -> None:
    assert is_body_name(name)


@pytest.mark.parametrize("name", ["camera_color_optical_frame", "cam", "", "baseline", "left_camera"])
def test_names_of_no_bodies(name: str) -> None:
    assert not is_body_name(name)


def circle(extrinsic: np.ndarray) -> Trajectory:
    """A drive in a circle of 2 m in the plane, the body's x along the path; poses of a sensor on the body."""
    angles = np.linspace(0, 2 * np.pi, 100)
    poses = np.array([pose((2 * np.sin(a), 2 - 2 * np.cos(a), 0), turn(np.degrees(a))) for a in angles])
    return Trajectory((angles * 1e9).astype(np.int64), poses @ extrinsic)


def test_body_frames_are_told_by_the_motion() -> None:
    assert looks_like_body_frame(circle(np.eye(4)))
    assert not looks_like_body_frame(circle(BODY_OPTICAL))
    assert not looks_like_body_frame(circle(pose((0, 0, 0), turn(90))))  # moves sideways
    start = inverse(BODY_OPTICAL)
    optical_world = Trajectory(circle(BODY_OPTICAL).stamps_ns, start @ circle(BODY_OPTICAL).poses)
    assert not looks_like_body_frame(optical_world)  # z of the world forward, as visual odometry has it
    body = circle(np.eye(4))
    samples: list[Sample] = [
        (int(s), int(s), "w", "", tuple(p[:3, 3]), turn(float(np.degrees(s / 1e9))))
        for s, p in zip(body.stamps_ns, body.poses, strict=True)
    ]
    _, warnings = find_poses([stamped("/pose", *samples)], None, "cam", COLOR)
    assert "move along their own x axis with z upright" in warnings[0]


def test_a_slow_edge_of_a_quick_chain_is_named() -> None:
    """Corrections at 1 Hz take the poses of odometry at 20 Hz with them."""
    slow = track("/tf", *((k * 1000 * MS, k * 1000 * MS, "map", "odom", (0.01 * k, 0, 0), LEVEL) for k in range(4)))
    quick = track("/odom_tf", *((k * 50 * MS, k * 50 * MS, "odom", "cam", (0.01 * k, 0, 0), LEVEL) for k in range(60)))
    _, (warning,) = find_poses([slow, quick], None, "cam", np.arange(1, 29) * 100 * MS)
    assert warning.endswith(
        "(it comes every 1000 ms); odom -> cam comes every 50 ms, so raise the rate of map -> odom, or record odometry "
        "and take it with --topic pose=TOPIC."
    )
