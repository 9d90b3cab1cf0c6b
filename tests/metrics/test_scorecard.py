import numpy as np
import pytest

from stsem.classes import ClassSet, Labels
from stsem.metrics.by_distance import by_distance, summarise
from stsem.metrics.confusion import confusion
from stsem.metrics.scorecard import Scorecard
from stsem.metrics.scores import scores, tally
from stsem.result import Outcome

CLASSES = ClassSet(("wall", "floor", "door"))


def scene(seed: int) -> tuple[Labels, Labels]:
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 3, (6, 8)).astype(np.uint8)
    answer = np.where(rng.random(truth.shape) < 0.7, truth, rng.integers(0, 3, truth.shape)).astype(np.uint8)
    return truth, answer


def judged(card: Scorecard, index: int, outcome: Outcome, distance: int | None) -> tuple[Labels, Labels | None]:
    truth, answer = scene(index)
    said = answer if outcome.is_answer else None
    gap = None if distance is None else distance * 100
    card.judge(index, index * 100, truth, said, outcome=outcome, distance=distance, distance_ns=gap)
    return truth, said


def test_totals_and_strata_are_sums_over_frames() -> None:
    """Answers count in the total and in their stratum, `no_source` as unlabelled; a drop only in the paired samples."""
    card = Scorecard(CLASSES)
    kinds = [Outcome.SEGMENTED, Outcome.PROPAGATED, Outcome.DROPPED_BUSY, Outcome.PROPAGATED, Outcome.NO_SOURCE]
    steps = [0, 1, None, 3, None]
    pairs = [judged(card, i, kind, step) for i, (kind, step) in enumerate(zip(kinds, steps, strict=True))]
    found = card.compute()
    matrices = [confusion(t, a, 3) for t, a in pairs]
    scored = matrices[0] + matrices[1] + matrices[3] + matrices[4]
    assert found.own is not None
    assert found.measured
    np.testing.assert_array_equal(found.own.matrix, scored)
    assert found.own.scores.miou == scores(scored).miou
    assert (found.own.frames, found.own.misses) == (4, 1)
    assert found.own.class_pixels.tolist() == scored.sum(axis=1).tolist()
    assert found.own.unlabelled_share == 1 / 4
    assert set(found.strata) == {"segmented", "propagated"}
    np.testing.assert_array_equal(found.strata["propagated"].matrix, matrices[1] + matrices[3])
    assert [(r.frames, r.n) for r in found.by_distance] == [(0, 1), (1, 1), (3, 1)]
    assert (found.streaming, found.age) == (None, None)
    assert sorted(card.pixel_accuracy()) == [0, 1, 3, 4]
    assert card.pixel_accuracy()[4] == 0
    np.testing.assert_array_equal(card.samples().tallies, [tally(matrix) for matrix in matrices])


@pytest.mark.parametrize("outcome", [o for o in Outcome if not o.is_answer and o is not Outcome.NO_SOURCE])
def test_a_frame_that_is_no_answer_is_judged_streaming_only(outcome: Outcome) -> None:
    """Nothing delivered is not measured, never 0; the streaming score is there all the same."""
    card = Scorecard(CLASSES)
    truth, _ = scene(0)
    card.judge(0, 0, truth, None, outcome=outcome, distance=None, distance_ns=None)
    assert "was answered" in card.compute().reason
    card.judge_streaming(0, truth, None, age_ns=None)
    found = card.compute()
    assert found.measured
    assert found.own is None
    assert found.streaming is not None
    assert (found.streaming.scores.miou, found.streaming.misses) == (0, 1)


def test_streaming_is_kept_apart_from_delivered() -> None:
    """A late answer is perfect for its own frame and wrong for the frame it was used for."""
    card = Scorecard(CLASSES)
    first, second = np.zeros((2, 2), np.uint8), np.ones((2, 2), np.uint8)
    card.judge(0, 0, first, first, outcome=Outcome.SEGMENTED, distance=0, distance_ns=0)
    card.judge(1, 100, second, second, outcome=Outcome.SEGMENTED, distance=0, distance_ns=0)
    card.judge_streaming(0, first, None, age_ns=None)
    card.judge_streaming(1, second, first, age_ns=3_000_000)
    found = card.compute()
    assert found.own is not None
    assert found.streaming is not None
    assert found.age is not None
    assert (found.own.scores.pixel_accuracy, found.streaming.scores.pixel_accuracy) == (1, 0)
    assert (found.own.misses, found.streaming.misses, found.age.n, found.age.max) == (0, 1, 1, 3.0)
    assert card.streaming_pixel_accuracy() == {0: 0, 1: 0}
    assert card.streaming_samples().stamp_ns.tolist() == [0, 100]


