"""Labels from a keyframe: held, or moved by a homography."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.classes import NO_LABEL, Labels
from stsem.frame import Frame, Segmentation
from stsem.geometry.homography import Homography
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagate import PROPAGATIONS, Hold, HomographyWarp
from stsem.uncertainty import Uncertainty

WIDTH, HEIGHT = 20, 14


def keyframe(labels: Labels) -> Keyframe:
    return Keyframe(0, 0, Segmentation(labels))


def frame(width: int = WIDTH, height: int = HEIGHT) -> Frame:
    return Frame(1, 1, np.zeros((height, width, 3), np.uint8))


def picture(seed: int = 0) -> Labels:
    """Random labels, some pixels without."""
    labels = np.random.default_rng(seed).integers(0, 5, (HEIGHT, WIDTH)).astype(np.uint8)
    labels[labels == 4] = NO_LABEL
    return labels


def shift(dx: float, dy: float) -> Homography:
    return Homography(np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1]], np.float64), 100, 100)


def test_hold_copies() -> None:
    """Every pixel, those without a label too; a homography changes nothing."""
    labels = picture()
    for homography in (None, shift(3, 0)):
        assert (Hold().propagate(keyframe(labels), frame(), homography).labels == labels).all()


def test_hold_resizes_by_nearest_neighbour() -> None:
    """Twice the size: each pixel four times, nothing in between."""
    labels = picture()
    held = Hold().propagate(keyframe(labels), frame(2 * WIDTH, 2 * HEIGHT), None).labels
    assert (held == labels.repeat(2, axis=0).repeat(2, axis=1)).all()
    small = Hold().propagate(keyframe(labels), frame(WIDTH // 2, HEIGHT // 2), None).labels
    assert small.shape == (HEIGHT // 2, WIDTH // 2)
    assert set(np.unique(small)) <= set(np.unique(labels))


@settings(max_examples=60, deadline=None)
@given(dx=st.integers(-25, 25), dy=st.integers(-18, 18), seed=st.integers(0, 5))
def test_translations_are_exact(dx: int, dy: int, seed: int) -> None:
    """Whole pixels move to the pixel; what the keyframe does not reach is copied in place; 255 stays 255."""
    labels = picture(seed)
    warped = HomographyWarp().propagate(keyframe(labels), frame(), shift(dx, dy)).labels
    expected = labels.copy()
    for y in range(HEIGHT):
        for x in range(WIDTH):
            if 0 <= y - dy < HEIGHT and 0 <= x - dx < WIDTH:
                expected[y, x] = labels[y - dy, x - dx]
    assert (warped == expected).all()


def test_no_homography_holds() -> None:
    """Without one that can be trusted the whole keyframe is copied."""
    labels = picture()
    assert (HomographyWarp().propagate(keyframe(labels), frame(), None).labels == labels).all()


def test_the_keyframe_is_left_alone() -> None:
    """Its labels serve the next frame, too; and a caller that writes into an answer must not reach them by accident."""
    labels = picture()
    before = labels.copy()
    HomographyWarp().propagate(keyframe(labels), frame(), shift(2, 1))
    Hold().propagate(keyframe(labels), frame(), None)
    assert (labels == before).all()


def test_the_keyframe_of_another_size() -> None:
    """H maps keyframe pixels to frame pixels: a zoom of 2 from an image of half the size."""
    labels = picture()
    zoom = Homography(np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1]], np.float64), 100, 100)
    warped = HomographyWarp().propagate(keyframe(labels), frame(2 * WIDTH, 2 * HEIGHT), zoom).labels
    assert (warped == labels.repeat(2, axis=0).repeat(2, axis=1)).all()


@pytest.mark.parametrize(("name", "needs"), [("hold", False), ("homography", True)])
def test_table(name: str, needs: bool) -> None:
    """What the command line offers, and what each asks of the register stage."""
    assert PROPAGATIONS[name]().needs_homography is needs
    assert set(PROPAGATIONS) == {"hold", "homography"}


@pytest.mark.parametrize("method", PROPAGATIONS)
@pytest.mark.parametrize("homography", [None, shift(3, -2)])
@pytest.mark.parametrize("grown", [1, 2])
def test_confidence_stays_with_its_label(method: str, homography: Homography | None, grown: int) -> None:
    """Coded so that it tells the label, it still does after the move; maps of uncertainty do not come along."""
    labels = picture()
    said = Uncertainty(("entropy",), np.zeros((1, HEIGHT, WIDTH), np.uint8), 5)
    source = Keyframe(0, 0, Segmentation(labels, labels / np.float32(256), said))
    answer = PROPAGATIONS[method]().propagate(source, frame(grown * WIDTH, grown * HEIGHT), homography)
    assert answer.confidence is not None
    assert answer.confidence.dtype == np.float32
    np.testing.assert_array_equal(answer.confidence * 256, answer.labels)
    assert answer.uncertainty is None
    plain = PROPAGATIONS[method]().propagate(keyframe(labels), frame(grown * WIDTH, grown * HEIGHT), homography)
    assert plain.confidence is None
    np.testing.assert_array_equal(plain.labels, answer.labels)
