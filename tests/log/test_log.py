"""An opened log: frames, truth, arrivals, windows, clocks, and what happens when some of it is broken."""

import threading
from collections.abc import Callable
from pathlib import Path

import foxglove.messages as fox
import numpy as np
import pytest
from made_up_logs import BASE_NS, LEVEL, NS, PERIOD_NS, ROS, Recorder, label_picture, picture, png, room

from stsem.camera import Camera
from stsem.errors import ChannelError, DecodeError, LogError, UsageError
from stsem.log.log import Loaded, Log, open_log

BOTH = frozenset({"depth", "pose"})
IMAGE = "sensor_msgs/msg/Image"
MS = 1_000_000


def everything(log: Log) -> list[Loaded]:
    return list(log.frames(range(len(log.plans)), depth=True, previous=True, truth=True))


def color(log: Recorder, i: int, *, offset_ns: int = 5 * MS, pixels: np.ndarray | None = None) -> None:
    stamp = BASE_NS + i * PERIOD_NS
    log.ros("/cam", IMAGE, ROS.image(stamp, picture(i) if pixels is None else pixels, "rgb8"), stamp + offset_ns)


def labels(
    log: Recorder, i: int, pixels: np.ndarray, *, offset_ns: int = 6 * MS, encoding: str = "mono8", late: int = 0
) -> None:
    stamp = BASE_NS + i * PERIOD_NS + late
    log.ros("/labels", IMAGE, ROS.image(stamp, pixels, encoding), stamp + offset_ns)


def test_frames_are_what_was_recorded(room_log: Path) -> None:
    with open_log([room_log]) as log:
        assert log.classes is not None
        assert log.classes.names == ("wall", "floor", "door")
        assert log.camera == Camera(32, 24, 30, 30, 15.5, 11.5)
        assert (log.period_ns, log.size, log.info.duration_s) == (PERIOD_NS, (32, 24), 0.5)
        for i, loaded in enumerate(everything(log)):
            assert loaded.error is None
            frame = loaded.frame
            assert frame is not None
            assert (frame.index, frame.stamp_ns) == (i, BASE_NS + i * PERIOD_NS)
            np.testing.assert_array_equal(frame.image, picture(i))
            assert frame.depth is not None
            assert np.isnan(frame.depth[0, :2]).all()
            assert (frame.depth[1:] == np.float32((1000 + i) / 1000)).all()
            expected = np.eye(4)
            expected[:3, 3] = i, 0, 0.5
            np.testing.assert_allclose(frame.T_WC, expected, atol=1e-9)
            assert (frame.previous is None) == (i == 0)
            if frame.previous is not None:
                np.testing.assert_array_equal(frame.previous, picture(i - 1))
            np.testing.assert_array_equal(loaded.truth, label_picture(i))
        assert not log.info.damage.lossy
        assert log.info.warnings == ()


def test_what_is_not_asked_for_is_not_decoded(room_log: Path) -> None:
    with open_log([room_log]) as log:
        (loaded,) = log.frames([3], depth=False, previous=False, truth=False)
        assert loaded.frame is not None
        assert (loaded.frame.depth, loaded.frame.previous, loaded.truth) == (None, None, None)


def test_plans_know_the_arrival(room_log: Path) -> None:
    """Colour is logged after 5 ms, depth after 9; the pose needs the sample 50 ms later, logged 2 ms after that."""
    with open_log([room_log]) as log:
        plan = log.plans[2]
        stamp = BASE_NS + 2 * PERIOD_NS
        assert (plan.color_log_ns, plan.depth_log_ns) == (stamp + 5 * MS, stamp + 9 * MS)
        assert (plan.pose_log_ns, plan.truth_log_ns) == (stamp + 52 * MS, stamp + 20 * MS)
        assert plan.arrival_ns(frozenset({"depth"})) == stamp + 9 * MS
        assert plan.arrival_ns(BOTH) == stamp + 52 * MS
        assert plan.missing(BOTH) == ()
        assert log.trajectory is not None
        assert len(log.trajectory) == 7  # 12 messages, of which neighbours share their stamp
        assert [p.index for p in log.plans] == list(range(6))


