"""The doctor: every finding is provoked by one change to a healthy robot, and nothing else is found."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from encoders_ros import NS, Array
from made_up_logs import BASE_NS, PERIOD_NS, ROS, Recorder, label_picture, picture
from robots import (
    FRAMES,
    HEIGHT,
    IMAGE,
    MS,
    NAMES,
    WIDTH,
    Robot,
    both,
    depth_picture,
    drive,
    info,
    mount,
    nothing,
    odometry,
    pose_channel,
    stamp_of,
)

from stsem.log.doctor.checks import CHECKS
from stsem.log.doctor.inspection import Inspection, inspect_log
from stsem.log.log import open_log

HEALTHY = Robot()


def inspected(path: Path, **how: object) -> Inspection:
    with open_log([path], **how) as log:  # type: ignore[arg-type]
        return inspect_log(log)


def far(millimetres: float) -> Array:
    return np.full((HEIGHT, WIDTH), millimetres, "<f4")


def holes(_: int) -> Array:
    depth = np.zeros((HEIGHT, WIDTH), "<u2")
    depth[: HEIGHT // 4] = 1500
    return depth


def labels_like(value: int) -> Array:
    labels = label_picture(0).copy()
    labels[1:] = value
    return labels


def junk_image(log: Recorder) -> None:
    log.add("/other", IMAGE, "jsonschema", b"{}", "json", b"{}", BASE_NS)


def video(log: Recorder) -> None:
    log.ros("/rear", "sensor_msgs/msg/CompressedImage", ROS.compressed(BASE_NS, b"\0\0\0\1\x67", "h264"), BASE_NS)


def rear_camera(log: Recorder) -> None:
    log.ros(
        "/rear/image_raw",
        "sensor_msgs/msg/Image",
        ROS.image(BASE_NS, label_picture(0), "mono8", frame_id="rear"),
        BASE_NS,
    )


def changing(stamp: int) -> bytes:
    return info(stamp) if stamp < stamp_of(12) else info(stamp, k=(33.0, 0, 15.5, 0, 33, 11.5, 0, 0, 1))


def uneven(i: int) -> int:
    return stamp_of(i) + (i % 3) * 40 * MS


def paused(i: int) -> int:
    return stamp_of(i) + (i >= 12) * 3 * NS


def static_twice(log: Recorder) -> None:
    for z in (0.5, 0.6):
        link = ("base", "camera", (0.0, 0.0, z), (0.0, 0.0, 0.0, 1.0))
        log.ros("/tf_static", "tf2_msgs/msg/TFMessage", ROS.tf(BASE_NS, [link]), BASE_NS)


BROKEN: dict[str, tuple[str, Robot]] = {
    "not-read": ("", replace(HEALTHY, others=junk_image)),
    "video-codec": ("h264", replace(HEALTHY, others=video)),
    "choice-unclear": (
        "/b (50)",
        replace(HEALTHY, static=nothing, poses=both(pose_channel("/a"), pose_channel("/b"))),
    ),
    "image-dark": ("24 of 24 colour images looked at are dark", replace(HEALTHY, color=lambda i: picture(i) // 64)),
    "intrinsics-zero": ("K is zero", replace(HEALTHY, info=lambda stamp: info(stamp, k=(0.0,) * 9))),
    "intrinsics-missing": (
        "/cam/color/image_raw has none",
        replace(
            HEALTHY, info=lambda stamp: info(stamp, frame_id="depth"), info_topic="/cam/info",
            depth_frame="depth",
        ),
    ),
    "intrinsics-implausible": (
        "0.6 degrees across",
        replace(HEALTHY, info=lambda stamp: info(stamp, k=(3000.0, 0, 15.5, 0, 3000, 11.5, 0, 0, 1))),
    ),
    "intrinsics-shape": ("64x64", replace(HEALTHY, info=lambda stamp: info(stamp, width=64, height=64, k=(
        60.0, 0, 31.5, 0, 80, 31.5, 0, 0, 1)))),
    "intrinsics-change": ("changes 1 times", replace(HEALTHY, info=changing)),
    "distortion-unknown": ("", replace(HEALTHY, info=lambda stamp: info(stamp, model="curly", d=(0.1,) * 5))),
    "depth-unit": ("is 1000 m or more", replace(HEALTHY, depth=lambda i: far(1500.0 + i), depth_encoding="32FC1")),
    "depth-unknown": ("75% of the pixels", replace(HEALTHY, depth=holes)),
    "depth-unregistered": (
        "frame 'depth'",
        replace(HEALTHY, depth=lambda i: depth_picture(i)[::2, :20].copy(), depth_frame="depth"),
    ),
    "depth-assumed": ("is in frame 'depth'", replace(HEALTHY, depth_frame="depth")),
    "depth-sparse": (
        "8 of 24 frames (33%)", replace(HEALTHY, depth=lambda i: None if i % 3 else depth_picture(i)),
    ),
    "pose-missing": ("frames have no pose", replace(HEALTHY, stamp=lambda i: stamp_of(i) + NS)),
    "pose-jumps": ("jumps once by 5.0", replace(HEALTHY, poses=drive(at=lambda y: y + 5 * (y > 0.2)))),
    "pose-still": ("within 0.00 mm", replace(HEALTHY, poses=drive(at=lambda y: 0.0))),
    "pose-body-frame": ("sit in 'base_link'", replace(HEALTHY, static=nothing, poses=odometry("base_link"))),
    "pose-tree": ("No transform moves the camera's frame", replace(HEALTHY, static=mount("base", "lidar"))),
    "pose-static": ("base -> camera changes 1 times", replace(HEALTHY, static=static_twice)),
    "pose-frames": (
        "in several frames",
        replace(HEALTHY, static=nothing, poses=pose_channel("/p", lambda j: "map" if j == 3 else "odom")),
    ),
    "pose-values": (
        "zero quaternion",
        replace(HEALTHY, static=nothing, poses=pose_channel("/p", q_of=lambda j: (0.0, 0, 0, float(j != 3)))),
    ),
    "map-impossible": ("no depth and no poses", replace(HEALTHY, depth=lambda i: None, poses=nothing, static=nothing)),
    "truth-missing": ("no label images", replace(HEALTHY, labels=lambda i: None)),
    "truth-other-camera": (
        "/gt/labels (frame 'rear') belongs to /rear/image_raw and not to /cam/color/image_raw (frame 'camera')",
        replace(HEALTHY, labels_frame="rear", others=rear_camera),
    ),
    "truth-shape": ("/gt/labels is 20x24", replace(HEALTHY, labels=lambda i: label_picture(i)[:, :20].copy())),
    "truth-no-table": ("/gt/labels", replace(HEALTHY, tables=())),
    "truth-two-tables": ("changes its class table 1 times", replace(HEALTHY, tables=({0: "sky"}, NAMES))),
    "truth-unknown-ids": ("outside the class table", replace(HEALTHY, labels=lambda i: label_picture(i, classes=4))),
    "truth-sparse": ("8 of 24 frames (33%)", replace(HEALTHY, labels=lambda i: None if i % 3 else label_picture(i))),
    "truth-inexact": ("24 label images", replace(HEALTHY, labels_stamp=lambda stamp: stamp + 7 * MS)),
    "truth-ignored": ("are to be ignored", replace(HEALTHY, labels=lambda i: np.where(
        np.arange(WIDTH) < 20, np.uint8(255), label_picture(i)))),
    "truth-one-class": ("100.0% of the labelled", replace(HEALTHY, labels=lambda i: labels_like(1))),
    "clock-offset": ("5.000 s behind", replace(HEALTHY, color_log=lambda stamp: stamp + 5 * NS)),
    "clock-skew": ("35.0 ms before", replace(HEALTHY, depth_stamp=lambda stamp: stamp - 35 * MS)),
    "clock-reset": (
        "/cam/depth/image_raw was set back",
        replace(HEALTHY, depth_stamp=lambda stamp: stamp - 100 * NS * (stamp > stamp_of(21) - 1)),
    ),
    "clock-unstamped": ("24 of 24 messages", replace(HEALTHY, color_stamp=lambda stamp: 0)),
    "clock-late": ("All 24 stamps", replace(HEALTHY, color_log=lambda stamp: stamp)),
    "rate-uneven": ("of 23 intervals", replace(HEALTHY, stamp=uneven)),
    "gaps": ("a gap of 3.100 s", replace(HEALTHY, stamp=paused)),
    "duplicates": ("1 images", replace(HEALTHY, stamp=lambda i: stamp_of(i - (i == 12)))),
}  # fmt: skip
"""Name of a finding -> words of it, and the robot that has it."""

BESIDES = {
    "intrinsics-missing": {"depth-assumed"},
    "gaps": {"pose-missing"},
    "clock-unstamped": {"truth-inexact"},
    "clock-reset": {"depth-sparse"},
}
"""What comes with some of them, because it is true as well."""


def test_a_healthy_robot(tmp_path: Path) -> None:
    found = inspected(HEALTHY.record(tmp_path / "log.mcap"))
    assert (found.findings, found.notes) == ((), ())


@pytest.mark.parametrize("name", BROKEN)
def test_each_finding_alone(name: str, tmp_path: Path) -> None:
    words, robot = BROKEN[name]
    found = inspected(robot.record(tmp_path / "log.mcap"))
    assert {finding.name for finding in found.findings} == {name, *BESIDES.get(name, ())}
    finding = next(f for f in found.findings if f.name == name)
    assert words in finding.what
    assert finding.do == next(check.do for check in CHECKS if check.name == name)


def test_findings_about_bytes(tmp_path: Path) -> None:
    """Checksums left out, a file cut, a part of a folder unfinished, depth that no decoder takes, poses of no sense."""

    def names(path: Path, **how: object) -> set[str]:
        return {finding.name for finding in inspected(path, **how).findings}

    assert names(HEALTHY.record(tmp_path / "a.mcap", enable_crcs=False)) == {"unprotected"}
    path = HEALTHY.record(tmp_path / "b.mcap")
    path.write_bytes(path.read_bytes()[:-8])
    assert names(path) == {"damage"}
    folder = tmp_path / "run"
    folder.mkdir()
    HEALTHY.record(folder / "run_0.mcap")
    (folder / "run_1.mcap.active").write_bytes(b"\x89MCAP0\r\n")
    assert names(folder) == {"file-unfinished"}
    short = replace(HEALTHY, depth_size=(64, 48))
    assert names(short.record(tmp_path / "c.mcap")) == {"depth-undecodable", "undecodable"}

    def garbage(log: Recorder) -> None:
        log.ros("/p", "geometry_msgs/msg/PoseStamped", b"\0\1\0\0", BASE_NS)

    path = replace(HEALTHY, poses=garbage, static=nothing).record(tmp_path / "d.mcap")
    assert names(path, topics={"pose": "/p"}) == {"pose-unreadable", "undecodable"}


@pytest.mark.parametrize("wrong", [{"k": (math.nan,) * 9}, {"d": (math.nan,) * 5}], ids=["K", "D"])
def test_a_calibration_that_is_not_finite_is_no_damage_of_the_file(tmp_path: Path, wrong: dict[str, Any]) -> None:
    """What is to be done about it is not to copy the log."""
    found = inspected(replace(HEALTHY, info=lambda stamp: info(stamp, **wrong)).record(tmp_path / "log.mcap"))
    assert [finding.name for finding in found.findings] == ["intrinsics-implausible", "map-impossible"]
    assert "cannot be used; the first: " in found.findings[0].what
    assert found.damage["lossy"]


def test_a_calibration_that_changes_is_said_once(tmp_path: Path) -> None:
    """Though depth, of twice the size, is registered by the same one."""

    def larger(stamp_ns: int) -> bytes:
        f = 120.0 if stamp_ns < stamp_of(2) else 130.0
        return info(stamp_ns, width=2 * WIDTH, height=2 * HEIGHT, k=(f, 0, 70.0, 0, f, 40.0, 0, 0, 1))

    robot = replace(HEALTHY, info=larger, depth=lambda i: depth_picture(i).repeat(2, 0).repeat(2, 1))
    found = inspected(robot.record(tmp_path / "log.mcap"))
    assert [finding.name for finding in found.findings].count("intrinsics-change") == 1
    assert any("is registered to" in note for note in found.notes)


@pytest.mark.parametrize(("frame", "found"), [("camera_link", True), ("camera_optical_frame", False)])
def test_images_in_a_frame_of_body_axes(tmp_path: Path, frame: str, found: bool) -> None:
    """The chain leads to the frame of the images, but a driver stamped them with the mount's."""
    robot = replace(HEALTHY, static=mount("base", frame), color_frame=frame, depth_frame=frame, labels_frame=frame,
                    info=lambda stamp: info(stamp, frame_id=frame))  # fmt: skip
    findings = inspected(robot.record(tmp_path / "log.mcap")).findings
    assert [finding.name for finding in findings] == ["pose-body-frame"] * found
    assert all(f"in frame {frame!r}, whose z axis points up in 'world'" in finding.what for finding in findings)


