"""Depth beside colour: brought onto its pixels through calibrations and transforms, or not used, and said."""

from collections.abc import Callable
from pathlib import Path

import foxglove.messages as fox
import numpy as np
import pytest
from made_up_logs import BASE_NS, LEVEL, NS, ROS, Recorder, picture

from stsem.camera import Camera
from stsem.frame import Depth
from stsem.geometry.register_depth import register_depth
from stsem.log.log import Log, open_log
from stsem.pose import Pose, from_quaternion, inverse, to_quaternion
from tests.made_up_lens import DEPTH, RIG, WIDE, lens, pinhole_rays, planes_seen, rays_of, scene

IMAGE = "sensor_msgs/msg/Image"
TURN = (0.5, -0.5, 0.5, -0.5)
"""x y z w of the optical axes (x right, z forward) in a body's (x forward, z up)."""
MOUNT = from_quaternion((0.02, 0.03, 0.1), TURN)


def link(parent: str, child: str, T: Pose) -> tuple[str, str, tuple[float, ...], tuple[float, ...]]:
    return parent, child, tuple(T[:3, 3].tolist()), tuple(to_quaternion(T).tolist())


def rig(log: Recorder, T_color_depth: Pose, topic: str = "/tf_static") -> None:
    """Both optical frames below camera_link, as drivers of RGB-D cameras publish them."""
    links = [
        ("base_link", "camera_link", (0.1, 0.0, 0.9), LEVEL),
        link("camera_link", "color_optical", MOUNT),
        link("camera_link", "depth_optical", MOUNT @ T_color_depth),
    ]
    log.ros(topic, "tf2_msgs/msg/TFMessage", ROS.tf(BASE_NS - 5 * NS, links), BASE_NS)


def color(log: Recorder, camera: Camera, *, calibrated: bool = True) -> None:
    image = picture(0, camera.width, camera.height)
    log.ros("/cam/color/image_raw", IMAGE, ROS.image(BASE_NS, image, "rgb8", frame_id="color_optical"), BASE_NS)
    if calibrated:
        info(log, "/cam/color/camera_info", camera, "color_optical")


def depth(
    log: Recorder, metres: np.ndarray, camera: Camera | None, *, name: str = "depth", frame_id: str = "depth_optical"
) -> None:
    payload = ROS.image(BASE_NS, metres.astype("<f4"), "32FC1", frame_id=frame_id)
    log.ros(f"/cam/{name}/image_rect_raw", IMAGE, payload, BASE_NS)
    if camera:
        info(log, f"/cam/{name}/camera_info", camera, frame_id)


def info(log: Recorder, topic: str, camera: Camera, frame_id: str) -> None:
    payload = ROS.camera_info(
        BASE_NS, camera.width, camera.height, camera.K.ravel(), frame_id,
        d=camera.distortion, model=camera.model or "plumb_bob",
    )  # fmt: skip
    log.ros(topic, "sensor_msgs/msg/CameraInfo", payload, BASE_NS)


def depth_of(log: Log) -> Depth | None:
    return log.frame(0, depth=True, previous=False).depth


METRES = planes_seen(DEPTH, np.eye(4)).astype(np.float32)


@pytest.mark.parametrize("registered", ["auto", "no"])
@pytest.mark.parametrize("topic", ["/tf_static", "/tf"])
def test_two_cameras_on_a_rig(recorder: Callable[..., Recorder], registered: str, topic: str) -> None:
    """Other size, other intrinsics, other place; the extrinsic runs over camera_link and optical frames. A transform
    that never changes is static on /tf, too (ROS 1)."""
    log = recorder()
    rig(log, RIG, topic)
    color(log, WIDE)
    depth(log, METRES, DEPTH)
    with open_log([log.close()], depth_registered=registered) as opened:
        got = depth_of(opened)
        assert got is not None
        np.testing.assert_allclose(got, register_depth(METRES, DEPTH, WIDE, RIG), rtol=1e-5)
        seen = np.isfinite(got)
        assert seen.mean() > 0.7
        assert (np.abs(got[seen] / planes_seen(WIDE, RIG)[seen] - 1) < 0.01).mean() > 0.97
        assert opened.plans[0].missing(frozenset({"depth"})) == ()
        assert any(
            "/cam/depth/image_rect_raw (160x120, frame 'depth_optical') is registered to /cam/color/image_raw "
            "(320x240, frame 'color_optical') by calibrations and transforms (0.051 m apart)." in warning
            for warning in opened.info.warnings
        )


