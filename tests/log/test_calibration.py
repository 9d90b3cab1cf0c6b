"""Calibrations in logs: whose they are, distortion undone once in colour, labels and depth, and what is refused."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from made_up_logs import BASE_NS, PERIOD_NS, ROS, Recorder, label_picture, picture, png

from stsem.camera import Camera
from stsem.classes import NO_LABEL
from stsem.log.log import Log, open_log
from tests.made_up_lens import LENSES, PINHOLE, lens, pinhole_rays, projected, rays_of, scene, steady

IMAGE = "sensor_msgs/msg/Image"
K = (30.0, 0, 15.5, 0, 30.0, 11.5, 0, 0, 1)
P = (28.0, 0, 15.0, 0, 0, 28.0, 11.0, 0, 0, 0, 1, 0)
D = (0.1, -0.2, 0.001, -0.0005, 0.05)


def image(log: Recorder, topic: str, pixels: np.ndarray, encoding: str, frame_id: str = "camera", i: int = 0) -> None:
    stamp = BASE_NS + i * PERIOD_NS
    log.ros(topic, IMAGE, ROS.image(stamp, pixels, encoding, frame_id=frame_id), stamp)


def info(
    log: Recorder, topic: str, *, k: Sequence[float] = K, size: tuple[int, int] = (32, 24), frame_id: str = "camera",
    i: int = 0, **more: object,
) -> None:  # fmt: skip
    stamp = BASE_NS + i * PERIOD_NS
    payload = ROS.camera_info(stamp, *size, k, frame_id, **more)
    log.ros(topic, "sensor_msgs/msg/CameraInfo", payload, stamp)


def image_of(log: Log, index: int = 0) -> np.ndarray:
    return log.frame(index, depth=False, previous=False).image


@pytest.mark.parametrize(("model", "d"), [LENSES[1], LENSES[2], LENSES[5]], ids=["plumb_bob", "rational", "fisheye"])
@pytest.mark.parametrize("half", [False, True], ids=["labels-alike", "labels-half"])
def test_colour_labels_and_depth_are_as_a_pinhole_sees_them(
    recorder: Callable[..., Recorder], model: str, d: tuple[float, ...], half: bool
) -> None:
    camera = lens(model, d)
    colour, _, depth = scene(rays_of(camera))
    of_labels = camera.scaled(80, 60) if half else camera
    _, labels, _ = scene(rays_of(of_labels))
    log = recorder()
    for i in range(2):
        image(log, "/cam/image_raw", np.rint(colour).astype(np.uint8), "rgb8", i=i)
        image(log, "/labels", labels, "mono8", i=i)
        image(log, "/depth", depth, "32FC1", i=i)
        info(log, "/cam/camera_info", k=camera.K.ravel().tolist(), size=(160, 120), d=d, model=model, i=i)
    log.writer.add_metadata("stsem.classes", {str(k): f"class {k}" for k in range(7)})
    true_colour, _, true_depth = scene(pinhole_rays(PINHOLE))
    where = projected(camera, pinhole_rays(PINHOLE))
    inside = ((where > 1) & (where < (158, 118))).all(axis=-1)
    with open_log([log.close()]) as opened:
        frame, truth = opened.frame(1, depth=True, previous=True), opened.truth(1)
        assert opened.camera == frame.camera == PINHOLE
        assert opened.info.warnings == (f"The lens distortion that /cam/camera_info states ({model}) is undone.",)
        assert np.abs(frame.image[inside] - true_colour[inside]).max() < 6
        np.testing.assert_array_equal(frame.previous, frame.image)
        assert frame.depth is not None
        assert (np.abs(frame.depth[inside] / true_depth[inside] - 1) < 0.02).all()
    small = PINHOLE.scaled(80, 60) if half else PINHOLE
    _, true_labels, _ = scene(pinhole_rays(small))
    where = projected(of_labels, pinhole_rays(small))
    certain = steady(true_labels) & ((where > 1) & (where < (small.width - 2, small.height - 2))).all(axis=-1)
    assert truth is not None
    assert truth.shape == true_labels.shape
    assert certain.mean() > 0.4
    assert (truth[certain] == true_labels[certain]).mean() > 0.99
    outside = ((where < -1) | (where > (small.width, small.height))).any(axis=-1)
    assert (truth[outside] == NO_LABEL).all()


@pytest.mark.parametrize(
    ("p", "expected"),
    [(P, Camera(32, 24, 28, 28, 15, 11)), ((0.0,) * 12, Camera(32, 24, 30, 30, 15.5, 11.5))],
    ids=["with P", "without P"],
)
def test_a_rectified_topic_is_not_rectified_again(
    recorder: Callable[..., Recorder], p: Sequence[float], expected: Camera
) -> None:
    log = recorder()
    image(log, "/camera/image_rect_color", picture(0), "rgb8")
    info(log, "/camera/camera_info", d=D, p=p)
    with open_log([log.close()]) as opened:
        assert opened.camera == expected
        np.testing.assert_array_equal(image_of(opened), picture(0))
        assert opened.info.warnings == (
            "/camera/image_rect_color is rectified, by its name: the lens distortion that /camera/camera_info states "
            "is not undone.",
        )  # fmt: skip


@pytest.mark.parametrize(
    ("model", "d", "reason"),
    [
        ("thin_prism", (0.1,) * 4, "the distortion model 'thin_prism' is not known"),
        ("plumb_bob", (0.1, 0.2, 0.3), "plumb_bob has 4 or 5 or 8 or 12 or 14 coefficients, but 3 came"),
        ("plumb_bob", (1e12, 0, 0, 0, 0), "the coefficients of plumb_bob are no lens"),
        ("equidistant", (-30.0, 0, 0, 0), "the coefficients of equidistant are no lens"),
    ],
)
def test_a_lens_that_is_not_understood_leaves_images_as_they_are_and_no_intrinsics(
    recorder: Callable[..., Recorder], model: str, d: tuple[float, ...], reason: str
) -> None:
    log = recorder()
    image(log, "/cam", picture(0), "rgb8")
    image(log, "/labels", label_picture(0), "mono8")
    info(log, "/camera_info", d=d, model=model)
    log.writer.add_metadata("stsem.classes", {"0": "a", "1": "b", "2": "c"})
    with open_log([log.close()]) as opened:
        assert opened.camera is None
        np.testing.assert_array_equal(image_of(opened), picture(0))
        np.testing.assert_array_equal(opened.truth(0), label_picture(0))
        (warning,) = opened.info.warnings
        assert warning.startswith(f"The lens distortion that /camera_info states cannot be undone ({reason}")
        assert warning.endswith("no intrinsics, no map.")


def test_no_intrinsics_when_k_is_zero(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    image(log, "/cam", picture(0), "rgb8")
    info(log, "/camera_info", k=(0.0,) * 9)
    with open_log([log.close()]) as opened:
        assert opened.camera is None
        assert opened.info.warnings == (
            "/camera_info says that the camera is uncalibrated (K is zero): no intrinsics.",
        )


def test_a_calibration_without_a_size_is_that_of_the_images(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    image(log, "/cam", picture(0), "rgb8")
    info(log, "/camera_info", size=(0, 0))
    with open_log([log.close()]) as opened:
        assert opened.camera == Camera(32, 24, 30, 30, 15.5, 11.5)
        assert opened.info.warnings == ()


def test_scaling_to_another_shape_is_doubted(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    image(log, "/cam", picture(0), "rgb8")
    info(log, "/camera_info", size=(64, 64), k=(60, 0, 31.5, 0, 60, 31.5, 0, 0, 1))
    with open_log([log.close()]) as opened:
        assert opened.camera == Camera(32, 24, 30, 22.5, 15.5, 11.5)
        (warning,) = opened.info.warnings
        assert "is for 64x64, the images are 32x24: intrinsics are scaled, though the shape differs" in warning


def test_the_first_of_changing_calibrations_counts(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    for i, f in enumerate((30, 31, 31, 32)):
        image(log, "/cam", picture(i), "rgb8", i=i)
        info(log, "/camera_info", k=(f, 0, 15.5, 0, f, 11.5, 0, 0, 1), i=i)
    with open_log([log.close()]) as opened:
        assert opened.camera == Camera(32, 24, 30, 30, 15.5, 11.5)
        assert opened.info.warnings == ("/camera_info changes 2 times; the first calibration is used.",)


def test_the_calibration_of_another_camera_is_not_used(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    image(log, "/front/image_raw", picture(0), "rgb8", "front")
    image(log, "/rear/image_raw", picture(1), "rgb8", "rear")
    info(log, "/rear/camera_info", frame_id="rear")
    with open_log([log.close()], topics={"color": "/front/image_raw"}) as opened:
        assert opened.camera is None
        assert opened.info.warnings == (
            "/rear/camera_info is the calibration of /rear/image_raw; /front/image_raw has none: no intrinsics.",
        )  # fmt: skip


@pytest.mark.parametrize(
    ("topic", "frame_id", "serves"),
    [
        ("/cam/aligned_depth_to_color", "color_optical", True),
        ("/cam/aligned_depth_to_color", "depth_optical", True),
        ("/cam/depth", "depth_optical", False),
    ],
)
def test_the_calibration_of_registered_depth_serves_colour(
    recorder: Callable[..., Recorder], topic: str, frame_id: str, serves: bool
) -> None:
    log = recorder()
    image(log, "/cam/color/image_raw", picture(0), "rgb8", "color_optical")
    image(log, f"{topic}/image_raw", np.full((24, 32), 900, "<u2"), "16UC1", frame_id)
    info(log, f"{topic}/camera_info", frame_id=frame_id)
    with open_log([log.close()]) as opened:
        assert opened.camera == (Camera(32, 24, 30, 30, 15.5, 11.5) if serves else None)
        frame = opened.frame(0, depth=True, previous=False)
        assert frame.depth is not None
        assert (frame.depth == np.float32(0.9)).all()
        assert len(opened.info.warnings) == (0 if serves and frame_id == "color_optical" else 1)


def compressed(log: Recorder, i: int, file: bytes) -> None:
    stamp = BASE_NS + i * PERIOD_NS
    log.ros("/cam", "sensor_msgs/msg/CompressedImage", ROS.compressed(stamp, file, "png"), stamp)


@pytest.mark.parametrize("form", ["raw", "png"])
def test_most_images_decide_the_size(recorder: Callable[..., Recorder], form: str) -> None:
    """The camera starts at another resolution."""
    log = recorder()
    for i in range(8):
        pixels = picture(i, *((16, 12) if i < 2 else (32, 24)))
        if form == "raw":
            image(log, "/cam", pixels, "rgb8", i=i)
        else:
            compressed(log, i, png(pixels))
    with open_log([log.close()]) as opened:
        assert opened.size == (32, 24)
        loaded = list(opened.frames(range(8), depth=False, previous=False, truth=False))
        assert [one.frame is None for one in loaded] == [True, True, *[False] * 6]
        assert opened.info.damage.counts == {"undecodable": {"/cam": 2}}


def test_headers_of_broken_images_do_not_decide_the_size(recorder: Callable[..., Recorder]) -> None:
    """Most say 64x48 and end early; the size is that of those that can be decoded."""
    log = recorder()
    for i in range(8):
        compressed(log, i, png(picture(i)) if i in (3, 5) else png(picture(i, 64, 48))[:-200])
    with open_log([log.close()]) as opened:
        assert opened.size == (32, 24)
        assert opened.frame(3, depth=False, previous=False).size == (32, 24)
