"""The worked example of docs/metrics.md: five frames, a network that takes two and a half frame periods."""

import math
from pathlib import Path

import numpy as np
import pytest

from stsem.classes import ClassSet, Labels
from stsem.metrics.confusion import confusion
from stsem.metrics.loss import LossSplit, Part, split
from stsem.metrics.scorecard import Scorecard
from stsem.metrics.scores import scores_of_tally
from stsem.metrics.streaming import Answer, Instant, newest_finished, streaming
from stsem.result import Outcome

PERIOD_NS = 100_000_000


def corridor(index: int) -> Labels:
    """One row of ten pixels: wall, and a door that moves one pixel a frame."""
    labels = np.zeros((1, 10), np.uint8)
    labels[0, index : index + 4] = 1
    return labels


def seen(index: int) -> Labels:
    """What the network says: one pixel of the door is taken for wall."""
    labels = corridor(index)
    labels[0, index] = 0
    return labels


ANSWERS = [Answer(0, 250_000_000, seen(0)), Answer(2 * PERIOD_NS, 500_000_000, seen(2))]
"""Frame 0 is taken at 0 and ready at 250 ms; frame 2 waited in the mailbox since 200 ms and is ready at 500 ms."""

OUTCOMES = [Outcome.SEGMENTED, Outcome.DROPPED_BUSY, Outcome.SEGMENTED, Outcome.DROPPED_BUSY, Outcome.PENDING]
"""Frames 1 and 3 were replaced in the mailbox; frame 4 is taken at 500 ms, the end of the run, and stays unfinished."""


def offline() -> Scorecard:
    card = Scorecard(ClassSet(("wall", "door")))
    for i in range(5):
        card.judge(i, i * PERIOD_NS, corridor(i), seen(i), outcome=Outcome.SEGMENTED, distance=0, distance_ns=0)
    return card


def real_time() -> Scorecard:
    card = Scorecard(ClassSet(("wall", "door")))
    for i in range(5):
        said = newest_finished(ANSWERS, i * PERIOD_NS)
        age = None if said is None else i * PERIOD_NS - said.stamp_ns
        card.judge_streaming(i, corridor(i), None if said is None else said.labels, age_ns=age)
        answered = OUTCOMES[i] is Outcome.SEGMENTED
        card.judge(
            i, i * PERIOD_NS, corridor(i), seen(i) if answered else None,
            outcome=OUTCOMES[i],
            distance=0 if answered else None, distance_ns=0 if answered else None,
        )  # fmt: skip
    return card


def test_the_three_scores_of_the_worked_example() -> None:
    """Offline, delivered and streaming by hand; docs/metrics.md prints them."""
    papers, run = offline().compute(), real_time().compute()
    assert papers.own is not None
    assert run.own is not None
    assert run.streaming is not None
    assert run.age is not None
    # Offline, each of 5 frames: wall TP 6 FP 1, door TP 3 FN 1.
    assert papers.own.scores.miou == pytest.approx((6 / 7 + 3 / 4) / 2, abs=1e-15)
    assert papers.own.scores.pixel_accuracy == 0.9
    # Delivered: frames 0 and 2 as above.
    assert run.own.scores.miou == pytest.approx((6 / 7 + 3 / 4) / 2, abs=1e-15)
    assert run.own.scores.pixel_accuracy == 0.9
    assert (run.own.frames, run.own.misses) == (2, 0)
    # For pairing, frames 1, 3 and 4 stay in without any label.
    assert scores_of_tally(real_time().samples().tallies.sum(axis=0)).miou == (12 / 32 + 6 / 20) / 2
    # Streaming: frames 0, 1, 2 miss; frames 3 and 4 see the answer to frame 0.
    assert (run.streaming.frames, run.streaming.misses) == (5, 3)
    matrix = confusion(corridor(3), seen(0), 2) + confusion(corridor(4), seen(0), 2)
    assert matrix.tolist() == [[7, 5, 0], [7, 1, 0]]
    assert run.streaming.scores.miou == pytest.approx((7 / 37 + 1 / 25) / 2, abs=1e-15)
    assert run.age.mean == 350.0


def test_the_documentation_prints_these_numbers() -> None:
    """Every figure of the worked example in docs/metrics.md is what the code says."""
    text = (Path(__file__).parents[2] / "docs" / "metrics.md").read_text(encoding="utf-8")
    papers, run = offline().compute().own, real_time().compute()
    for name, judged in (("offline", papers), ("delivered", run.own), ("streaming", run.streaming)):
        assert judged is not None
        wall, door = judged.scores.iou
        cells = (f"{100 * x:.1f}" for x in (wall, door, judged.scores.miou, judged.scores.pixel_accuracy))
        assert f"| {name} | {' | '.join(cells)} | {judged.misses} of {judged.frames} |" in text
    parts = split(papers, papers, run.own, run.streaming)
    for name in ("network", "prediction", "scheduling", "staleness"):
        assert f"| {name} | {100 * getattr(parts, name).value:.1f} |" in text


def test_the_loss_adds_up_exactly() -> None:
    """1 = network + prediction + scheduling + staleness + streaming, for both scores."""
    papers, run = offline().compute().own, real_time().compute()
    for metric in ("miou", "pixel_accuracy"):
        found = split(papers, papers, run.own, run.streaming, metric)  # type: ignore[arg-type]
        parts = (found.network, found.prediction, found.scheduling, found.staleness)
        assert run.streaming is not None
        assert [part.n for part in parts if part is not None] == [5, 5, 2, 2]
        total = math.fsum(part.value for part in parts if part is not None)
        assert total + getattr(run.streaming.scores, metric) == pytest.approx(1, abs=1e-15)
    assert found.prediction == Part(0.0, 5)


def test_a_part_that_did_not_run_is_not_measured() -> None:
    """Without an offline pass there is no network, prediction or scheduling part; never a 0."""
    run = real_time().compute()
    found = split(None, None, run.own, run.streaming)
    assert (found.network, found.prediction, found.scheduling) == (None, None, None)
    assert found.staleness is not None
    meter = LossSplit()
    meter.update("delivered", run.own)
    meter.update("streaming", run.streaming)
    assert meter.compute() == found
    with pytest.raises(ValueError, match="no pass is called 'replay'"):
        meter.update("replay", run.own)


def test_the_newest_stamp_counts_not_the_newest_finish() -> None:
    """Two answers finished out of order: the one about the newer frame is used; finishing at the instant is in time."""
    old, new = Answer(0, 30, corridor(0)), Answer(10, 20, corridor(1))
    assert newest_finished([old, new], 19) is None
    assert newest_finished([old, new], 20) is new
    assert newest_finished([old, new], 30) is new


def test_the_scorecard_agrees_with_the_definition() -> None:
    """The accumulated streaming score is that of the pure function over the whole run."""
    instants = [Instant(i, i * PERIOD_NS, corridor(i)) for i in range(5)]
    wanted, found = streaming(instants, ANSWERS, 2), real_time().compute().streaming
    assert wanted is not None
    assert found is not None
    np.testing.assert_array_equal(found.matrix, wanted.matrix)
    assert (found.frames, found.misses) == (wanted.frames, wanted.misses)
    assert streaming([], ANSWERS, 2) is None
