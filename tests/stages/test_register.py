"""Registration repeats, whatever came before it."""

import numpy as np

from stsem.frame import Frame
from stsem.stages.register import Anchor, Register, Registration
from tests.made_up_walk import SHIFT, wall

WIDTH, HEIGHT, FRAMES = 192, 128, 6


def frames() -> list[Frame]:
    """A window sliding over a painted wall."""
    colours, _ = wall(WIDTH, HEIGHT, FRAMES)
    return [Frame(i, i, colours[:, SHIFT * i : SHIFT * i + WIDTH].copy()) for i in range(FRAMES)]


def mapping(found: Registration) -> bytes:
    (homography,) = found.homographies.values()
    assert homography is not None
    return homography.H.tobytes()


def anchor(register: Register, shot: Frame) -> Anchor:
    features = register(shot, ()).features
    assert features is not None
    return Anchor(shot.index, features)


def test_call_order_does_not_matter() -> None:
    """Each pair of frames draws for itself: backwards, twice, and after other pairs, the bits are the same."""
    shots, register = frames(), Register(seed=1)
    first = anchor(register, shots[0])
    forwards = [mapping(register(shot, [first])) for shot in shots[1:]]
    other = Register(seed=1)
    other(shots[3], [anchor(other, shots[2])])
    backwards = [mapping(other(shot, [first])) for shot in reversed(shots[1:])]
    assert forwards == backwards[::-1]


def test_it_finds_the_motion() -> None:
    """The window moves to the right, so the image moves to the left, by a known number of pixels."""
    shots, register = frames(), Register(seed=0)
    first = anchor(register, shots[0])
    for shot in shots[1:]:
        found = register(shot, [first]).homographies[0]
        assert found is not None
        expected = np.array([[1, 0, -SHIFT * shot.index], [0, 1, 0], [0, 0, 1]])
        corners = np.array([[0, 0, 1], [WIDTH, 0, 1], [0, HEIGHT, 1], [WIDTH, HEIGHT, 1]]).T
        moved, wanted = found.H @ corners, expected @ corners
        assert np.abs(moved[:2] / moved[2] - wanted[:2]).max() < 1.0


def test_nothing_to_see() -> None:
    """A grey image has no features and no homography, in either role."""
    grey = Frame(1, 1, np.full((HEIGHT, WIDTH, 3), 127, np.uint8))
    register, textured = Register(seed=0), frames()[0]
    found = register(grey, [anchor(register, textured)])
    assert found.features is not None
    assert (len(found.features), found.homographies) == (0, {0: None})
    assert register(textured, [Anchor(1, found.features)]).homographies == {1: None}


def test_each_keyframe_has_its_homography() -> None:
    """To several at once it is the same as to each alone."""
    shots, register = frames(), Register(seed=3)
    anchors = [anchor(register, shot) for shot in shots[:3]]
    assert register(shots[0], ()).homographies == {}
    together = register(shots[5], anchors)
    assert list(together.homographies) == [0, 1, 2]
    for one in anchors:
        alone, among = register(shots[5], [one]).homographies[one.index], together.homographies[one.index]
        assert alone is not None
        assert among is not None
        assert alone.H.tobytes() == among.H.tobytes()


def test_who_follows_sees_every_frame() -> None:
    """In order, with its registration; and nobody looks for points that nobody wants."""
    seen: list[tuple[int, bool]] = []

    class Follower:
        def see(self, frame: Frame, registration: Registration) -> None:
            seen.append((frame.index, registration.features is None))

    for points in (True, False):
        for shot in frames()[:3]:
            Register(0, points, Follower())(shot, ())
    assert seen == [(0, False), (1, False), (2, False), (0, True), (1, True), (2, True)]
