"""Registration repeats, whatever came before it."""

import numpy as np

from stsem.frame import Frame
from stsem.stages.register import Register, Registration
from tests.made_up_walk import SHIFT, wall

WIDTH, HEIGHT, FRAMES = 192, 128, 6


def frames() -> list[Frame]:
    """A window sliding over a painted wall."""
    colours, _ = wall(WIDTH, HEIGHT, FRAMES)
    return [Frame(i, i, colours[:, SHIFT * i : SHIFT * i + WIDTH].copy()) for i in range(FRAMES)]


def mapping(found: Registration) -> bytes:
    assert found.homography is not None
    return found.homography.H.tobytes()


def test_call_order_does_not_matter() -> None:
    """Each pair of frames draws for itself: backwards, twice, and after other pairs, the bits are the same."""
    shots, register = frames(), Register(seed=1)
    first = register(shots[0], None, None)
    assert first.homography is None
    forwards = [mapping(register(shot, first.features, 0)) for shot in shots[1:]]
    other = Register(seed=1)
    other(shots[3], other(shots[2], None, None).features, 2)
    backwards = [mapping(other(shot, first.features, 0)) for shot in reversed(shots[1:])]
    assert forwards == backwards[::-1]


def test_it_finds_the_motion() -> None:
    """The window moves to the right, so the image moves to the left, by a known number of pixels."""
    shots, register = frames(), Register(seed=0)
    first = register(shots[0], None, None)
    for shot in shots[1:]:
        found = register(shot, first.features, 0).homography
        assert found is not None
        expected = np.array([[1, 0, -SHIFT * shot.index], [0, 1, 0], [0, 0, 1]])
        corners = np.array([[0, 0, 1], [WIDTH, 0, 1], [0, HEIGHT, 1], [WIDTH, HEIGHT, 1]]).T
        moved, wanted = found.H @ corners, expected @ corners
        assert np.abs(moved[:2] / moved[2] - wanted[:2]).max() < 1.0


def test_nothing_to_see() -> None:
    """A grey image has no features and no homography, in either role."""
    grey = Frame(1, 1, np.full((HEIGHT, WIDTH, 3), 127, np.uint8))
    register, textured = Register(seed=0), frames()[0]
    found = register(grey, register(textured, None, None).features, 0)
    assert (len(found.features), found.homography) == (0, None)
    assert register(textured, found.features, 1).homography is None
