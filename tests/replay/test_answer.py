"""The order of the stages, and the keyframes they remember, without a clock."""

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np
import pytest

from stsem.classes import ClassSet
from stsem.frame import Frame, Segmentation
from stsem.geometry.features import Features
from stsem.geometry.homography import Homography
from stsem.metrics.scorecard import Scorecard
from stsem.replay.answer import EVERY_FRAME, FIRST, AnswerRule, Prediction
from stsem.replay.offline import OfflineRun
from stsem.replay.record import Record
from stsem.replay.schedule import schedule
from stsem.result import Outcome
from stsem.stages.register import Anchor, Registration
from stsem.stages.select import EveryPolicy, PaperPolicy

from .conftest import PERIOD_NS, CopyKeyframe, NumberSegmenter, loaded, make_plans, make_slots, numbered_truth


class Partial(NumberSegmenter):
    """An oracle whose truth exists for some frames only."""

    def __init__(self, has_truth: Callable[[int], bool]) -> None:
        self._has_truth = has_truth

    def can_segment(self, index: int) -> bool:
        return self._has_truth(index)


class Slide:
    """A register stage that knows: each frame lies `step` image widths to the left of the one before."""

    def __init__(self, step: float, lost: frozenset[int] = frozenset()) -> None:
        self.step, self.lost, self.asked = step, lost, []

    def __call__(self, frame: Frame, anchors: Sequence[Anchor]) -> Registration:
        features = Features(np.full((1, 2), frame.index, np.float32), np.zeros((1, 32), np.uint8), 4, 4)
        if not anchors:
            self.asked.append((None, frame.index))
        return Registration(features, {anchor.index: self._between(anchor, frame.index) for anchor in anchors})

    def _between(self, anchor: Anchor, index: int) -> Homography | None:
        assert anchor.features.xy[0, 0] == anchor.index
        self.asked.append((anchor.index, index))
        if index in self.lost:
            return None
        H = np.eye(3)
        H[0, 2] = 4 * self.step * (index - anchor.index)
        return Homography(H, 50, 50)


def offline(count: int, rule: AnswerRule, broken: frozenset[int] = frozenset()) -> Record:
    slots = make_slots(count)
    record = Record(slots, Scorecard(ClassSet(tuple(f"frame {i}" for i in range(max(count, 2))))), frozenset())
    run = OfflineRun(slots, rule, record, fuse=None, only_truth=False)
    for slot in slots:
        found = loaded(slot, numbered_truth(slot))
        run.push(found if slot.index not in broken else type(found)(slot.index, None, None, found.truth))
    return record


def test_per_frame() -> None:
    """Every frame through the network, nothing remembered about motion."""
    rule = AnswerRule(NumberSegmenter(), None)
    record = offline(3, rule)
    assert not rule.registers
    assert [(str(r.outcome), r.keyframe, r.reason) for r in record.results] == [
        ("segmented", i, EVERY_FRAME) for i in range(3)
    ]


def test_every_third() -> None:
    """A keyframe, two predictions from it, and again."""
    rule = AnswerRule(NumberSegmenter(), Prediction(EveryPolicy(3), CopyKeyframe(), None))
    record = offline(7, rule)
    assert [r.keyframe for r in record.results] == [0, 0, 0, 3, 3, 3, 6]
    assert [r.reason for r in record.results] == [FIRST, "", "", "interval", "", "", "interval"]
    assert record.scorecard is not None
    assert record.scorecard.pixel_accuracy() == {0: 1, 1: 0, 2: 0, 3: 1, 4: 0, 5: 0, 6: 1}


def test_undecodable_frames_are_no_keyframes() -> None:
    """The interval counts log indices: the choice falls on the next frame that there is."""
    rule = AnswerRule(NumberSegmenter(), Prediction(EveryPolicy(3), CopyKeyframe(), None))
    record = offline(7, rule, broken=frozenset({0, 4}))
    assert [r.keyframe for r in record.results] == [None, 1, 1, 1, None, 5, 5]
    assert rule.moved == 0


def test_the_paper_rule_registers_to_the_last_selected_keyframe() -> None:
    """0.06 of a width a frame exceeds 0.15 every third frame; a lost track makes a keyframe at once."""
    register = Slide(0.06, lost=frozenset({4}))
    rule = AnswerRule(NumberSegmenter(), Prediction(PaperPolicy(9.0, 0.15, 10**12), CopyKeyframe(), register))
    record = offline(8, rule)
    assert [(r.index, r.reason) for r in record.results if r.outcome is Outcome.SEGMENTED] == [
        (0, FIRST), (3, "translation"), (4, "no homography"), (7, "translation"),
    ]  # fmt: skip
    assert register.asked == [(None, 0), (0, 1), (0, 2), (0, 3), (3, 4), (4, 5), (4, 6), (4, 7)]