def test_order_of_judging_does_not_matter() -> None:
    """Samples come by log index however the frames were judged."""
    forth, back = Scorecard(CLASSES), Scorecard(CLASSES)
    for i in range(5):
        judged(forth, i, Outcome.SEGMENTED, 0)
        judged(back, 4 - i, Outcome.SEGMENTED, 0)
    for name in ("index", "stamp_ns", "tallies", "pixel_accuracy"):
        np.testing.assert_array_equal(getattr(forth.samples(), name), getattr(back.samples(), name))
    np.testing.assert_array_equal(forth.samples().tallies[2], tally(confusion(*scene(2), 3)))


def test_unknown_classes_count_as_wrong_and_are_named() -> None:
    """The network knows wall and floor only: the door's pixels are wrong, and the common mIoU leaves the door out."""
    card = Scorecard(CLASSES, np.array([True, True, False]))
    truth = np.array([[0, 0, 1, 1, 2, 2]], np.uint8)
    answer = np.array([[0, 0, 1, 1, 1, 255]], np.uint8)
    card.judge(0, 0, truth, answer, outcome=Outcome.SEGMENTED, distance=0, distance_ns=0)
    found = card.compute()
    assert found.unknown == ("door",)
    assert found.own is not None
    assert found.own.scores.miou == pytest.approx((1 + 2 / 3 + 0) / 3, abs=1e-15)
    assert found.own.miou_common == pytest.approx((1 + 2 / 3) / 2, abs=1e-15)
    assert found.own.classes_common == 2


@pytest.mark.parametrize(
    ("known", "truth", "said"),
    [
        ([False, False, False], 1, "no class in common"),
        ([True, True, False], 2, "no class in common"),
        ([True, True, True], 255, "labels no pixel"),
    ],
)
def test_nothing_to_measure_is_not_zero(known: list[bool], truth: int, said: str) -> None:
    """Without a common class, or without labelled truth, there is a reason and no score."""
    card = Scorecard(CLASSES, np.array(known))
    labels = np.full((2, 2), truth, np.uint8)
    card.judge(0, 0, labels, np.zeros((2, 2), np.uint8), outcome=Outcome.SEGMENTED, distance=0, distance_ns=0)
    found = card.compute()
    assert said in found.reason
    assert not found.measured
    assert found.own is None
    assert "no frame with truth was answered" in Scorecard(CLASSES).compute().reason


def test_a_frame_is_judged_once() -> None:
    """Judging twice, or only streaming, is a mistake of the caller that is named."""
    card = Scorecard(CLASSES)
    judged(card, 3, Outcome.SEGMENTED, 0)
    with pytest.raises(ValueError, match="frame 3 was judged twice"):
        judged(card, 3, Outcome.SEGMENTED, 0)
    card.judge_streaming(4, scene(4)[0], None, age_ns=None)
    with pytest.raises(ValueError, match="frame 4 was judged streaming only"):
        card.streaming_samples()
    with pytest.raises(ValueError, match="does not fit 3 classes"):
        Scorecard(CLASSES, np.array([True]))


def test_by_distance_worked_by_hand() -> None:
    """Rows per distance; mean and minimum only over distances with enough frames; milliseconds are means."""
    right, half = np.array([[[4], [4], [4]]]), np.array([[[2], [4], [2]]])
    tallies = np.concatenate([right] * 2 + [half] * 2 + [right])
    rows = by_distance([0, 0, 1, 1, 2], [0, 0, 10_000_000, 30_000_000, 50_000_000], tallies)
    assert [(r.frames, r.ms, r.miou, r.pixel_accuracy, r.n) for r in rows] == [
        (0, 0.0, 1.0, 1.0, 2),
        (1, 20.0, 0.5, 0.5, 2),
        (2, 50.0, 1.0, 1.0, 1),
    ]
    found = summarise(rows, min_frames=2)
    assert found is not None
    assert (found.miou_mean, found.miou_min, found.distances) == (0.75, 0.5, 2)
    assert summarise(rows, min_frames=10) is None