def test_every_check_is_tested() -> None:
    elsewhere = {"unprotected", "damage", "undecodable", "file-unfinished", "depth-undecodable", "pose-unreadable"}
    assert {check.name for check in CHECKS if check.do} == BROKEN.keys() | elsewhere
    assert len({check.name for check in CHECKS}) == len(CHECKS)


def test_notes_are_no_findings(tmp_path: Path) -> None:
    """Distortion that is undone and intrinsics that are scaled are worth knowing, and nothing to do about."""
    robot = replace(HEALTHY, info=lambda stamp: info(
        stamp, width=64, height=48, k=(60.0, 0, 31.5, 0, 60, 23.5, 0, 0, 1), d=(0.1, 0.0, 0.0, 0.0, 0.0)))  # fmt: skip
    found = inspected(robot.record(tmp_path / "log.mcap"))
    assert found.findings == ()
    assert len(found.notes) == 2
    assert found.camera is not None
    assert found.camera.distortion == "undone"


def test_images_of_one_colour_and_16_bits_of_metres(tmp_path: Path) -> None:
    """The other halves of two checks."""
    grey = replace(HEALTHY, color=lambda i: np.full((HEIGHT, WIDTH, 3), 90, np.uint8))
    (finding,) = inspected(grey.record(tmp_path / "a.mcap")).findings
    assert "24 of 24 colour images looked at are of one colour only" in finding.what
    metres = replace(HEALTHY, depth=lambda i: np.full((HEIGHT, WIDTH), 2, "<u2"))
    (finding,) = inspected(metres.record(tmp_path / "b.mcap")).findings
    assert finding.what.startswith("The median depth of /cam/depth/image_raw (16UC1) is 0.002 m")


def test_the_path_of_the_camera(tmp_path: Path) -> None:
    pose = inspected(HEALTHY.record(tmp_path / "log.mcap")).pose
    assert pose is not None
    assert pose.frames == ("world", "base", "camera")
    assert pose.samples == 2 * FRAMES + 2
    assert pose.path_m == pytest.approx(0.01 * (2 * FRAMES + 1))
    assert pose.largest_gap_s == PERIOD_NS / 2e9


def test_why_a_channel_is_used(tmp_path: Path) -> None:
    found = inspected(HEALTHY.record(tmp_path / "log.mcap"), topics={"color": "/cam/color/image_raw"})
    assert found.reasons == {
        "color": "asked for", "depth": "only one", "labels": "only one", "pose": "chain of transforms",
        "calibration": "belongs to color",
    }  # fmt: skip