def test_the_time_rule_uses_capture_time() -> None:
    """Strictly more than the longest time: at 10 Hz and 0.3 s every fourth frame."""
    policy = PaperPolicy(9.0, 9.0, 3 * PERIOD_NS)
    record = offline(9, AnswerRule(NumberSegmenter(), Prediction(policy, CopyKeyframe(), Slide(0.0))))
    assert [r.index for r in record.results if r.reason in (FIRST, "time")] == [0, 4, 8]


@pytest.mark.parametrize(
    ("truth", "keyframes", "moved"),
    [
        ({0, 1, 2, 3, 4, 5, 6, 7}, [0, 0, 0, 3, 3, 3, 6, 6], 0),
        ({2, 3, 4, 5, 6, 7}, [None, None, 2, 2, 2, 5, 5, 5], 1),
        ({0, 5, 7}, [0, 0, 0, 0, 0, 5, 5, 5], 1),
        ({1}, [None, 1, 1, 1, 1, 1, 1, 1], 2),
        (set(), [None] * 8, 1),
    ],
)
def test_the_oracle_moves_its_choice(truth: set[int], keyframes: list[int | None], moved: int) -> None:
    """A frame without truth is never its keyframe: the next one with truth is, and that counts once."""
    rule = AnswerRule(Partial(truth.__contains__), Prediction(EveryPolicy(3), CopyKeyframe(), None))
    record = offline(8, rule)
    assert [r.keyframe for r in record.results] == keyframes
    assert rule.moved == moved
    assert [r.index for r in record.results if r.outcome is Outcome.NO_SOURCE] == [
        i for i, key in enumerate(keyframes) if key is None
    ]


def test_a_moved_choice_keeps_its_reason() -> None:
    """Even if the motion that caused it is over by then."""
    register = Slide(0.1)
    rule = AnswerRule(
        Partial({0, 4}.__contains__), Prediction(PaperPolicy(9.0, 0.15, 10**12), CopyKeyframe(), register)
    )
    record = offline(5, rule)
    assert [(r.index, r.reason) for r in record.results if r.outcome is Outcome.SEGMENTED] == [
        (0, FIRST), (4, "translation"),
    ]  # fmt: skip
    assert rule.moved == 1


def test_per_frame_oracle_without_truth() -> None:
    """No truth, no answer: `no_source`, with the reason."""
    record = offline(4, AnswerRule(Partial({1, 2}.__contains__), None))
    assert [(str(r.outcome), r.reason) for r in record.results] == [
        ("no_source", "no truth for the oracle"), ("segmented", EVERY_FRAME), ("segmented", EVERY_FRAME),
        ("no_source", "no truth for the oracle"),
    ]  # fmt: skip


def test_an_older_keyframe_never_replaces_a_newer_one() -> None:
    """The source is the finished keyframe with the newest stamp, in whatever order they finish."""
    rule = AnswerRule(NumberSegmenter(), Prediction(EveryPolicy(1), CopyKeyframe(), None))
    frames = [Frame(i, i, np.zeros((4, 4, 3), np.uint8)) for i in range(3)]
    for i in (1, 0, 2):
        rule.finish(frames[i], Segmentation(np.full((4, 4), i, np.uint8)))
        assert rule.source is not None
        assert rule.source.index == max(i, 1)


def test_nothing_to_predict_from() -> None:
    """Before the first finished keyframe, and in a mode that never predicts."""
    frame = Frame(0, 0, np.zeros((4, 4, 3), np.uint8))
    assert (
        AnswerRule(NumberSegmenter(), Prediction(EveryPolicy(1), CopyKeyframe(), None)).propagate(frame, None) is None
    )
    rule = AnswerRule(NumberSegmenter(), None)
    rule.finish(frame, Segmentation(np.zeros((4, 4), np.uint8)))
    assert rule.propagate(frame, None) is None


def test_only_truth() -> None:
    """The offline pass of `per-frame` leaves out what nobody can judge; the frames it computes are the same."""
    slots = schedule(make_plans(6, truth=lambda i: i % 2 == 0), Fraction(1), frozenset(), frozenset())
    record = Record(slots, None, frozenset())
    run = OfflineRun(slots, AnswerRule(NumberSegmenter(), None), record, fuse=None, only_truth=True)
    for slot in slots:
        run.push(loaded(slot))
    assert [r.index for r in record.results] == [0, 2, 4]
