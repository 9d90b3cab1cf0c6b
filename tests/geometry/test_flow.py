"""Chained flow: on known maps exactly, on images that were shifted by known steps to a pixel."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.chance import generator
from stsem.geometry.flow import Chain, backward_flow, working_grey

LABELS = generator(0, "labels").integers(0, 13, (64, 96)).astype(np.uint8)
GREY = np.zeros((64, 96), np.uint8)


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


def test_a_chain_stays_with_a_body_and_not_with_what_it_uncovers() -> None:
    """A body 2 m away goes one pixel to the right before a wall at 5 m; flow that stuck says that it grew."""
    keyframe, depth = np.full((40, 60), 5, np.float32), np.full((40, 60), 5, np.float32)
    keyframe[10:30, 20:30] = depth[10:30, 22:32] = 2
    depth[:2, :2] = np.nan
    stuck = np.zeros((20, 30, 2), np.float32)
    stuck[5:15, 11:16] = (-1, 0)
    stays = Chain.start(np.zeros((20, 30), np.uint8)).extended(stuck).stays(depth, keyframe, within_m=0.5)
    expected = np.ones((40, 60), np.bool_)
    expected[:2, :2] = False
    expected[10:30, 20:22] = False
    assert (stays == expected).all()


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
