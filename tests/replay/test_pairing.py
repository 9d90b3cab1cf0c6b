"""Between a keyframe's choice and its labels any number of frames may pass: what they are registered to, and when."""

from collections.abc import Sequence

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.frame import Frame, Segmentation
from stsem.geometry.features import Features
from stsem.geometry.homography import Homography
from stsem.replay.answer import AnswerRule, Prediction
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagation.homography import HomographyWarp
from stsem.stages.propagation.method import Memoryless, Needs, Predicted
from stsem.stages.register import Anchor, Registration
from stsem.stages.select import EveryPolicy

from .conftest import NumberSegmenter

WIDTH, HEIGHT = 16, 4


class Shifting:
    """A register stage that knows: each frame lies one pixel to the left of the one before."""

    def __init__(self) -> None:
        self.asked: dict[int, list[int]] = {}

    def __call__(self, frame: Frame, anchors: Sequence[Anchor]) -> Registration:
        self.asked[frame.index] = [anchor.index for anchor in anchors]
        features = Features(np.empty((0, 2), np.float32), np.empty((0, 32), np.uint8), WIDTH, HEIGHT)
        return Registration(features, {a.index: _shift(a.index - frame.index) for a in anchors})


class Followed(Memoryless):
    """Notes which keyframes it must follow."""

    needs = Needs(follows=True)

    def __init__(self) -> None:
        self.alive: set[int] = set()

    def selected(self, frame: Frame, registration: Registration | None) -> None:
        self.alive.add(frame.index)

    def forgotten(self, index: int) -> None:
        self.alive.remove(index)

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        assert source.index in self.alive
        return Predicted(source.segmentation, source.index)

    def expected_coverage(self, frame: Frame, registration: Registration) -> None:
        """Unknown."""


def _shift(dx: int) -> Homography:
    return Homography(np.array([[1, 0, dx], [0, 1, 0], [0, 0, 1]], np.float64), 50, 50)


def shot(index: int) -> Frame:
    return Frame(index, index, np.zeros((HEIGHT, WIDTH, 3), np.uint8))


def seen_from(index: int) -> Segmentation:
    """A scene whose column c has the label c, as the frame `index` sees it."""
    return Segmentation(np.tile(np.arange(index, index + WIDTH, dtype=np.uint8), (HEIGHT, 1)))


def test_a_prediction_takes_the_homography_of_the_keyframe_it_comes_from() -> None:
    """Frame 4 is selected, but until it is finished frames come from 0, moved by the homography from 0."""
    register = Shifting()
    rule = AnswerRule(NumberSegmenter(), Prediction(EveryPolicy(4), HomographyWarp(0), register))
    sources = {}
    for index in range(8):
        if index == 6:
            rule.finish(shot(4), seen_from(4))
        frame = shot(index)
        registration = rule.register(frame)
        if rule.choose(frame, registration) is not None and index == 0:
            rule.finish(frame, seen_from(0))
            continue
        found = rule.propagate(frame, registration)
        assert found is not None
        sources[index] = found.keyframe
        covered = found.answer.covered
        assert covered is not None
        np.testing.assert_array_equal(found.answer.labels[covered], seen_from(index).labels[covered])
        assert covered.sum() == HEIGHT * (WIDTH - index + found.keyframe)
    assert sources == {1: 0, 2: 0, 3: 0, 4: 0, 5: 0, 6: 4, 7: 4}
    assert register.asked == {0: [], 1: [0], 2: [0], 3: [0], 4: [0], 5: [0], 6: [4], 7: [4]}


@settings(max_examples=60)
@given(plan=st.lists(st.tuples(st.integers(0, 5), st.booleans()), min_size=1, max_size=30))
def test_a_method_follows_the_source_and_what_may_become_it(plan: list[tuple[int, bool]]) -> None:
    """Every frame is selected and finished, or abandoned, some frames later; whatever the order.

    Followed are the newest finished keyframe and the unfinished ones, and nothing else.
    """
    method = Followed()
    rule = AnswerRule(NumberSegmenter(), Prediction(EveryPolicy(1), method, None))
    unfinished: set[int] = set()
    for index in range(len(plan)):
        assert rule.choose(shot(index), None) is not None
        unfinished.add(index)
        for due in [i for i in unfinished if i + plan[i][0] <= index]:
            unfinished.remove(due)
            if plan[due][1]:
                rule.finish(shot(due), seen_from(due))
            else:
                rule.abandon(shot(due))
        source = rule.source
        assert method.alive == unfinished | (set() if source is None else {source.index})
        found = rule.propagate(shot(index), None)
        assert (found is None) == (source is None)
