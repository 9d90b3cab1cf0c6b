"""Chained flow: on known maps exactly, on images that were shifted by known steps to a pixel."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from stsem.chance import generator
from stsem.geometry.flow import Chain, backward_flow, working_grey

LABELS = generator(0, "labels").integers(0, 13, (64, 96)).astype(np.uint8)
GREY = np.zeros((64, 96), np.uint8)
EVERYWHERE = np.arange(64 * 96)


def flow(x: float, y: float) -> npt.NDArray[np.float32]:
    return np.full((64, 96, 2), (x, y), np.float32)


def texture() -> npt.NDArray[np.uint8]:
    """(200, 300, 3) blobs of several sizes."""
    rng = generator(0, "texture")
    noise = [cv2.resize(rng.random((200 // s, 300 // s), np.float32), (300, 200)) for s in (4, 8, 20)]
    grey = np.clip(sum(noise) * 85, 0, 255).astype(np.uint8)
    return np.asarray(np.repeat(grey[..., None], 3, axis=2))


def test_the_chain_of_no_flow_is_the_keyframe() -> None:
    chain = Chain.start(GREY).extended(flow(0, 0)).extended(flow(0, 0))
    carried = chain.carry(LABELS, LABELS.astype(np.float32) / 13, (96, 64))
    np.testing.assert_array_equal(carried.labels, LABELS)
    assert carried.confidence is not None
    np.testing.assert_array_equal(carried.confidence, LABELS.astype(np.float32) / 13)
    assert carried.coverage == 1


@settings(max_examples=20)
@given(st.lists(st.tuples(st.integers(-6, 6), st.integers(-6, 6)), min_size=1, max_size=6))
def test_whole_steps_add_up_and_what_came_from_outside_is_not_covered(steps: list[tuple[int, int]]) -> None:
    chain, seen = Chain.start(GREY), np.ones((64, 96), np.bool_)
    y, x = np.mgrid[:64, :96]
    for step in steps:
        chain = chain.extended(flow(*step))
        at_x, at_y = x + step[0], y + step[1]
        inside = (at_x >= 0) & (at_x < 96) & (at_y >= 0) & (at_y < 64)
        seen = inside & seen[np.clip(at_y, 0, 63), np.clip(at_x, 0, 95)]
    total_x, total_y = (sum(step[axis] for step in steps) for axis in (0, 1))
    carried = chain.carry(LABELS, None, (96, 64))
    np.testing.assert_array_equal(carried.covered, seen)
    expected = LABELS[np.clip(y + total_y, 0, 63), np.clip(x + total_x, 0, 95)]
    np.testing.assert_array_equal(carried.labels[seen], expected[seen])


def test_a_chain_follows_its_links_in_order() -> None:
    """M_2(x) = M_1(x + f_2(x)): a shift after a mirror is not a mirror after a shift."""
    x = np.arange(96, dtype=np.float32)
    mirror = flow(0, 0)
    mirror[..., 0] = 95 - 2 * x
    carried = Chain.start(GREY).extended(mirror).extended(flow(5, 0)).carry(LABELS, None, (96, 64))
    np.testing.assert_array_equal(carried.labels[:, :91], LABELS[:, ::-1][:, 5:])


def test_what_came_in_gets_the_label_of_the_border() -> None:
    carried = Chain.start(GREY).extended(flow(10, 0)).carry(LABELS, None, (96, 64))
    np.testing.assert_array_equal(carried.labels[:, 86:], np.repeat(LABELS[:, 95:], 10, axis=1))
    assert not carried.covered[:, 86:].any()
    assert carried.coverage == pytest.approx(86 / 96)


def wavy(seed: int) -> npt.NDArray[np.float32]:
    """Flow in eighths of a pixel, another one at each: two links of it add up without rounding."""
    return generator(seed, "wavy").integers(-40, 41, (64, 96, 2)).astype(np.float32) / 8


def depths(seed: int, times: int = 1) -> npt.NDArray[np.float32]:
    """(64, 96), or so many `times` as large: a few distances and some that are unknown."""
    some = np.array([1, 1.25, 1.5, 1.75, 2, np.nan], np.float32)
    return np.asarray(some[generator(seed, "depths").integers(0, len(some), (64 * times, 96 * times))])


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 1000), st.one_of(st.integers(1, 40), st.integers(250, 260), st.integers(500, 6144)),
    st.tuples(st.sampled_from((1, 2)), st.sampled_from((1, 2))),
)  # fmt: skip
@example(0, 6144, (1, 1))
@example(0, 6144, (2, 1))
@example(0, 6144, (1, 2))
def test_some_pixels_are_traced_to_what_all_are_carried_from(seed: int, count: int, times: tuple[int, int]) -> None:
    """Answer and keyframe are so many `times` as large as the working image; twice is exact in binary, too.

    Covered are the pixels that stayed inside and end at about the distance that they began at.
    """
    chain, size = Chain.start(GREY).extended(wavy(seed)).extended(wavy(seed + 1)), (96 * times[0], 64 * times[0])
    rows = np.sort(generator(seed, "rows").permutation(size[0] * size[1])[:count])
    here, there = depths(seed, times[0]), depths(seed + 1, times[1])
    labels = generator(seed, "labels").integers(0, 256, there.shape).astype(np.uint8)
    sure = generator(seed, "sure").random(there.shape, np.float32)
    traced = chain.trace(rows, labels, sure, (here, there), within_m=0.5)
    whole, distance = chain.carry(labels, sure, size), chain.carry(labels, there, size).confidence
    assert whole.confidence is not None
    assert traced.confidence is not None
    np.testing.assert_array_equal(traced.rows, rows)
    np.testing.assert_array_equal(traced.labels, whole.labels.reshape(-1)[rows])
    np.testing.assert_array_equal(traced.confidence, whole.confidence.reshape(-1)[rows])
    covered = whole.covered & (np.abs(distance - here) <= 0.5)
    np.testing.assert_array_equal(traced.covered, covered.reshape(-1)[rows])
    assert (traced.labels.dtype, traced.confidence.dtype, traced.covered.dtype) == (np.uint8, np.float32, np.bool_)


def test_what_left_the_image_is_not_covered_though_its_distance_agrees() -> None:
    flat = np.full((64, 96), 3, np.float32)
    traced = Chain.start(GREY).extended(flow(10, 0)).trace(EVERYWHERE, LABELS, None, (flat, flat), within_m=0.5)
    np.testing.assert_array_equal(traced.covered, EVERYWHERE % 96 < 86)
    assert traced.confidence is None


@pytest.mark.parametrize(("end", "covered"), [(2.4, False), (2.6, True), (3, True), (3.4, True), (3.6, False)])
def test_a_body_may_come_nearer_or_go_away_by_so_much(end: float, covered: bool) -> None:
    here, there = np.full((64, 96), 3, np.float32), np.full((64, 96), end, np.float32)
    traced = Chain.start(GREY).trace(EVERYWHERE, LABELS, None, (here, there), within_m=0.5)
    assert (traced.covered == covered).all()


def test_where_either_depth_is_unknown_it_is_not_covered() -> None:
    here, there = np.full((64, 96), 3, np.float32), np.full((64, 96), 3, np.float32)
    here[10:20, 10:20] = there[15:25, 40:50] = np.nan
    here[50, 50] = there[50, 50] = np.nan
    traced = Chain.start(GREY).trace(EVERYWHERE, LABELS, None, (here, there), within_m=0.5)
    np.testing.assert_array_equal(traced.covered, ~np.isnan(here + there).reshape(-1))
    np.testing.assert_array_equal(traced.labels, LABELS.reshape(-1))


def test_a_chain_stays_with_a_body_and_not_with_what_it_uncovers() -> None:
    """A body 2 m away goes two pixels to the right before a wall at 5 m; flow that stuck says that it grew."""
    keyframe, depth = np.full((40, 60), 5, np.float32), np.full((40, 60), 5, np.float32)
    keyframe[10:30, 20:30] = depth[10:30, 22:32] = 2
    labels = np.where(keyframe == 2, np.uint8(7), np.uint8(1))
    stuck = np.zeros((40, 60, 2), np.float32)
    stuck[10:30, 22:32] = (-2, 0)
    chain = Chain.start(np.zeros((40, 60), np.uint8)).extended(stuck)
    traced = chain.trace(np.arange(depth.size), labels, None, (depth, keyframe), within_m=0.5)
    grown, uncovered = np.ones((40, 60), np.uint8), np.ones((40, 60), np.bool_)
    grown[10:30, 20:32], uncovered[10:30, 20:22] = 7, False
    np.testing.assert_array_equal(traced.labels.reshape(40, 60), grown)
    np.testing.assert_array_equal(traced.covered.reshape(40, 60), uncovered)


def test_it_is_told_where_a_chain_leads_to_some_classes() -> None:
    """A person of 10 by 20 pixels, five pixels to the right since; a pixel around belongs to it."""
    labels = np.zeros((64, 96), np.uint8)
    labels[20:40, 30:40] = 7
    expected = np.zeros((64, 96), np.bool_)
    expected[19:41, 34:46] = True
    chain = Chain.start(GREY).extended(flow(-5, 0))
    np.testing.assert_array_equal(chain.leads_to(np.arange(256) == 7, labels, (96, 64)), expected)
    twice = np.repeat(np.repeat(labels, 2, axis=0), 2, axis=1)
    full = chain.leads_to(np.arange(256) == 7, twice, (192, 128))
    np.testing.assert_array_equal(full, np.repeat(np.repeat(expected, 2, axis=0), 2, axis=1))
    assert not chain.leads_to(np.arange(256) == 8, labels, (96, 64)).any()


def test_without_pixels_nothing_is_traced() -> None:
    rows, flat = np.empty(0, np.intp), np.full((64, 96), 3, np.float32)
    traced = Chain.start(GREY).trace(rows, LABELS, flat, (flat, flat), within_m=0.5)
    assert traced.confidence is not None
    assert traced.labels.shape == traced.confidence.shape == traced.covered.shape == traced.rows.shape == (0,)
    assert (traced.labels.dtype, traced.confidence.dtype, traced.covered.dtype) == (np.uint8, np.float32, np.bool_)
    assert Chain.start(GREY).trace(rows, LABELS, None, (flat, flat), within_m=0.5).confidence is None


def test_a_larger_keyframe_is_traced_to_the_middle_of_what_a_pixel_shows() -> None:
    fine, flat = generator(1, "fine").integers(0, 13, (192, 288)).astype(np.uint8), np.full((64, 96), 3, np.float32)
    there = np.full((192, 288), np.nan, np.float32)
    there[1::3, 1::3] = 3
    sure = fine.astype(np.float32) / 13
    traced = Chain.start(GREY).extended(flow(4, -2)).trace(EVERYWHERE, fine, sure, (flat, there), within_m=0.5)
    inner = np.s_[2:, :92]
    labels, covered = traced.labels.reshape(64, 96), traced.covered.reshape(64, 96)
    np.testing.assert_array_equal(labels[inner], fine[1::3, 1::3][:-2, 4:])
    np.testing.assert_array_equal(covered, np.pad(np.ones((62, 92), np.bool_), ((2, 0), (0, 4))))
    assert traced.confidence is not None
    np.testing.assert_array_equal(traced.confidence.reshape(64, 96)[inner], sure[1::3, 1::3][:-2, 4:])


def test_a_smaller_keyframe_and_working_image_are_traced_without_a_shift() -> None:
    """Each pixel of theirs is 3 by 3 of the answer."""
    keyframe = depths(5)
    depth, fine = np.kron(keyframe, np.ones((3, 3), np.float32)), np.arange(192 * 288)
    traced = Chain.start(GREY).extended(flow(4, -2)).trace(fine, LABELS, None, (depth, keyframe), within_m=10)
    blocks, known = (np.kron(part, np.ones((3, 3), np.uint8)) for part in (LABELS, ~np.isnan(keyframe)))
    labels, covered = traced.labels.reshape(192, 288), traced.covered.reshape(192, 288)
    np.testing.assert_array_equal(labels[6:, :276], blocks[:-6, 12:])
    np.testing.assert_array_equal(covered[6:, :276], (known[:-6, 12:] & known[6:, :276]) > 0)
    assert not covered[:6].any()
    assert not covered[:, 276:].any()


def test_labels_of_another_size_than_the_working_image_do_not_shift() -> None:
    blocks = np.kron(LABELS, np.ones((3, 3), np.uint8))
    carried = Chain.start(GREY).extended(flow(4, -2)).carry(blocks, None, (288, 192))
    np.testing.assert_array_equal(carried.labels[6:, :276], np.asarray(blocks)[:-6, 12:])


@pytest.mark.parametrize("step", [(0, 0), (3, 0), (-4, 2), (7, -5)])
def test_known_shifts_of_an_image_are_found(step: tuple[int, int]) -> None:
    image, (dx, dy) = texture(), step
    previous, current = image[20:148, 20:212], image[20 + dy : 148 + dy, 20 + dx : 212 + dx]
    found = backward_flow(working_grey(current), working_grey(previous))
    inner = found[16:-16, 16:-16]
    assert np.abs(inner - np.array(step)).max(axis=-1).mean() < 0.25


def test_flow_repeats_to_the_bit_for_any_number_of_threads() -> None:
    image = texture()
    a, b = working_grey(image[:128, :192]), working_grey(image[3:131, 4:196])
    threads = cv2.getNumThreads()
    try:
        found = []
        for n in (1, 2, 4):
            cv2.setNumThreads(n)
            found.append(backward_flow(a, b).tobytes())
    finally:
        cv2.setNumThreads(threads)
    assert len(set(found)) == 1


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (8, 8), (15, 40), (16, 16), (17, 33), (96, 64)])
def test_an_image_of_any_size_has_a_flow(size: tuple[int, int]) -> None:
    image = generator(3, "small").integers(0, 255, (size[1], size[0], 3)).astype(np.uint8)
    grey = working_grey(image)
    found = backward_flow(grey, grey)
    assert found.shape == (size[1], size[0], 2)
    assert np.abs(found).max() < 1


def test_large_images_are_made_smaller_and_small_ones_are_not() -> None:
    assert working_grey(np.zeros((540, 960, 3), np.uint8)).shape == (270, 480)
    assert working_grey(np.zeros((64, 96, 3), np.uint8)).shape == (64, 96)
