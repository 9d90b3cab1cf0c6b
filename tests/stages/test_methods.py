"""Every method of prediction over a made-up walk, whenever its keyframes finish."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import permutations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.camera import Camera
from stsem.classes import ClassSet, Labels
from stsem.frame import Frame, Segmentation
from stsem.stages.keyframe import Keyframe, view_of
from stsem.stages.propagate import PROPAGATIONS
from stsem.stages.propagation.depth import KEPT, LIT, NO_SPACE, DepthWarp
from stsem.stages.propagation.flow import LOST, Flow
from stsem.stages.propagation.homography import ChainedHomography
from stsem.stages.propagation.method import Predicted, Propagation
from stsem.stages.register import Anchor, Register, Registration
from tests.made_up_walk import SHIFT, wall

WIDTH, HEIGHT, FRAMES, FOCAL, FAR = 192, 128, 10, 100.0, 2.0
CLASSES = ClassSet(("wall", "person", "floor", "door"))
CAMERA = Camera(WIDTH, HEIGHT, FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
MOVING = [name for name in PROPAGATIONS if name != "hold"]


def walk() -> list[tuple[Frame, Labels]]:
    """A camera that slides along a painted wall, `FAR` metres off: SHIFT pixels a frame, exactly known."""
    colours, labels = wall(WIDTH, HEIGHT, FRAMES)
    depth = np.full((HEIGHT, WIDTH), FAR, np.float32)
    found = []
    for i in range(FRAMES):
        window = slice(SHIFT * i, SHIFT * i + WIDTH)
        T = np.eye(4)
        T[0, 3] = SHIFT * i * FAR / FOCAL
        frame = Frame(i, i, colours[:, window].copy(), None, depth, T, CAMERA)
        found.append((frame, (labels[:, window] % len(CLASSES)).astype(np.uint8)))
    return found


WALK = walk()


class Played:
    """A method with what registers for it, as a run drives them; the keyframe 0 is finished at once."""

    def __init__(self, method: Propagation, seed: int = 0) -> None:
        needs = method.needs
        self.method, self.anchors = method, dict[int, Anchor]()
        self.register = Register(seed, needs.points, method if needs.follows else None)
        self.registration = Registration()

    def see(self, frame: Frame) -> None:
        self.registration = self.register(frame, list(self.anchors.values()))

    def select(self, frame: Frame) -> None:
        if self.registration.features is not None:
            self.anchors[frame.index] = Anchor(frame.index, self.registration.features)
        self.method.selected(frame, self.registration)

    def finish(self, frame: Frame, labels: Labels) -> Keyframe:
        anchor = self.anchors.get(frame.index)
        features = None if anchor is None else anchor.features
        keyframe = Keyframe(frame.index, frame.stamp_ns, Segmentation(labels), features, view_of(frame), frame.image)
        self.method.finished(keyframe)
        return keyframe

    def predict(self, source: Keyframe, frame: Frame) -> Predicted:
        return self.method.predict(source, frame, self.registration)


def made(name: str) -> Propagation:
    return PROPAGATIONS[name].make(CLASSES, 0)


def answers(name: str, every: int = 100) -> Iterator[tuple[Predicted, Frame, Labels]]:
    """Predictions of a walk with a keyframe every so many frames, finished at once."""
    played, source = Played(made(name)), None
    for frame, labels in WALK:
        played.see(frame)
        if frame.index % every == 0:
            played.select(frame)
            source = played.finish(frame, labels)
        elif source is not None:
            yield played.predict(source, frame), frame, labels


@pytest.mark.parametrize("name", MOVING)
def test_covered_pixels_are_right(name: str) -> None:
    """On a plane that slides along, what is covered is nearly all right, and what came in is not covered."""
    for found, frame, labels in answers(name):
        assert found.answer.covered is not None
        covered = found.answer.covered
        assert (found.answer.labels == labels)[covered].mean() > 0.97
        assert covered.mean() == pytest.approx(1 - SHIFT * frame.index / WIDTH, abs=0.04)
        assert found.keyframe == 0
        assert not found.remark


@pytest.mark.parametrize("name", MOVING)
def test_expected_coverage(name: str) -> None:
    """What is foretold is what comes, but for what depends on labels."""
    played = Played(made(name))
    (first, labels), *others = WALK
    played.see(first)
    played.select(first)
    source = played.finish(first, np.zeros_like(labels))
    for frame, _ in others:
        played.see(frame)
        foretold = played.method.expected_coverage(frame, played.registration)
        covered = played.predict(source, frame).answer.covered
        assert covered is not None
        assert foretold == pytest.approx(covered.mean(), abs=0.03)


@pytest.mark.parametrize("name", PROPAGATIONS)
@settings(max_examples=12)
@given(late=st.integers(1, FRAMES - 1))
def test_a_keyframe_that_finishes_late_is_followed_from_its_own_frame(name: str, late: int) -> None:
    """Whenever its labels come, and whatever keyframe was the source meanwhile, the prediction is the same."""
    last, wanted = WALK[-1][0], None
    for moment in (1, late):
        played = Played(made(name))
        for frame, _ in WALK:
            played.see(frame)
            if frame.index in (0, 1):
                played.select(frame)
            if frame.index == 0:
                played.finish(*WALK[0])
            if frame.index == moment:
                source = played.finish(*WALK[1])
                played.method.forgotten(0)
        found = played.predict(source, last).answer
        wanted = wanted or found
        np.testing.assert_array_equal(found.labels, wanted.labels)
    assert wanted is not None


@pytest.mark.parametrize("name", PROPAGATIONS)
def test_the_bits_do_not_depend_on_threads(name: str) -> None:
    before, found = cv2.getNumThreads(), []
    try:
        for threads in (1, 2, 3):
            cv2.setNumThreads(threads)
            found.append([one.answer.labels.tobytes() for one, _, _ in answers(name, every=4)])
    finally:
        cv2.setNumThreads(before)
    assert found[0] == found[1] == found[2]


def test_needs() -> None:
    """What each asks of others; the row and the object say the same."""
    for name, row in PROPAGATIONS.items():
        assert made(name).needs == row.needs
    asked = {name: (row.needs.points, row.needs.follows, row.needs.space) for name, row in PROPAGATIONS.items()}
    assert asked == {
        "hold": (False, False, False), "homography": (True, False, False), "homography-chained": (True, True, False),
        "flow": (False, True, False), "depth": (False, True, True),
    }  # fmt: skip


def test_what_is_followed_is_let_go() -> None:
    """A chain for every keyframe that is not forgotten, and no more."""
    for method in (Flow(), ChainedHomography(0)):
        played = Played(method)
        for frame, _ in WALK:
            played.see(frame)
            played.select(frame)
            if frame.index >= 2:
                method.forgotten(frame.index - 2)
        assert sorted(method._chains) == [FRAMES - 2, FRAMES - 1]


def test_depth_asks_earlier_keyframes() -> None:
    """Back where the walk began, the newest keyframe saw little and the first one everything."""
    played = Played(made("depth"))
    for frame, labels in (*WALK[:1], *WALK[-1:]):
        played.see(frame)
        played.select(frame)
        source = played.finish(frame, labels)
    frame, labels = WALK[1]
    played.see(frame)
    answer = played.predict(source, frame).answer
    assert answer.covered is not None
    still = labels != CLASSES.names.index("person")
    assert (answer.labels == labels)[still].mean() > 0.95
    assert answer.covered[still].mean() > 0.9


@pytest.mark.parametrize("lacks", ["depth", "T_WC", "camera"])
def test_depth_falls_back_to_flow_and_says_so(lacks: str) -> None:
    """A frame without depth, pose or camera gets what `flow` gives; a keyframe without them is not asked."""
    depth, flow = Played(made("depth")), Played(Flow())
    for played in (depth, flow):
        played.see(WALK[0][0])
        played.select(WALK[0][0])
        source = played.finish(*WALK[0])
    bare = replace(WALK[1][0], **{lacks: None})
    depth.see(bare)
    flow.see(bare)
    unknown = replace(WALK[1][0], depth=np.full((HEIGHT, WIDTH), np.nan, np.float32))
    for frame in (bare, unknown):
        found, wanted = depth.predict(source, frame), flow.predict(source, frame)
        assert found.remark == NO_SPACE
        np.testing.assert_array_equal(found.answer.labels, wanted.answer.labels)
    other = Played(DepthWarp(CLASSES))
    blind = replace(WALK[0][0], **{lacks: None})
    other.see(blind)
    other.select(blind)
    source = other.finish(blind, WALK[0][1])
    other.see(WALK[1][0])
    assert not other.method._memory  # type: ignore[attr-defined]
    assert not other.predict(source, WALK[1][0]).remark


def test_what_nobody_saw_is_guessed_and_not_covered() -> None:
    """A wall, and a darker floor, go on where the image of the keyframe ended, with the votes as confidence."""
    wall_on_floor = np.where(np.arange(HEIGHT)[:, None] < 90, 0, 2).astype(np.uint8).repeat(WIDTH, axis=1)
    played, shade = Played(made("depth")), np.where(wall_on_floor == 0, 4, 1).astype(np.uint8)[..., None]
    walk = [replace(frame, image=frame.image // 4 * shade) for frame, _ in WALK]
    first, last = walk[0], walk[-1]
    played.see(first)
    played.select(first)
    sure = Segmentation(wall_on_floor, np.full(wall_on_floor.shape, 0.5, np.float32))
    source = Keyframe(0, 0, sure, None, view_of(first), first.image)
    played.method.finished(source)
    for frame in walk[1:]:
        played.see(frame)
    answer = played.predict(source, last).answer
    assert answer.covered is not None
    assert answer.confidence is not None
    new = slice(WIDTH - SHIFT * last.index + 8, WIDTH)
    assert not answer.covered[:, new].any()
    assert (answer.labels == wall_on_floor)[:, new].mean() > 0.9
    assert (answer.confidence[answer.covered] == 0.5).all()
    assert (answer.confidence[:, new] > 0.5).mean() > 0.9


def remember(method: DepthWarp, stamp: int, seen: tuple[Frame, Labels]) -> None:
    frame, labels = seen
    method.finished(Keyframe(stamp, stamp, Segmentation(labels), None, view_of(frame), frame.image))


def test_depth_remembers_so_many_keyframes() -> None:
    """The newest by stamp, in whatever order they finished; the newest of them know what lies in shadows."""
    method = DepthWarp(CLASSES)
    for stamp in (*range(0, 2 * KEPT, 2), *range(1, 2 * KEPT, 2)):
        remember(method, stamp, WALK[0])
        stamps = [memory.stamp_ns for memory in method._memory]
        assert stamps == sorted(stamps, reverse=True)
        assert [memory.lit is not None for memory in method._memory] == [i < LIT for i in range(len(stamps))]
    assert stamps == list(range(2 * KEPT - 1, KEPT - 1, -1))
    remember(method, 1, WALK[0])
    assert [memory.stamp_ns for memory in method._memory] == stamps


@pytest.mark.parametrize("order", list(permutations(range(4)))[1:])
def test_the_memory_does_not_depend_on_the_order_in_which_keyframes_finish(order: tuple[int, ...]) -> None:
    """Older ones keep what newer ones do not show: each has depth in two quarters of its image."""
    shots = []
    for i, (frame, labels) in enumerate((WALK[0], WALK[3], WALK[6], WALK[9])):
        known = np.isin(np.arange(WIDTH) // (WIDTH // 4), (i, (i + 1) % 4))
        depth = np.where(known, np.float32(FAR), np.float32(np.nan))[None].repeat(HEIGHT, axis=0)
        shots.append((replace(frame, depth=depth), labels))
    right, method = DepthWarp(CLASSES), DepthWarp(CLASSES)
    for stamp in range(4):
        remember(right, stamp, shots[stamp])
    for stamp in order:
        remember(method, stamp, shots[stamp])
    sizes = [len(memory.examples.labels) for memory in right._memory]
    assert sizes[0] > sizes[-1] > 0
    for found, wanted in zip(method._memory, right._memory, strict=True):
        assert found.stamp_ns == wanted.stamp_ns
        np.testing.assert_array_equal(found.examples.features, wanted.examples.features)
        np.testing.assert_array_equal(found.examples.labels, wanted.examples.labels)
    assert len(method._likeness) == sum(sizes)


def test_flow_over_a_change_of_size_holds() -> None:
    """There is no flow between images of two sizes: the keyframe is held, nothing is covered, and it is said."""
    played = Played(Flow())
    played.see(WALK[0][0])
    played.select(WALK[0][0])
    source = played.finish(*WALK[0])
    small = replace(WALK[1][0], image=np.ascontiguousarray(WALK[1][0].image[::2, ::2]))
    played.see(small)
    found = played.predict(source, small)
    assert found.answer.labels.shape == small.image.shape[:2]
    assert found.remark == LOST
    assert found.answer.covered is not None
    assert not found.answer.covered.any()


def test_a_broken_chain_of_homographies_holds() -> None:
    """One grey image breaks it for good; from the keyframe itself the next frame is found again."""
    chained, direct = Played(made("homography-chained")), Played(made("homography"))
    grey = replace(WALK[1][0], image=np.full_like(WALK[1][0].image, 127))
    for played, covers in ((chained, False), (direct, True)):
        played.see(WALK[0][0])
        played.select(WALK[0][0])
        source = played.finish(*WALK[0])
        played.see(grey)
        assert played.predict(source, grey).remark
        played.see(WALK[2][0])
        covered = played.predict(source, WALK[2][0]).answer.covered
        assert covered is not None
        assert covered.any() == covers
