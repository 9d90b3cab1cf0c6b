import numpy as np
import pytest

from stsem.metrics.consistency import ConsistencyMeter, agreement, carried


def scene(shift: int) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
    labels = np.zeros((8, 20), np.uint8)
    labels[:, 4 + shift : 12 + shift] = 1
    return labels


def moved(shift: float) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.array([[1, 0, shift], [0, 1, 0], [0, 0, 1]], np.float64)


def test_carried_follows_previous_to_current_pixels() -> None:
    """The homography maps previous to current pixels; what comes into view has no label."""
    found = carried(scene(0), moved(3), 20, 8)
    np.testing.assert_array_equal(found[:, 3:], scene(3)[:, 3:])
    assert (found[:, :3] == 255).all()


def test_a_warped_world_is_consistent_and_a_frozen_one_is_not() -> None:
    """With the right homographies a moving scene scores 1; compared pixel by pixel it does not."""
    followed, frozen = ConsistencyMeter(2, "homography"), ConsistencyMeter(2)
    for i in range(4):
        followed.update(scene(2 * i), moved(2) if i else None)
        frozen.update(scene(2 * i))
    a, b = followed.compute(), frozen.compute()
    assert (a.miou, a.pixel_accuracy, a.pairs, a.correspondence) == (1, 1, 3, "homography")
    # Each pair: 2 of 20 columns leave and 2 enter the object of 8 columns.
    assert b.miou == pytest.approx((10 / 14 + 6 / 10) / 2, abs=1e-15)
    assert (b.pairs, b.correspondence) == (3, "identity")


def test_pairs_without_a_homography_are_left_out() -> None:
    """No trustworthy correspondence, no pair; no pair, no number."""
    meter = ConsistencyMeter(2, "homography")
    meter.update(scene(0))
    meter.update(scene(1), None)
    assert meter.compute().pairs == 0
    assert np.isnan(meter.compute().miou)
    meter.update(scene(2), moved(1))
    assert meter.compute().pairs == 1


def test_unlabelled_pixels_of_the_previous_answer_are_ignored() -> None:
    """What had no label cannot be contradicted; what loses its label disagrees."""
    before, now = scene(0), scene(0)
    before[0], now[1] = 255, 255
    matrix = agreement(before, now, 2)
    assert matrix.sum() == 7 * 20
    assert matrix[:, 2].sum() == 20