def test_random_access_equals_going_in_order(room_log: Path) -> None:
    with open_log([room_log]) as log:
        in_order = {loaded.index: loaded for loaded in everything(log)}
        for index in (5, 0, 3, 3, 1):
            frame = log.frame(index, depth=True, previous=True)
            for name in ("image", "depth", "previous", "T_WC"):
                np.testing.assert_array_equal(getattr(frame, name), getattr(in_order[index].frame, name))


def test_the_window_counts_its_own_frames_but_looks_outside_for_poses_and_the_previous_image(room_log: Path) -> None:
    with open_log([room_log], start_s=0.2, end_s=0.4) as log:
        assert [(plan.index, plan.stamp_ns) for plan in log.plans] == [
            (0, BASE_NS + 2 * PERIOD_NS), (1, BASE_NS + 3 * PERIOD_NS),
        ]  # fmt: skip
        frame = log.frame(0, depth=True, previous=True)
        np.testing.assert_array_equal(frame.previous, picture(1))
        assert frame.T_WC is not None
        np.testing.assert_array_equal(log.truth(1), label_picture(3))
        assert log.info.duration_s == 0.5
    with pytest.raises(UsageError, match="No colour frame"):
        open_log([room_log], start_s=5)


def test_an_undecodable_colour_image_is_an_error_of_its_frame_only(recorder: Callable[..., Recorder]) -> None:
    """The previous image of the next frame is the last one that could be decoded; truth is still there."""
    log = recorder()
    for i in range(4):
        color(log, i, pixels=picture(i, 16, 12) if i == 1 else None)
        labels(log, i, label_picture(i))
    log.writer.add_metadata("stsem.classes", {"0": "a", "1": "b", "2": "c"})
    with open_log([log.close()]) as opened:
        for _ in range(2):
            first, bad, third, _ = everything(opened)
        assert bad.frame is None
        assert str(bad.error) == f"/cam at {BASE_NS + PERIOD_NS} ns: the image is 16x12, but 32x24 is expected."
        np.testing.assert_array_equal(bad.truth, label_picture(1))
        assert first.frame is not None
        assert third.frame is not None
        np.testing.assert_array_equal(third.frame.previous, first.frame.image)
        assert opened.info.damage.counts == {"undecodable": {"/cam": 1}}
        with pytest.raises(DecodeError):
            opened.frame(1, depth=False, previous=False)


