"""Features and homographies on textured images whose motion is known."""

import threading

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from stsem.chance import generator
from stsem.geometry.features import Features, extract
from stsem.geometry.homography import (
    Homography,
    estimate,
    is_sane,
    match,
    normalised,
    rotation_deviation,
    translation_norm,
)

Array = npt.NDArray[np.float64]


def textured(width: int, height: int, name: str = "a") -> npt.NDArray[np.uint8]:
    """Random boxes of every size: corners that can be found again."""
    rng = generator(0, "textured", name)
    image = np.full((height, width, 3), 120, np.uint8)
    for _ in range(400):
        x, y = rng.integers(0, width), rng.integers(0, height)
        w, h = rng.integers(2, max(4, width // 5), 2)
        image[y : y + h, x : x + w] = rng.integers(0, 256, 3)
    return image


def about(
    width: int, height: int, *, degrees: float = 0, zoom: float = 1, shift: tuple[float, float] = (0, 0)
) -> Array:
    """A rotation and zoom about the image centre, then a shift in pixels, with a little perspective."""
    H = np.eye(3)
    H[:2] = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), degrees, zoom)
    H[:2, 2] += shift
    H[2, 0] = 0.05 / width
    return H


def views(width: int, height: int, H: Array) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    keyframe = textured(width, height)
    return keyframe, np.asarray(cv2.warpPerspective(keyframe, H, (width, height), borderValue=(90, 90, 90)), np.uint8)


def corner_error(found: Homography, H: Array, width: int, height: int) -> float:
    corners = np.array([[[0, 0], [width, 0], [width, height], [0, height]]], np.float64)
    gap = cv2.perspectiveTransform(corners, found.H) - cv2.perspectiveTransform(corners, H)
    return float(np.linalg.norm(gap, axis=2).max())


@pytest.mark.parametrize(("width", "height"), [(96, 64), (480, 270), (270, 480), (960, 540)])
@pytest.mark.parametrize("motion", ["still", "shift", "turn", "zoom"])
def test_a_known_motion_is_found_at_every_size(width: int, height: int, motion: str) -> None:
    H = {
        "still": np.eye(3),
        "shift": about(width, height, shift=(0.06 * width, -0.04 * height)),
        "turn": about(width, height, degrees=6),
        "zoom": about(width, height, zoom=1.12),
    }[motion]
    found = estimate(*map(extract, views(width, height, H)), seed=1)
    assert found is not None
    assert found.H[2, 2] == 1
    assert corner_error(found, H, width, height) < 0.012 * width
    assert found.inlier_share > 0.5


def test_the_direction_is_from_keyframe_to_current() -> None:
    H = np.array([[1, 0, 20], [0, 1, 0], [0, 0, 1]], np.float64)
    found = estimate(*map(extract, views(480, 270, H)), seed=0)
    assert found is not None
    assert found.H[0, 2] == pytest.approx(20, abs=1)


def test_blank_images_have_no_features_and_no_homography() -> None:
    blank = extract(np.full((64, 96, 3), 200, np.uint8))
    assert (len(blank), blank.xy.shape, blank.descriptors.shape) == (0, (0, 2), (0, 32))
    assert estimate(blank, blank, seed=0) is None
    assert estimate(extract(textured(96, 64)), blank, seed=0) is None


@pytest.mark.parametrize("size", [(1, 1), (2, 300), (300, 2), (16, 16)])
def test_the_smallest_images_do_no_harm(size: tuple[int, int]) -> None:
    features = extract(np.zeros((size[1], size[0], 3), np.uint8))
    assert estimate(features, features, seed=0) is None


def test_unrelated_images_have_no_trustworthy_homography() -> None:
    pairs = [(extract(textured(480, 270, f"a{i}")), extract(textured(480, 270, f"b{i}"))) for i in range(5)]
    assert [estimate(a, b, seed=0) for a, b in pairs] == [None] * 5


def test_few_matches_are_not_trusted() -> None:
    full = extract(textured(480, 270))
    for n in (0, 1, 2, 3, 15):
        few = Features(full.xy[:n], full.descriptors[:n], full.width, full.height)
        assert estimate(few, full, seed=0) is None


def test_points_on_one_line_are_not_trusted() -> None:
    full = extract(textured(480, 270))
    line = np.stack([np.linspace(0, 400, len(full)), np.full(len(full), 50)], axis=1).astype(np.float32)
    on_line = Features(line, full.descriptors, full.width, full.height)
    assert estimate(on_line, on_line, seed=0) is None


