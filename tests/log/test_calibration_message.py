"""From a calibration message to cameras: binning, region of interest, models, and numbers that no camera has."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.camera import Camera
from stsem.log.schemas.calibration import Intrinsics, Readout, calibration

K = (500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0)
P = (400.0, 0.0, 310.0, -40.0, 0.0, 401.0, 230.0, 0.0, 0.0, 0.0, 1.0, 0.0)
BENT = (0.1, -0.2, 0.001, 0.002, 0.3)
PLAIN = Intrinsics(640, 480, K, BENT, "plumb_bob", P)


def cameras(sensor: Intrinsics) -> tuple[Camera | None, Camera | None]:
    got = calibration(5, "optical", sensor)
    assert (got.stamp_ns, got.frame_id) == (5, "optical")
    return got.camera, got.rectified


def test_the_image_as_it_was_sent() -> None:
    assert cameras(PLAIN) == (
        Camera(640, 480, 500, 501, 320, 240, BENT, "plumb_bob"),
        Camera(640, 480, 400, 401, 310, 230),
    )


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    binning=st.tuples(st.integers(0, 4), st.integers(0, 4)),
    offset=st.tuples(st.integers(0, 300), st.integers(0, 200)),
    size=st.tuples(st.integers(4, 300), st.integers(4, 200)),
    point=st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(1, 9)),
)
def test_a_point_is_seen_where_the_cropped_and_averaged_image_shows_it(
    binning: tuple[int, int], offset: tuple[int, int], size: tuple[int, int], point: tuple[float, float, float]
) -> None:
    """The centre of a binned pixel is the mean of the centres of its pixels of the sensor."""
    for camera, full in zip(
        cameras(replace(PLAIN, readout=Readout(binning, offset, size))), cameras(PLAIN), strict=True
    ):
        assert camera is not None
        assert full is not None
        for axis, (length, b) in enumerate(zip((camera.width, camera.height), binning, strict=True)):
            b = b or 1
            assert length == size[axis] // b
            pixel = camera.K[axis] @ point / point[2]
            on_sensor = full.K[axis] @ point / point[2]
            members = np.arange(b) + offset[axis]
            first = members.mean()
            assert math.isclose(pixel, (on_sensor - first) / b, abs_tol=1e-9)
        assert (camera.distortion, camera.model) == (full.distortion, full.model)


def test_resizing_by_averages_is_binning() -> None:
    """cv2's area interpolation moves the centre of a spot to where the binned camera sees it."""
    image = np.zeros((480, 640), np.float32)
    image[200:204, 400:404] = 1
    small = cv2.resize(image, (320, 240), interpolation=cv2.INTER_AREA)
    x = (small.sum(0) @ np.arange(320)) / small.sum()
    full, binned = (cameras(replace(PLAIN, readout=Readout((b, b))))[0] for b in (1, 2))
    assert full is not None
    assert binned is not None
    assert math.isclose((401.5 - full.cx) / full.fx, (x - binned.cx) / binned.fx, abs_tol=1e-6)


@pytest.mark.parametrize(
    ("model", "d", "expected"),
    [
        ("plumb_bob", BENT, (BENT, "plumb_bob")),
        ("rational_polynomial", (0.1,) * 8, ((0.1,) * 8, "rational_polynomial")),
        ("kannala_brandt", (0.1,) * 4, ((0.1,) * 4, "equidistant")),
        ("fisheye", (0.1,) * 4, ((0.1,) * 4, "equidistant")),
        ("Equidistant ", (0.1,) * 4, ((0.1,) * 4, "equidistant")),
        ("equidistant", (0.0,) * 4, ((0.0,) * 4, "equidistant")),
        ("equidistant", (), ((), "")),
        ("plumb_bob", (), ((), "")),
        ("plumb_bob", (0.0,) * 5, ((), "")),
        ("", (), ((), "")),
        ("my lens", (0.5,), ((0.5,), "my lens")),
    ],
)
def test_models(model: str, d: tuple[float, ...], expected: tuple[tuple[float, ...], str]) -> None:
    camera, rectified = cameras(replace(PLAIN, D=d, model=model))
    assert camera is not None
    assert rectified is not None
    assert (camera.distortion, camera.model) == expected
    assert (rectified.distortion, rectified.model) == ((), "")


@pytest.mark.parametrize("k", [(), (0.0,) * 9, (0.0, 0, 3, 0, 500, 2, 0, 0, 1), (500.0, 0, 3, 0, 0, 2, 0, 0, 1)])
def test_no_focal_length_means_uncalibrated(k: tuple[float, ...]) -> None:
    """Whatever the coefficients say then."""
    camera, rectified = cameras(replace(PLAIN, K=k, D=(math.nan,)))
    assert camera is None
    assert rectified is not None


@pytest.mark.parametrize("p", [(), (0.0,) * 12, (0.0, *P[1:])])
def test_no_projection_means_no_rectified_camera(p: tuple[float, ...]) -> None:
    assert cameras(replace(PLAIN, P=p))[1] is None


def test_an_image_upside_down_has_a_negative_focal_length() -> None:
    """ICL-NUIM."""
    camera, _ = cameras(replace(PLAIN, K=(481.2, 0, 319.5, 0, -480, 239.5, 0, 0, 1)))
    assert camera is not None
    assert camera.fy == -480


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"K": (math.nan, *K[1:])}, "K has a number that no camera has"),
        ({"K": (math.inf, *K[1:])}, "K has a number that no camera has"),
        ({"K": (*K[:2], 1e30, *K[3:])}, "K has a number that no camera has"),
        ({"K": (-500.0, *K[1:])}, "K has a focal length that no camera has"),
        ({"K": (1e-300, *K[1:])}, "K has a focal length that no camera has"),
        ({"K": K[:8]}, "K has 8 numbers instead of 9"),
        ({"P": (math.nan, *P[1:])}, "P has a number that no camera has"),
        ({"P": P[:9]}, "P has 9 numbers instead of 12"),
        ({"D": (math.nan, 0.0)}, "D has a number that is not finite"),
        ({"D": (0.1,) * 1000}, "D has 1000 numbers"),
        ({"width": 1 << 31}, "an image of 2147483648x480 pixels at 0, 0 is announced"),
        ({"readout": Readout(offset=(1 << 31, 0))}, "an image of 640x480 pixels at 2147483648, 0 is announced"),
        ({"readout": Readout(binning=(1, 481))}, "binning by 1x481 leaves nothing of 640x480 pixels"),
    ],
)
def test_numbers_that_no_camera_has_are_refused(change: dict[str, object], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        calibration(None, "", replace(PLAIN, **change))


def test_a_size_that_the_message_does_not_tell_is_zero() -> None:
    camera, _ = cameras(replace(PLAIN, width=0, height=0, readout=Readout((2, 2))))
    assert camera is not None
    assert (camera.width, camera.height) == (0, 0)
