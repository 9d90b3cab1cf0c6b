"""Lens distortion undone, against OpenCV's projections: what the lens drew must come back where a pinhole draws it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.classes import NO_LABEL
from stsem.geometry.undistort import Undistortion
from tests.made_up_lens import LENSES, PINHOLE, lens, pinhole_rays, projected, rays_of, scene, steady


@pytest.mark.parametrize(("model", "d"), LENSES)
def test_what_the_lens_drew_comes_back_as_a_pinhole_draws_it(model: str, d: tuple[float, ...]) -> None:
    camera = lens(model, d)
    colour, labels, depth = scene(rays_of(camera))
    true_colour, true_labels, true_depth = scene(pinhole_rays(PINHOLE))
    undistortion = Undistortion(camera)
    assert undistortion.pinhole == PINHOLE
    where = projected(camera, pinhole_rays(PINHOLE))
    inside = ((where > 1) & (where < (158, 118))).all(axis=-1)
    outside = ((where < -1) | (where > (160, 120))).any(axis=-1)
    assert inside.mean() > 0.6

    got = undistortion.image(np.rint(colour).astype(np.uint8))
    assert np.abs(got[inside] - true_colour[inside]).max() < 6
    # Labels at the borders of squares may fall either way: those farther than a pixel from a border may not.
    certain = inside & steady(true_labels)
    assert (undistortion.labels(labels)[certain] == true_labels[certain]).mean() > 0.99
    error = np.abs(undistortion.depth(depth) / true_depth - 1)
    assert error[inside].max() < 0.02

    assert (got[outside] == 0).all()
    assert (undistortion.labels(labels)[outside] == NO_LABEL).all()
    assert np.isnan(undistortion.depth(depth)[outside]).all()


def test_the_same_bytes_with_any_number_of_threads() -> None:
    undistortion = Undistortion(lens(*LENSES[1]))
    colour, labels, depth = scene(rays_of(lens(*LENSES[1])))
    image, before = np.rint(colour).astype(np.uint8), cv2.getNumThreads()
    try:
        results = []
        for threads in (1, 2, 5):
            cv2.setNumThreads(threads)
            again = Undistortion(lens(*LENSES[1]))
            results.append(
                b"".join(
                    u.image(image).tobytes() + u.labels(labels).tobytes() + u.depth(depth).tobytes()
                    for u in (undistortion, again)
                )
            )
    finally:
        cv2.setNumThreads(before)
    assert len(set(results)) == 1


@pytest.mark.parametrize(
    ("model", "d", "reason"),
    [
        ("thin_prism", (0.1, 0.0, 0.0, 0.0), "'thin_prism' is not known, only plumb_bob"),
        ("", (0.1, 0.0, 0.0, 0.0), "'' is not known"),
        ("plumb_bob", (0.1, 0.2), "plumb_bob has 4 or 5 or 8 or 12 or 14 coefficients, but 2 came"),
        ("equidistant", (0.1,) * 5, "equidistant has 4 coefficients, but 5 came"),
        ("plumb_bob", (1e9, 0.0, 0.0, 0.0), "are no lens"),
        ("plumb_bob", (-40.0, 0.0, 0.0, 0.0), "are no lens"),
        ("plumb_bob", (0.0, 0.0, 1e6, 0.0), "are no lens"),
        ("plumb_bob", (float("nan"), 0.0, 0.0, 0.0), "are no lens"),
        ("equidistant", (1e30, 0.0, 0.0, 0.0), "are no lens"),
        ("rational_polynomial", (0.0, 0.0, 0.0, 0.0, 0.0, 1e9, 0.0, 0.0), "are no lens"),
    ],
)
def test_coefficients_of_no_lens_are_refused(model: str, d: tuple[float, ...], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        Undistortion(lens(model, d))


@pytest.mark.parametrize(
    ("model", "d", "filled_up"),
    [
        ("equidistant", (0.1, -0.02, 0.0, 0.0), (0.1, -0.02, 0.0, 0.0, 0.0)),
        ("plumb_bob", (-0.2, 0.05, 0.0, 0.0, 0.01), (-0.2, 0.05, 0.0, 0.0, 0.01, 0.0, 0.0)),
        ("plumb_bob", (-0.2, 0.05, 0.0, 0.0), (-0.2, 0.05, 0.0, 0.0) + (0.0,) * 20),
    ],
)
def test_zeros_behind_the_coefficients_mean_nothing(
    model: str, d: tuple[float, ...], filled_up: tuple[float, ...]
) -> None:
    """Drivers fill messages up."""
    image = np.random.default_rng(0).integers(0, 256, (lens(model, d).height, lens(model, d).width, 3), np.uint8)
    plain = Undistortion(lens(model, d)).image(image)
    assert not np.array_equal(plain, image)
    np.testing.assert_array_equal(Undistortion(lens(model, filled_up)).image(image), plain)


def test_a_size_beyond_16_bits_is_refused() -> None:
    with pytest.raises(ValueError, match="40000x2 pixels cannot be resampled"):
        Undistortion(replace(lens(*LENSES[0]), width=40_000, height=2))


def test_nothing_is_mirrored_beyond_the_fold() -> None:
    """This polynomial turns back at r = 0.62: the corners are unknown, not a second copy of what is farther in."""
    camera = lens("plumb_bob", (-0.87, 0.0, 0.0, 0.0))
    seen = Undistortion(camera).labels(np.zeros((120, 160), np.uint8)) == 0
    radius = np.hypot(*np.moveaxis(pinhole_rays(PINHOLE), -1, 0))
    assert seen[radius < 0.60].all()
    assert not seen[radius > 0.63].any()


@settings(max_examples=60)
@given(
    model=st.sampled_from(["plumb_bob", "rational_polynomial", "equidistant"]),
    d=st.lists(st.floats(width=64), min_size=0, max_size=16),
    f=st.floats(1e-3, 1e7),
)
def test_any_numbers_are_a_lens_or_refused(model: str, d: list[float], f: float) -> None:
    camera = replace(lens(model, tuple(d)), fx=f, fy=f)
    if not camera.is_distorted:
        return
    try:
        undistortion = Undistortion(camera)
    except ValueError:
        return
    labels = undistortion.labels(np.full((120, 160), 3, np.uint8))
    assert set(np.unique(labels)) <= {3, NO_LABEL}
    assert (labels == 3).mean() > 0.4