def test_a_match_is_the_clearly_nearest() -> None:
    full = extract(textured(480, 270))
    from_xy, to_xy = match(full, full)
    assert len(from_xy) > 0.8 * len(full)
    np.testing.assert_array_equal(from_xy, to_xy)
    twice = Features(
        np.concatenate([full.xy, full.xy + 1]), np.concatenate([full.descriptors] * 2), full.width, full.height
    )
    assert len(match(full, twice)[0]) == 0


def test_the_same_seed_gives_the_same_bits_in_any_thread_and_after_any_call() -> None:
    keyframe, current = views(480, 270, about(480, 270, degrees=4, shift=(30, 5)))
    noisy = np.clip(current + generator(0, "noise").normal(0, 25, current.shape), 0, 255).astype(np.uint8)
    results: list[bytes] = []

    def once(threads: int) -> None:
        before = cv2.getNumThreads()
        cv2.setNumThreads(threads)
        a, b = extract(keyframe), extract(noisy)
        found = estimate(a, b, seed=7)
        cv2.setNumThreads(before)
        assert found is not None
        results.append(found.H.tobytes() + a.xy.tobytes() + b.descriptors.tobytes())

    for threads in (1, 2, 4):
        once(threads)
        cv2.setRNGSeed(threads)
        estimate(extract(noisy), extract(keyframe), seed=threads)
        thread = threading.Thread(target=once, args=(threads,))
        thread.start()
        thread.join()
    assert len(results) == 6
    assert len(set(results)) == 1


def test_the_seed_reaches_the_estimator() -> None:
    keyframe, current = views(480, 270, about(480, 270, degrees=4, shift=(30, 5)))
    noisy = np.clip(current + generator(0, "noise").normal(0, 25, current.shape), 0, 255).astype(np.uint8)
    a, b = extract(keyframe), extract(noisy)
    found = [estimate(a, b, seed=seed) for seed in range(8)]
    assert len({h.H.tobytes() for h in found if h is not None}) > 1


@pytest.mark.parametrize(
    "H",
    [
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
        np.diag([-1.0, 1.0, 1.0]),
        np.diag([0.1, 0.1, 1.0]),
        np.diag([9.0, 9.0, 1.0]),
        np.array([[1, 0, 0], [0, 1, 0], [-0.011, 0, 1]]),
        np.array([[1, 0, 0], [1, 0, 0], [0, 0, 1.0]]),
        np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1.0]]),
    ],
)
def test_what_no_camera_can_see_is_not_sane(H: Array) -> None:
    assert not is_sane(H, 96, 64)


def test_scale_and_sign_of_a_homography_mean_nothing() -> None:
    H = about(96, 64, degrees=10, zoom=1.2)
    assert is_sane(H, 96, 64)
    assert is_sane(-3 * H, 96, 64)
    np.testing.assert_allclose(normalised(-3 * H, 96, 64), normalised(H, 96, 64), atol=1e-12)


def test_normalised_motion_does_not_depend_on_the_image_size() -> None:
    small, large = (
        about(96, 64, degrees=5, zoom=1.1, shift=(9.6, 4.8)),
        about(960, 640, degrees=5, zoom=1.1, shift=(96, 48)),
    )
    a, b = normalised(small, 96, 64), normalised(large, 960, 640)
    assert rotation_deviation(a) == pytest.approx(rotation_deviation(b), rel=0.02)
    assert translation_norm(a) == pytest.approx(translation_norm(b), rel=0.02)


def test_the_norms_of_the_keyframe_rule_on_motions_worked_out_by_hand() -> None:
    width, height = 480, 270
    assert rotation_deviation(normalised(np.eye(3), width, height)) == pytest.approx(0, abs=1e-12)
    assert translation_norm(normalised(np.eye(3), width, height)) == pytest.approx(0, abs=1e-12)
    shift = np.array([[1, 0, 48], [0, 1, 36], [0, 0, 1]], np.float64)
    assert translation_norm(normalised(shift, width, height)) == pytest.approx(60 / 480)
    assert rotation_deviation(normalised(shift, width, height)) == pytest.approx(0, abs=1e-12)
    turn = np.eye(3)
    turn[:2] = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), 10, 1)
    assert translation_norm(normalised(turn, width, height)) == pytest.approx(0, abs=1e-12)
    assert rotation_deviation(normalised(turn, width, height)) == pytest.approx(2**1.5 * np.sin(np.radians(5)))
