"""Labels from a keyframe: held, or moved by a homography."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.classes import NO_LABEL, ClassSet, Labels
from stsem.frame import Frame, Segmentation
from stsem.geometry.homography import Homography
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagate import PROPAGATIONS
from stsem.stages.propagation.hold import Hold
from stsem.stages.propagation.homography import LOST, HomographyWarp
from stsem.stages.register import Registration
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


def registered(homography: Homography | None) -> Registration:
    return Registration(None, {0: homography})


def held(source: Keyframe, shot: Frame, homography: Homography | None = None) -> Segmentation:
    return Hold().predict(source, shot, registered(homography)).answer


def warped_by(homography: Homography | None, source: Keyframe, shot: Frame) -> Segmentation:
    return HomographyWarp(0).predict(source, shot, registered(homography)).answer


def test_hold_copies() -> None:
    """Every pixel, those without a label too; a homography changes nothing."""
    labels = picture()
    for homography in (None, shift(3, 0)):
        assert (held(keyframe(labels), frame(), homography).labels == labels).all()


def test_hold_resizes_by_nearest_neighbour() -> None:
    """Twice the size: each pixel four times, nothing in between."""
    labels = picture()
    big = held(keyframe(labels), frame(2 * WIDTH, 2 * HEIGHT)).labels
    assert (big == labels.repeat(2, axis=0).repeat(2, axis=1)).all()
    small = held(keyframe(labels), frame(WIDTH // 2, HEIGHT // 2)).labels
    assert small.shape == (HEIGHT // 2, WIDTH // 2)
    assert set(np.unique(small)) <= set(np.unique(labels))


@settings(max_examples=60, deadline=None)
@given(dx=st.integers(-25, 25), dy=st.integers(-18, 18), seed=st.integers(0, 5))
def test_translations_are_exact(dx: int, dy: int, seed: int) -> None:
    """Whole pixels move to the pixel; what the keyframe does not reach gets its border; 255 stays 255."""
    labels = picture(seed)
    answer = warped_by(shift(dx, dy), keyframe(labels), frame())
    expected, reached = labels.copy(), np.zeros(labels.shape, np.bool_)
    for y in range(HEIGHT):
        for x in range(WIDTH):
            expected[y, x] = labels[min(max(y - dy, 0), HEIGHT - 1), min(max(x - dx, 0), WIDTH - 1)]
            reached[y, x] = 0 <= y - dy < HEIGHT and 0 <= x - dx < WIDTH
    assert (answer.labels == expected).all()
    assert answer.covered is not None
    assert (answer.covered == reached).all()
    method = HomographyWarp(0)
    method.selected(replace(frame(), index=0), None)
    foretold = method.expected_coverage(frame(), registered(shift(dx, dy)))
    assert foretold == pytest.approx(reached.mean(), abs=1e-3)


def test_no_homography_holds() -> None:
    """Without one that can be trusted the whole keyframe is copied."""
    labels = picture()
    found = HomographyWarp(0).predict(keyframe(labels), frame(), registered(None))
    assert (found.answer.labels == labels).all()
    assert found.answer.covered is not None
    assert not found.answer.covered.any()
    assert found.remark == LOST


def test_the_keyframe_is_left_alone() -> None:
    """Its labels serve the next frame, too; and a caller that writes into an answer must not reach them by accident."""
    labels = picture()
    before = labels.copy()
    warped_by(shift(2, 1), keyframe(labels), frame())
    held(keyframe(labels), frame())
    assert (labels == before).all()


def test_the_keyframe_of_another_size() -> None:
    """H maps keyframe pixels to frame pixels: a zoom of 2 from an image of half the size."""
    labels = picture()
    zoom = Homography(np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1]], np.float64), 100, 100)
    warped = warped_by(zoom, keyframe(labels), frame(2 * WIDTH, 2 * HEIGHT)).labels
    assert (warped == labels.repeat(2, axis=0).repeat(2, axis=1)).all()


@pytest.mark.parametrize("method", ["hold", "homography"])
@pytest.mark.parametrize("homography", [None, shift(3, -2)])
@pytest.mark.parametrize("grown", [1, 2])
def test_confidence_stays_with_its_label(method: str, homography: Homography | None, grown: int) -> None:
    """Coded so that it tells the label, it still does after the move; maps of uncertainty do not come along."""
    labels = picture()
    said = Uncertainty(("entropy",), np.zeros((1, HEIGHT, WIDTH), np.uint8), 5)
    source = Keyframe(0, 0, Segmentation(labels, labels / np.float32(256), said))
    made, shot = PROPAGATIONS[method].make(ClassSet(("a", "b")), 0), frame(grown * WIDTH, grown * HEIGHT)
    answer = made.predict(source, shot, registered(homography)).answer
    assert answer.confidence is not None
    assert answer.confidence.dtype == np.float32
    np.testing.assert_array_equal(answer.confidence * 256, answer.labels)
    assert answer.uncertainty is None
    plain = made.predict(keyframe(labels), shot, registered(homography)).answer
    assert plain.confidence is None
    np.testing.assert_array_equal(plain.labels, answer.labels)
