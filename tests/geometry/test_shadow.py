"""Shadows of the projector: narrow gaps of a row take the farther depth at their ends, all else stays as it was."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from stsem.frame import Depth
from stsem.geometry.shadow import WIDEST, filled

NAN = np.nan
WIDTH = 50
LIMIT = 4
"""Pixels of the widest gap that is filled in a row of WIDTH."""
DEPTHS = arrays(
    np.float32,
    array_shapes(min_dims=2, max_dims=2, max_side=60).map(lambda shape: (min(shape[0], 4), shape[1])),
    elements=st.sampled_from([NAN, 0.0, 1.0, 2.0, 3.0]).map(np.float32),
    fill=st.nothing(),
)


def with_gap(start: int, length: int, before: float = 2.0, after: float = 3.0, unknown: float = NAN) -> Depth:
    """(3, WIDTH): in the middle row `before`, then a gap of `length` from column `start` on, then `after`."""
    depth = np.full((3, WIDTH), 7, np.float32)
    depth[1, :start], depth[1, start : start + length], depth[1, start + length :] = before, unknown, after
    return depth


def by_definition(depth: Depth) -> Depth:
    """Pixel by pixel: walk to both ends of the gap it lies in."""
    (height, width), out = depth.shape, depth.copy()
    for row in range(height):
        for column in range(width):
            if depth[row, column] > 0:
                continue
            left = right = column
            while left >= 0 and not depth[row, left] > 0:
                left -= 1
            while right < width and not depth[row, right] > 0:
                right += 1
            if left >= 0 and right < width and right - left - 1 <= WIDEST * width:
                out[row, column] = max(depth[row, left], depth[row, right])
    return out


@settings(max_examples=200, deadline=None)
@given(DEPTHS)
def test_gaps_are_filled_as_defined_pixel_by_pixel(depth: Depth) -> None:
    before = depth.copy()
    found = filled(depth)
    np.testing.assert_array_equal(found, by_definition(depth))
    np.testing.assert_array_equal(found[depth > 0], depth[depth > 0])
    np.testing.assert_array_equal(depth, before)
    assert found.dtype == np.float32


@pytest.mark.parametrize(("before", "after"), [(1.5, 4.0), (4.0, 1.5)])
@pytest.mark.parametrize("unknown", [NAN, 0.0])
def test_the_farther_end_wins_on_whichever_side_it_is(before: float, after: float, unknown: float) -> None:
    depth = with_gap(20, 3, before, after, unknown)
    expected = depth.copy()
    expected[1, 20:23] = 4
    np.testing.assert_array_equal(filled(depth), expected)


@pytest.mark.parametrize("start", [1, 20, WIDTH - LIMIT - 2])
def test_a_gap_as_wide_as_a_shadow_is_filled_and_a_wider_one_is_not(start: int) -> None:
    assert int(WIDEST * WIDTH) == LIMIT
    assert (filled(with_gap(start, LIMIT))[1, start : start + LIMIT] == 3).all()
    wider = with_gap(start, LIMIT + 1)
    np.testing.assert_array_equal(filled(wider), wider)


@pytest.mark.parametrize("start", [0, WIDTH - 2])
def test_a_gap_that_touches_a_side_of_the_image_stays(start: int) -> None:
    depth = with_gap(start, 2)
    np.testing.assert_array_equal(filled(depth), depth)


def test_a_gap_does_not_run_on_from_one_row_into_the_next() -> None:
    """Two gaps at the sides have one end each, though in memory they are one gap with two ends."""
    depth = with_gap(WIDTH - 2, 2)
    depth[2, :2] = NAN
    np.testing.assert_array_equal(filled(depth), depth)
    depth[1, 10:12] = depth[2, 5:7] = NAN
    expected = depth.copy()
    expected[1, 10:12], expected[2, 5:7] = 2, 7
    np.testing.assert_array_equal(filled(depth), expected)


@pytest.mark.parametrize(
    "depth",
    [
        np.full((3, WIDTH), 2, np.float32),
        np.full((3, WIDTH), NAN, np.float32),
        np.zeros((3, WIDTH), np.float32),
        np.array([[1], [NAN], [2]], np.float32),
        np.full((3, 1), NAN, np.float32),
        np.array([[NAN]], np.float32),
        np.array([[2]], np.float32),
    ],
    ids=["no gap", "all unknown", "all zero", "one column", "one column unknown", "one pixel unknown", "one pixel"],
)
def test_where_no_gap_has_two_ends_everything_stays(depth: Depth) -> None:
    np.testing.assert_array_equal(filled(depth), depth)


def test_one_row_is_filled_like_any() -> None:
    row = with_gap(20, 3)[1:2]
    np.testing.assert_array_equal(filled(row), np.where(np.isnan(row), np.float32(3), row))


def test_a_part_of_a_larger_image_is_filled_as_if_it_stood_alone() -> None:
    whole = np.tile(with_gap(20, 3), (1, 2))
    np.testing.assert_array_equal(filled(whole[:, :WIDTH]), filled(with_gap(20, 3)))
