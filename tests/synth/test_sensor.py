"""Depth as a Kinect would measure it, colour as a camera would: each fault alone, on surfaces made for it."""

import numpy as np
import numpy.typing as npt
import pytest

from stsem.chance import generator
from stsem.errors import UsageError
from stsem.synth.sensor import check_noise, expose, kinect, millimetres

FOCAL_PX = 278.4
DISPARITY_SCALE = 585 * 0.075 * 8
"""f b in eighths of a pixel at the Kinect's own focal length: depth is this over a whole number."""


def plane(z: float, width: int = 320, height: int = 240) -> npt.NDArray[np.float32]:
    return np.full((height, width), z, np.float32)


def step_edge() -> npt.NDArray[np.float32]:
    """A box 1 m away, columns 60 to 140, before a wall at 3 m."""
    depth = plane(3.0)
    depth[:, 60:140] = 1.0
    return depth


@pytest.mark.parametrize("z", [0.8, 1.5, 3.0, 5.0])
def test_axial_noise_grows_with_depth_as_published(z: float) -> None:
    """sigma(z) = 0.0012 + 0.0019 (z - 0.4)^2, and rounding to whole disparities on top."""
    measured = np.concatenate([kinect(plane(z), FOCAL_PX, generator(k, "test")) for k in range(4)])
    rounding = z * z / DISPARITY_SCALE / np.sqrt(12)
    expected = np.hypot(0.0012 + 0.0019 * (z - 0.4) ** 2, rounding)
    assert np.nanstd(measured) == pytest.approx(expected, rel=0.1)
    assert abs(float(np.nanmean(measured)) - z) < 0.15 * expected


def test_depth_comes_in_whole_disparities() -> None:
    """Steps of about 2.6 cm at 3 m."""
    measured = kinect(plane(3.0), FOCAL_PX, generator(0, "test")).astype(np.float64)
    disparity = DISPARITY_SCALE / measured
    np.testing.assert_allclose(disparity, np.rint(disparity), atol=1e-4)
    steps = np.diff(np.unique(measured))
    assert 0.02 < steps.min() <= steps.max() < 0.03


@pytest.mark.parametrize(("z", "known"), [(0.3, False), (0.6, True), (7.0, True), (9.0, False)])
def test_there_is_nothing_out_of_range(z: float, known: bool) -> None:
    """Nearer than 0.45 m and beyond 8 m the sensor is blind."""
    share = float(np.isfinite(kinect(plane(z), FOCAL_PX, generator(0, "test"))).mean())
    assert share == 1.0 if known else share == 0.0


def test_the_projectors_shadow_lies_to_the_right_of_a_near_body() -> None:
    """Its width is f b (1/near - 1/far); left of the body nothing is hidden."""
    measured = kinect(step_edge(), FOCAL_PX, generator(0, "test"))
    blind = np.isnan(measured[:, 4:-4]).mean(axis=0)
    width = FOCAL_PX * 0.075 * (1 - 1 / 3)
    assert (blind[140 - 4 : 140 - 4 + int(width) - 1] == 1).all()
    assert not blind[: 60 - 8].any()
    assert not blind[140 - 4 + int(width) + 4 :].any()


def test_depths_are_mixed_at_edges_only() -> None:
    """At the visible edge of a body 2 m before a wall a third of the pixels lie in between, and none elsewhere."""
    measured = np.stack([kinect(step_edge(), FOCAL_PX, generator(k, "test")) for k in range(8)])
    floating = ((measured > 1.1) & (measured < 2.8)).mean(axis=(0, 1))
    assert 0.2 < floating[60] < 0.4
    assert not np.delete(floating, [60, 140]).any()


def test_a_floor_seen_at_a_flat_angle_has_holes() -> None:
    """A surface whose depth grows by more than about ten times its width on the way is lost."""
    slope = np.linspace(0.6, 7.5, 8, dtype=np.float32)
    steep = np.repeat(slope[:, None], 64, axis=1)
    assert np.isnan(kinect(steep, FOCAL_PX, generator(0, "test"))).all()
    gentle = np.repeat(np.linspace(2.0, 2.4, 48, dtype=np.float32)[:, None], 64, axis=1)
    assert np.isfinite(kinect(gentle, FOCAL_PX, generator(0, "test"))).all()


def test_millimetres_round_and_leave_out_what_is_not_known() -> None:
    """Zero means unknown: no depth, infinite, behind the camera or beyond 65 m."""
    depth = np.array([[1.2344, 1.2346, np.nan, np.inf, -1.0, 70.0]], np.float32)
    assert millimetres(depth).tolist() == [[1234, 1235, 0, 0, 0, 0]]


def test_exposure_keeps_order_and_clips() -> None:
    """Display gamma without grain; grain has the standard deviation of one level."""
    ramp = np.linspace(-0.1, 1.5, 64, dtype=np.float32)[None, :, None].repeat(3, axis=2)
    levels = expose(ramp, 1.0, None)[0, :, 0].astype(int)
    assert levels[0] == 0
    assert levels[-1] == 255
    assert (np.diff(levels) >= 0).all()
    grey = np.full((120, 160, 3), 0.3, np.float32)
    assert expose(grey, 1.0, generator(0, "grain")).std() == pytest.approx(np.hypot(1.0, 1 / np.sqrt(12)), rel=0.05)


def test_unknown_noise_is_named() -> None:
    """The sentence lists what there is."""
    with pytest.raises(UsageError, match="'salt'; give kinect or none"):
        check_noise("salt")
