"""Jumps of the pose: seen, reported, and never bridged; fast robots and far frames do not jump."""

import numpy as np
from made_up_logs import LEVEL
from made_up_tracks import MS, Sample, line, pose, stamped, track, turn

from stsem.log.poses.find import find_poses
from stsem.log.poses.source import PoseSource
from stsem.log.tracks import Int64, Track

COLOR: Int64 = np.arange(0, 1000 * MS, 50 * MS, np.int64)
STEPS = range(0, 1001, 50)


def poses(*tracks: Track) -> tuple[PoseSource, list[str]]:
    source, warnings = find_poses(list(tracks), None, "cam", COLOR)
    assert source is not None
    return source, [warning for warning in warnings if "jumps" in warning]


def with_step(samples: list[Sample], at: int, by: float) -> list[Sample]:
    """The samples from number `at` on lie `by` metres farther along x."""
    return [(*s[:4], (s[4][0] + by * (i >= at), s[4][1], s[4][2]), s[5]) for i, s in enumerate(samples)]


def test_a_jump_is_reported_and_not_bridged() -> None:
    source, warnings = poses(stamped("/pose", *with_step(line("w", "", STEPS), 10, 0.6)))
    assert warnings == [
        "The pose jumps once by 0.60 m and 0 degrees at t = 0.500 s (/pose); between the samples around a jump it is "
        "unknown."
    ]
    assert source.at(475 * MS) is None
    assert source.at(450 * MS).T_WC[:3, 3].tolist() == [0, 0.45, 0]
    np.testing.assert_allclose(source.at(525 * MS).T_WC[:3, 3], [0.6, 0.525, 0])
    trajectory = source.trajectory()
    assert trajectory.at(475 * MS, 150 * MS) is None
    assert trajectory.at(425 * MS, 150 * MS) is not None


def test_a_single_wrong_sample_jumps_there_and_back() -> None:
    samples = with_step(with_step(line("w", "", STEPS), 10, 3.0), 11, -3.0)
    source, warnings = poses(stamped("/pose", *samples))
    assert "jumps 2 times, the farthest by 3.00 m" in warnings[0]
    assert [source.at(stamp * MS) is not None for stamp in (425, 475, 500, 525, 575)] == [
        True,
        False,
        True,
        False,
        True,
    ]


def test_turns_jump_too() -> None:
    samples = [(*s[:5], turn(3 * i + 90 * (i >= 10))) for i, s in enumerate(line("w", "", STEPS))]
    source, warnings = poses(stamped("/pose", *samples))
    assert "by 0.05 m and 93 degrees at t = 0.500 s" in warnings[0]
    assert source.at(475 * MS) is None


def test_small_corrections_and_fast_robots_do_not_jump() -> None:
    """Below 0.3 m or 5 m/s nothing jumps; a car at 20 m/s does not, nor one that starts and brakes."""
    assert not poses(stamped("/pose", *with_step(line("w", "", STEPS), 10, 0.28)))[1]
    assert not poses(stamped("/pose", *with_step(line("w", "", range(0, 1001, 100)), 5, 0.45)))[1]
    assert not poses(stamped("/pose", *line("w", "", STEPS, speed=20)))[1]
    t = np.arange(0, 10_001, 100)
    y = 60 * (1 - np.cos(2 * np.pi * t / 10_000))  # up to 38 m/s, and back
    drive = [(int(s) * MS, int(s) * MS, "w", "", (0.0, float(v), 0.0), LEVEL) for s, v in zip(t, y, strict=True)]
    assert not poses(stamped("/pose", *drive))[1]


def test_a_fast_car_jumps_when_it_leaves_its_own_motion() -> None:
    source, warnings = poses(stamped("/pose", *with_step(line("w", "", STEPS, speed=20), 10, 15.0)))
    assert "jumps once by 15.03 m" in warnings[0]
    assert source.at(475 * MS) is None


def test_a_turn_of_a_far_frame_is_no_jump_where_the_robot_is() -> None:
    """Localisation turns map -> odom about the robot, 100 m from the origin of odom: the camera stays where it was."""
    there = pose((100, 0, 0))
    corrected = there @ pose((0, 0, 0), turn(3)) @ np.linalg.inv(there)
    still, shifted = (0.0, 0.0, 0.0), tuple(float(v) for v in corrected[:3, 3])
    localised = [
        (s * MS, s * MS, "map", "odom", shifted if s >= 500 else still, turn(3 if s >= 500 else 0)) for s in STEPS
    ]
    driven = [(*s[:4], (100.0, s[4][1], 0.0), LEVEL) for s in line("odom", "cam", range(0, 1001, 10))]
    source, warnings = poses(track("/tf", *localised, *driven))
    assert np.linalg.norm(shifted) > 5
    assert warnings == []
    assert source.at(475 * MS) is not None


def test_a_relocalisation_breaks_the_chain_between_its_samples() -> None:
    """map -> odom at 20 Hz jumps; odom -> cam at 100 Hz goes on: the camera is unknown while map -> odom is."""
    localised = [(s * MS, s * MS, "map", "odom", (2.0 * (s >= 500), 0.0, 0.0), LEVEL) for s in STEPS]
    source, warnings = poses(track("/tf", *localised, *line("odom", "cam", range(0, 1001, 10))))
    assert "jumps once by 2.00 m and 0 degrees at t = 0.500 s (map -> odom)" in warnings[0]
    known = [s for s in range(430, 530, 5) if source.at(s * MS) is not None]
    assert known == [430, 435, 440, 445, 450, 500, 505, 510, 515, 520, 525]
    trajectory = source.trajectory()
    assert set(range(460, 500, 10)).isdisjoint((trajectory.stamps_ns // MS).tolist())
    assert trajectory.at(475 * MS, 150 * MS) is None
    for stamp, T_WC in zip(trajectory.stamps_ns, trajectory.poses, strict=True):
        np.testing.assert_allclose(source.at(int(stamp)).T_WC, T_WC)


def test_frames_in_a_jump_are_counted() -> None:
    """Samples lie between the frames, so three jumps cost three frames their pose."""
    samples = line("w", "", range(-25, 1001, 50))
    for at in (4, 9, 15):
        samples = with_step(samples, at, 1.0)
    _, warnings = find_poses([stamped("/pose", *samples)], None, "cam", COLOR)
    assert "jumps 3 times, the farthest by 1.00 m" in warnings[0]
    assert warnings[1:] == ["3 of 20 frames have no pose: they lie where the pose jumps."]