def test_a_rig_in_foxglove_transforms(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    color(log, WIDE)
    depth(log, METRES, DEPTH)
    stamp = fox.Timestamp(sec=BASE_NS // NS, nsec=0)
    for parent, child, T in (
        ("rig", "color_optical", MOUNT), ("color_optical", "depth_optical", RIG), ("map", "rig", np.eye(4)),
    ):  # fmt: skip
        x, y, z, w = to_quaternion(T).tolist()
        t = dict(zip("xyz", T[:3, 3].tolist(), strict=True))
        message = fox.FrameTransform(
            timestamp=stamp, parent_frame_id=parent, child_frame_id=child, translation=fox.Vector3(**t),
            rotation=fox.Quaternion(x=x, y=y, z=z, w=w),
        )  # fmt: skip
        log.fox("/transforms", message, BASE_NS)
    with open_log([log.close()]) as opened:
        got = depth_of(opened)
        np.testing.assert_allclose(got, register_depth(METRES, DEPTH, WIDE, RIG), rtol=1e-5)


def test_the_lens_of_the_depth_camera_is_undone_first(recorder: Callable[..., Recorder]) -> None:
    bent = lens("plumb_bob", (0.12, -0.2, 0.001, -0.0005, 0.05))
    log = recorder()
    rig(log, RIG)
    color(log, WIDE)
    _, _, metres = scene(rays_of(bent))
    payload = ROS.image(BASE_NS, metres, "32FC1", frame_id="depth_optical")
    log.ros("/cam/depth/image_raw", IMAGE, payload, BASE_NS)
    info(log, "/cam/depth/camera_info", bent, "depth_optical")
    straight = Camera(160, 120, bent.fx, bent.fy, bent.cx, bent.cy)
    expected = register_depth(scene(pinhole_rays(straight))[2], straight, WIDE, RIG)
    with open_log([log.close()]) as opened:
        got = depth_of(opened)
        assert got is not None
        both = np.isfinite(got) & np.isfinite(expected)
        assert both.mean() > 0.6
        assert (np.abs(got[both] / expected[both] - 1) < 0.01).mean() > 0.99
        assert any("/cam/depth/camera_info states (plumb_bob) is undone" in text for text in opened.info.warnings)


@pytest.mark.parametrize(
    ("left_out", "missing"),
    [
        ("rig", "a static transform between 'color_optical' and 'depth_optical'"),
        ("depth", "a usable calibration of /cam/depth/image_rect_raw"),
        ("color", "a usable calibration of /cam/color/image_raw"),
    ],
)
@pytest.mark.parametrize("same_size", [True, False])
def test_what_is_missing_is_named(
    recorder: Callable[..., Recorder], left_out: str, missing: str, same_size: bool
) -> None:
    """Of the same size it is taken as registered unless the user says that it is not; of another it is not used."""
    target = DEPTH if same_size else WIDE
    log = recorder()
    if left_out != "rig":
        rig(log, RIG)
    color(log, target, calibrated=left_out != "color")
    depth(log, METRES, None if left_out == "depth" else DEPTH)
    path = log.close()
    for registered in ("auto", "no"):
        with open_log([path], depth_registered=registered) as opened:
            got, warnings = depth_of(opened), " ".join(opened.info.warnings)
            if same_size and registered == "auto":
                np.testing.assert_array_equal(got, METRES)
                assert "taken as registered, being of the same size (--depth-registered yes|no)" in warnings
            else:
                assert got is None
                assert opened.plans[0].missing(frozenset({"depth"})) == ("depth",)
                assert f"to register it the log lacks {missing}: depth is not used" in warnings


def test_yes_means_colour_pixels_whatever_the_log_says(recorder: Callable[..., Recorder], tmp_path: Path) -> None:
    """Half the size is resized by nearest neighbour; another shape cannot be."""
    half = METRES[::2, ::2]
    for name, metres in (("same", METRES), ("half", half), ("other", METRES[:100])):
        log = recorder(f"{name}.mcap")
        rig(log, RIG)
        color(log, DEPTH)
        depth(log, metres, Camera(metres.shape[1], metres.shape[0], 100.0, 100.0, 50.0, 50.0))
        log.close()
    with open_log([tmp_path / "same.mcap"], depth_registered="yes") as opened:
        np.testing.assert_array_equal(depth_of(opened), METRES)
        assert not any("depth" in warning for warning in opened.info.warnings if "frames known" not in warning)
    with open_log([tmp_path / "half.mcap"], depth_registered="yes") as opened:
        np.testing.assert_array_equal(depth_of(opened), half.repeat(2, 0).repeat(2, 1))
    with open_log([tmp_path / "other.mcap"], depth_registered="yes") as opened:
        assert depth_of(opened) is None
        assert "cannot have the pixels of" in opened.info.warnings[0]
        assert "being of another shape: depth is not used" in opened.info.warnings[0]


@pytest.mark.parametrize("frame_id", ["color_optical", "depth_optical"])
def test_aligned_by_name_is_registered_unless_the_log_says_how_far_it_is(
    recorder: Callable[..., Recorder], frame_id: str
) -> None:
    """Drivers that align depth give it colour's frame; one that only says so is believed while nothing contradicts."""
    log = recorder()
    if frame_id == "color_optical":
        rig(log, RIG)
    color(log, DEPTH)
    depth(log, METRES, DEPTH, name="aligned_depth_to_color", frame_id=frame_id)
    with open_log([log.close()]) as opened:
        np.testing.assert_array_equal(depth_of(opened), METRES)
        assert not any("registered" in warning for warning in opened.info.warnings)


def test_registered_by_name_in_the_frame_of_the_other_eye(recorder: Callable[..., Recorder]) -> None:
    """A stereo camera registers depth to its left eye; for the right one it is projected."""
    log = recorder()
    rig(log, RIG)
    color(log, DEPTH)
    depth(log, METRES, DEPTH, name="depth_registered")
    with open_log([log.close()]) as opened:
        np.testing.assert_allclose(depth_of(opened), register_depth(METRES, DEPTH, DEPTH, RIG), rtol=1e-5)
        assert any("(0.051 m apart)" in warning for warning in opened.info.warnings)


@pytest.mark.parametrize("name", ["depth", "depth_registered"])
def test_depth_of_another_camera_is_not_taken_for_that_of_colour(recorder: Callable[..., Recorder], name: str) -> None:
    """In the frame of another camera, of the same size, and no extrinsic: only when it is asked for."""
    log = recorder()
    color(log, DEPTH)
    grey = picture(0, DEPTH.width, DEPTH.height)[..., 0].copy()
    log.ros("/eye/image_raw", IMAGE, ROS.image(BASE_NS, grey, "mono8", frame_id="depth_optical"), BASE_NS)
    depth(log, METRES, DEPTH, name=name)
    path = log.close()
    with open_log([path]) as opened:
        assert depth_of(opened) is None
        assert any("belongs to /eye/image_raw, not to /cam/color/image_raw" in text for text in opened.info.warnings)
    for how in ({"topics": {"depth": f"/cam/{name}/image_rect_raw"}}, {"depth_registered": "yes"}):
        with open_log([path], **how) as opened:  # type: ignore[arg-type]
            np.testing.assert_array_equal(depth_of(opened), METRES)


def test_one_frame_with_two_calibrations_is_a_rig_of_zero_length(recorder: Callable[..., Recorder]) -> None:
    """Simulators put depth of another field of view into the frame and size of colour."""
    wider = Camera(160, 120, 90.0, 90.0, 79.5, 59.5)
    log = recorder()
    color(log, wider)
    depth(log, METRES, DEPTH, frame_id="color_optical")
    with open_log([log.close()]) as opened:
        got = depth_of(opened)
        np.testing.assert_allclose(got, register_depth(METRES, DEPTH, wider, np.eye(4)), rtol=1e-5)
        assert "(0.000 m apart)" in opened.info.warnings[0]


@pytest.mark.parametrize("registered", ["auto", "no"])
def test_the_same_camera_under_two_names_costs_nothing(recorder: Callable[..., Recorder], registered: str) -> None:
    """Identity extrinsic and the same intrinsics: depth is what was recorded, to the bit."""
    log = recorder()
    rig(log, np.eye(4))
    color(log, DEPTH)
    metres = METRES.copy()
    metres[3:9] = np.nan
    depth(log, metres, DEPTH)
    with open_log([log.close()], depth_registered=registered) as opened:
        np.testing.assert_array_equal(depth_of(opened), metres)


def test_no_does_not_trust_one_calibration_for_both(recorder: Callable[..., Recorder]) -> None:
    """A driver that stamps depth with colour's frame: the user who says no is believed."""
    log = recorder()
    color(log, DEPTH)
    depth(log, METRES, None, frame_id="color_optical")
    path = log.close()
    with open_log([path]) as opened:
        np.testing.assert_array_equal(depth_of(opened), METRES)
    with open_log([path], depth_registered="no") as opened:
        assert depth_of(opened) is None
        assert "lacks a usable calibration of /cam/depth/image_rect_raw: depth is not used" in opened.info.warnings[0]


def test_an_optical_frame_taken_for_a_body_frame_would_show(recorder: Callable[..., Recorder]) -> None:
    """The extrinsic is between the frames that the headers name, not their parents: a body frame turned by 90 degrees
    sees nothing of it."""
    log = recorder()
    links = [
        link("camera_link", "color_optical", MOUNT),
        link("color_optical", "depth_optical", RIG),
        link("depth_optical", "depth_link", inverse(from_quaternion((0, 0, 0), TURN))),
    ]
    log.ros("/tf_static", "tf2_msgs/msg/TFMessage", ROS.tf(BASE_NS, links), BASE_NS)
    color(log, WIDE)
    depth(log, METRES, DEPTH, frame_id="depth_link")
    with open_log([log.close()]) as opened:
        got = depth_of(opened)
        assert got is not None
        assert np.isfinite(got).mean() < 0.2
