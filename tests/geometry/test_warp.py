"""Warped labels, compared pixel by pixel with the definition written out in numpy."""

import numpy as np
import numpy.typing as npt
import pytest

from stsem.chance import generator
from stsem.classes import NO_LABEL
from stsem.geometry.homography import is_sane
from stsem.geometry.warp import warp_labels

SIZE = (96, 64)
LABELS = generator(0, "labels").integers(0, 13, (64, 96)).astype(np.uint8)
Array = npt.NDArray[np.float64]


def fetched(labels: npt.NDArray[np.uint8], H: Array) -> tuple[npt.NDArray[np.uint8], Array]:
    """Each current pixel fetches the nearest keyframe pixel; also how far each was from a tie."""
    height, width = labels.shape
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    back = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.linalg.inv(H).T
    u, v = back[..., 0] / back[..., 2], back[..., 1] / back[..., 2]
    column, row = np.rint(u).astype(int), np.rint(v).astype(int)
    inside = (column >= 0) & (row >= 0) & (column < width) & (row < height) & (back[..., 2] > 0)
    result = np.full_like(labels, NO_LABEL)
    result[inside] = labels[row[inside], column[inside]]
    return result, np.minimum(np.abs(u % 1 - 0.5), np.abs(v % 1 - 0.5))


def shifted(x: float, y: float) -> Array:
    return np.array([[1, 0, x], [0, 1, y], [0, 0, 1]], np.float64)


def test_the_identity_changes_nothing() -> None:
    np.testing.assert_array_equal(warp_labels(LABELS, np.eye(3), SIZE), LABELS)


@pytest.mark.parametrize(("x", "y"), [(3, 0), (-5, 7), (95, 63), (-95, -63), (96, 0), (0, -64), (200, 200)])
def test_whole_shifts_are_exact_and_what_was_never_seen_has_no_label(x: int, y: int) -> None:
    expected = np.full_like(LABELS, NO_LABEL)
    if abs(x) < 96 and abs(y) < 64:
        source = LABELS[max(0, -y) : 64 - max(0, y), max(0, -x) : 96 - max(0, x)]
        expected[max(0, y) : 64 + min(0, y), max(0, x) : 96 + min(0, x)] = source
    np.testing.assert_array_equal(warp_labels(LABELS, shifted(x, y), SIZE), expected)


@pytest.mark.parametrize(("x", "nearest"), [(0.49, 0), (-0.49, 0), (0.51, 1), (1.49, 1), (-1.51, -2)])
def test_part_shifts_round_to_the_nearest(x: float, nearest: int) -> None:
    np.testing.assert_array_equal(
        warp_labels(LABELS, shifted(x, 0), SIZE), warp_labels(LABELS, shifted(nearest, 0), SIZE)
    )


def test_any_sane_homography_fetches_the_nearest_pixel() -> None:
    rng, tried = generator(0, "homographies"), 0
    for _ in range(60):
        H = np.eye(3) + rng.normal(0, 0.1, (3, 3)) * [[1, 1, 80], [1, 1, 80], [0.01, 0.01, 0]]
        if not is_sane(H, *SIZE):
            continue
        expected, from_a_tie = fetched(LABELS, H)
        clear = from_a_tie > 1e-3
        np.testing.assert_array_equal(warp_labels(LABELS, H, SIZE)[clear], expected[clear])
        tried += 1
    assert tried > 40


def test_no_label_of_the_keyframe_stays_no_label() -> None:
    holes = LABELS.copy()
    holes[10:20, 30:40] = NO_LABEL
    assert (warp_labels(holes, shifted(4, 2), SIZE)[12:22, 34:44] == NO_LABEL).all()


def test_the_current_frame_may_have_another_size() -> None:
    double = np.diag([2.0, 2.0, 1.0])
    warped = warp_labels(LABELS, double, (192, 128))
    assert warped.shape == (128, 192)
    np.testing.assert_array_equal(warped[::2, ::2], LABELS)