def test_undecodable_depth_and_truth_are_absent_and_counted(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    for i in range(3):
        stamp = BASE_NS + i * PERIOD_NS
        color(log, i)
        depth, truth = np.full((24, 32), 500, "<u2"), label_picture(i)
        log.ros("/depth", IMAGE, ROS.image(stamp, depth[: 20 if i == 1 else 24], "16UC1"), stamp)
        labels(log, i, truth, encoding="yuv9" if i == 1 else "mono8")
    log.writer.add_metadata("stsem.classes", {"0": "a", "1": "b", "2": "c"})
    with open_log([log.close()]) as opened:
        loaded = everything(opened)
        assert [x.frame.depth is not None for x in loaded if x.frame] == [True, False, True]
        assert [x.truth is not None for x in loaded] == [True, False, True]
        assert opened.plans[1].has_truth
        assert opened.info.damage.counts == {"undecodable": {"/depth": 1, "/labels": 1}}


def test_labels_without_a_table_and_a_table_without_labels(recorder: Callable[..., Recorder], tmp_path: Path) -> None:
    log = recorder("bare.mcap")
    color(log, 0)
    labels(log, 0, label_picture(0))
    bare = log.close()
    with open_log([bare]) as opened:
        assert (opened.classes, opened.truth(0), opened.plans[0].has_truth) == (None, None, False)
        assert "accuracy cannot be measured (give --classes FILE)" in opened.info.warnings[0]
    (tmp_path / "names.json").write_text('["a", "b", "c"]')
    with open_log([bare], classes_file=tmp_path / "names.json") as opened:
        np.testing.assert_array_equal(opened.truth(0), label_picture(0))
    log = recorder("unlabelled.mcap")
    color(log, 0)
    log.writer.add_metadata("stsem.classes", {"0": "a"})
    log.writer.add_attachment(0, 0, "classes.json", "application/json", b"{broken")  # nobody needs it
    with open_log([log.close()]) as opened:
        assert (opened.classes, opened.truth(0), opened.info.warnings) == (None, None, ())


def test_ids_outside_the_table_are_ignored_and_said(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    truth = np.array([[0, 7, 0, 0], [9, 255, 0, 0], [0, 0, 0, 0]], np.uint8)
    for i in range(2):
        color(log, i)
        labels(log, i, truth)
    log.writer.add_metadata("stsem.classes", {"7": "b", "0": "a"})
    with open_log([log.close()]) as opened:
        for _ in range(2):
            got = opened.truth(0)
            assert got is not None
            assert got.tolist() == [[0, 1, 0, 0], [255, 255, 0, 0], [0, 0, 0, 0]]
        assert opened.info.warnings == (
            "1 pixels in 1 label images have an id or colour outside the class table: ignored.",
        )  # fmt: skip


def test_labels_in_colours_and_late_labels(recorder: Callable[..., Recorder]) -> None:
    """A palette names the colours; all labels are logged after the last image, one 30 ms off its stamp."""
    log = recorder()
    for i in range(3):
        color(log, i)
    palette = np.array([[10, 20, 30], [200, 100, 0]], np.uint8)
    for i in range(3):
        labels(
            log, i, palette[label_picture(i, 2) % 2], offset_ns=5 * NS // 10, encoding="rgb8", late=30 * MS * (i == 2)
        )
    log.writer.add_metadata("stsem.classes", {"sky": "#c86400 9", "road": "#0a141e 4"})
    with open_log([log.close()]) as opened:
        assert opened.classes is not None
        assert opened.classes.names == ("road", "sky")
        assert opened.classes.colours == ((10, 20, 30), (200, 100, 0))
        for i in range(3):
            np.testing.assert_array_equal(opened.truth(i), label_picture(i, 2) % 2)
        assert opened.info.warnings == (
            "1 label images have no colour image of exactly their stamp and went to the nearest one.",
        )  # fmt: skip


def test_skewed_clocks_are_taken_out_and_said(recorder: Callable[..., Recorder]) -> None:
    """The recorder's clock is an hour ahead of the camera's, and two ms behind that of the poses."""
    log = recorder()
    for i in range(3):
        color(log, i, offset_ns=3600 * NS + i * MS)
        stamp = BASE_NS + i * PERIOD_NS
        log.ros("/pose", "geometry_msgs/msg/PoseStamped", ROS.pose(stamp, (i, 0, 0)), stamp - 2 * MS)
    with open_log([log.close()]) as opened:
        assert opened.info.clock_offsets_ns == {"/cam": 3600 * NS, "/pose": -2 * MS}
        assert [plan.color_log_ns - plan.stamp_ns for plan in opened.plans] == [0, MS, 2 * MS]
        assert [plan.arrival_ns(BOTH) - plan.stamp_ns for plan in opened.plans] == [0, MS, 2 * MS]
        assert len(opened.info.warnings) == 2
        assert "The clock of /cam is off" in opened.info.warnings[0]


def test_without_stamps_the_log_time_counts_and_is_said(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    for i in range(3):
        log.ros("/cam", IMAGE, ROS.image(0, picture(i), "rgb8"), BASE_NS + i * PERIOD_NS)
    with open_log([log.close()]) as opened:
        assert [plan.stamp_ns for plan in opened.plans] == [BASE_NS + i * PERIOD_NS for i in range(3)]
        assert opened.info.warnings == ("3 of 3 messages on /cam have no capture stamp: their log time is used.",)


@pytest.mark.parametrize(("registered", "used"), [("auto", True), ("yes", True), ("no", False)])
def test_depth_in_another_frame(recorder: Callable[..., Recorder], registered: str, used: bool) -> None:
    log = recorder()
    color(log, 0)
    log.ros("/depth", IMAGE, ROS.image(BASE_NS, np.full((24, 32), 9, "<u2"), "16UC1", frame_id="ir"), BASE_NS)
    with open_log([log.close()], depth_registered=registered) as opened:
        assert (opened.info.choice.depth is not None) == used
        assert (opened.frame(0, depth=True, previous=False).depth is not None) == used
        assert len(opened.info.warnings) == (registered != "yes")


def test_depth_of_another_size_is_not_used_and_said(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    color(log, 0)
    log.ros("/depth", IMAGE, ROS.image(BASE_NS, np.full((12, 16), 9, "<u2"), "16UC1"), BASE_NS)
    path = log.close()
    with open_log([path]) as opened:
        assert opened.plans[0].missing(BOTH) == ("depth", "pose")
        assert opened.info.warnings[0] == (
            "/depth (16x12, frame 'camera') is not on the pixels of /cam (32x24, frame 'camera'), and to register it "
            "the log lacks a usable calibration of /depth and a usable calibration of /cam: depth is not used "
            "(record that, or say --depth-registered yes if its pixels are those of colour)."
        )
    with pytest.raises(UsageError, match="--depth-registered is 'maybe', but it can be auto, yes, no"):
        open_log([path], depth_registered="maybe")


def test_calibration_of_another_size_is_scaled(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    color(log, 0)
    info = ROS.camera_info(BASE_NS, 64, 48, [60, 0, 31.5, 0, 60, 23.5, 0, 0, 1])
    log.ros("/camera_info", "sensor_msgs/msg/CameraInfo", info, BASE_NS)
    with open_log([log.close()]) as opened:
        assert opened.camera == Camera(32, 24, 30, 30, 15.5, 11.5)
        assert "/camera_info is for 64x48, the images are 32x24: intrinsics are scaled." in opened.info.warnings


def test_a_foxglove_log(recorder: Callable[..., Recorder]) -> None:
    """The same through protobuf: RawImage, CompressedImage, CameraCalibration, PoseInFrame, attachment."""
    log = recorder()
    for i in range(3):
        stamp = BASE_NS + i * PERIOD_NS
        head = {"timestamp": fox.Timestamp(sec=stamp // NS, nsec=stamp % NS), "frame_id": "cam"}
        size = {"width": 32, "height": 24}
        depth = np.full((24, 32), 1 + i, "<f4").tobytes()
        k = [30, 0, 15.5, 0, 30, 11.5, 0, 0, 1]
        pose = fox.Pose(position=fox.Vector3(x=i, y=0, z=0), orientation=fox.Quaternion(x=0, y=0, z=0, w=1))
        log.fox(
            "/camera/color", fox.RawImage(**head, **size, encoding="rgb8", step=96, data=picture(i).tobytes()), stamp
        )
        log.fox("/camera/depth", fox.RawImage(**head, **size, encoding="32FC1", step=128, data=depth), stamp)
        log.fox("/gt/labels", fox.CompressedImage(**head, data=png(label_picture(i)), format="png"), stamp)
        log.fox("/camera/calibration", fox.CameraCalibration(**head, **size, K=k), stamp)
        log.fox("/pose", fox.PoseInFrame(timestamp=head["timestamp"], frame_id="world", pose=pose), stamp)
    log.writer.add_attachment(0, 0, "classes.json", "application/json", b'{"names": ["a", "b", "c"]}')
    with open_log([log.close()]) as opened:
        for i, loaded in enumerate(everything(opened)):
            assert loaded.frame is not None
            np.testing.assert_array_equal(loaded.frame.image, picture(i))
            assert (loaded.frame.depth == 1 + i).all()
            np.testing.assert_array_equal(loaded.truth, label_picture(i))
            assert loaded.frame.T_WC[0, 3] == i
        assert opened.camera == Camera(32, 24, 30, 30, 15.5, 11.5)
        assert {channel.topic: channel.role for channel in opened.info.channels} == {
            "/camera/color": "color", "/camera/depth": "depth", "/gt/labels": "labels",
            "/camera/calibration": "calibration", "/pose": "pose",
        }  # fmt: skip


def test_a_split_recording_keeps_its_static_transforms(tmp_path: Path) -> None:
    """tf_static and the class table stand only in the first file."""
    folder = tmp_path / "run"
    folder.mkdir()
    whole = room(tmp_path / "whole.mcap", frames=4)
    for part in range(2):
        log = Recorder(folder / f"run_{part}.mcap")
        if part == 0:
            names = {0: "wall", 1: "floor", 2: "door"}
            log.ros("/gt/label_info", "vision_msgs/msg/LabelInfo", ROS.label_info(BASE_NS, names), BASE_NS)
            static = ROS.tf(BASE_NS, [("base", "camera", (0.0, 0.0, 0.5), LEVEL)])
            log.ros("/tf_static", "tf2_msgs/msg/TFMessage", static, BASE_NS)
        for i in (2 * part, 2 * part + 1):
            stamp = BASE_NS + i * PERIOD_NS
            for k in (-50 * MS, 50 * MS):
                moved = ROS.tf(stamp + k, [("world", "base", (i + k / PERIOD_NS, 0.0, 0.0), LEVEL)])
                log.ros("/tf", "tf2_msgs/msg/TFMessage", moved, stamp + k)
            log.ros("/cam/color/image_raw", IMAGE, ROS.image(stamp, picture(i), "rgb8"), stamp)
            log.ros("/gt/labels", IMAGE, ROS.image(stamp, label_picture(i), "mono8"), stamp)
        log.close()
    with open_log([folder]) as split, open_log([whole]) as one:
        assert split.info.name == "run"
        assert [source.name for source in split.info.sources] == ["run_0.mcap", "run_1.mcap"]
        assert len(split.plans) == len(one.plans) == 4
        for a, b in zip(everything(split), everything(one), strict=True):
            assert a.frame is not None
            assert b.frame is not None
            np.testing.assert_allclose(a.frame.T_WC, b.frame.T_WC, atol=1e-9)
            np.testing.assert_array_equal(a.frame.image, b.frame.image)
            np.testing.assert_array_equal(a.truth, b.truth)


def test_a_damaged_log_is_opened_and_lossy(room_log: Path) -> None:
    data = room_log.read_bytes()
    room_log.write_bytes(data[: len(data) // 2])
    with open_log([room_log]) as log:
        loaded = everything(log)
        assert 1 <= len(loaded) < 6
        for i, one in enumerate(loaded):
            assert one.frame is not None
            np.testing.assert_array_equal(one.frame.image, picture(i))
        assert log.info.damage.as_dict() == {"lossy": True, "counts": {"truncated": {"": 1}}}


def test_a_log_with_nothing_left_names_its_damage(room_log: Path) -> None:
    room_log.write_bytes(room_log.read_bytes()[:500])
    with pytest.raises(
        ChannelError, match=r"no colour images; it has no channel at all; .*; the log is damaged: truncated 1\.$"
    ):
        open_log([room_log])


def test_closing_in_mid_run_leaves_no_thread_and_no_file(room_log: Path) -> None:
    with open_log([room_log]) as log:
        frames = log.frames(range(6), depth=True, previous=True, truth=True)
        next(frames)
        frames.close()
    assert not any(thread.name.startswith("stsem") for thread in threading.enumerate())
    with pytest.raises(LogError, match="was closed"):
        log.truth(5)
