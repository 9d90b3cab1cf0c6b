"""Durations, latency, throughput and outcomes, with schedules worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.metrics.durations import MIN_SAMPLES, Durations, percentile_ns, summarise
from stsem.metrics.latency import latency
from stsem.metrics.outcomes import OutcomeCounter, count_outcomes
from stsem.metrics.throughput import ThroughputMeter, jitter_ms, rate_hz, throughput
from stsem.result import FrameResult, Outcome, Span

MS = 1_000_000


@given(st.lists(st.integers(0, 10**12), min_size=1, max_size=300), st.sampled_from(sorted(MIN_SAMPLES)))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_percentiles_are_order_statistics(durations: list[int], per_mille: int) -> None:
    """The p point is a sample, at least p of the samples are at or below it, and fewer than p are below it."""
    ascending = sorted(durations)
    point = percentile_ns(ascending, per_mille)
    assert point in durations
    assert 1000 * sum(d <= point for d in durations) >= per_mille * len(durations)
    assert 1000 * sum(d < point for d in durations) < per_mille * len(durations)
    theirs = np.quantile(np.array(ascending), per_mille / 1000, method="inverted_cdf")
    assert point == theirs


def test_percentiles_by_hand() -> None:
    """Of 1..1000 the p point is 1000 p; of 1..140 the 95 % point is the 133rd."""
    ascending = list(range(1, 1001))
    assert [percentile_ns(ascending, p) for p in (1, 500, 999, 1000)] == [1, 500, 999, 1000]
    assert percentile_ns(list(range(1, 141)), 950) == 133
    with pytest.raises(ValueError, match="of 0 durations"):
        percentile_ns([], 500)


@pytest.mark.parametrize(("per_mille", "least"), MIN_SAMPLES.items())
def test_a_percentile_needs_its_samples(per_mille: int, least: int) -> None:
    """One sample fewer, and it is not stated; distinct samples of the cost profile count, not replays of them."""
    name = {500: "p50", 900: "p90", 950: "p95", 990: "p99", 999: "p999"}[per_mille]
    enough, short = summarise(range(least)), summarise(range(least - 1))
    assert getattr(enough, name) == percentile_ns(list(range(least)), per_mille) / 1e6
    assert getattr(short, name) is None
    replayed = summarise(range(10_000), distinct_samples=least - 1)
    assert replayed is not None
    assert getattr(replayed, name) is None
    assert (replayed.n, replayed.n_effective) == (10_000, least - 1)
    assert getattr(summarise(range(10_000), distinct_samples=least), name) is not None


@pytest.mark.parametrize(("per_mille", "least"), MIN_SAMPLES.items())
def test_minimum_samples_are_those_of_loadgen(per_mille: int, least: int) -> None:
    """MLPerf LoadGen's early stopping at 99 % confidence with one sample beyond the percentile allowed.

    The least n for which at most one of n samples beyond the p point has a chance of at most 1 %.
    """

    def chance(n: int) -> float:
        p = per_mille / 1000
        return math.exp(n * math.log(p)) + n * (1 - p) * math.exp((n - 1) * math.log(p))

    assert chance(least) <= 0.01 < chance(least - 1)


def test_maximum_and_mean_are_always_stated() -> None:
    """One duration has a maximum and a mean; none has no summary."""
    meter = Durations()
    assert meter.compute() is None
    meter.update(3 * MS)
    meter.update(4 * MS)
    found = meter.compute()
    assert found is not None
    assert (found.max, found.mean, found.n, found.p50) == (4.0, 3.5, 2, None)


def answered(index: int, stamp: int, arrival: int, taken: int, done: int) -> FrameResult:
    return FrameResult(index, stamp * MS, arrival * MS, taken * MS, done * MS, Outcome.SEGMENTED, index)


def span(frame: int, stage: str, cores: tuple[int, ...], ready: int, start: int, end: int) -> Span:
    return Span(frame, stage, cores, ready * MS, start * MS, end * MS)


RESULTS = [
    answered(0, 0, 10, 10, 70),
    FrameResult(1, 50 * MS, 60 * MS, None, None, Outcome.DROPPED_BUSY),
    answered(2, 100, 110, 110, 190),
    FrameResult(3, 150 * MS, None, None, None, Outcome.INCOMPLETE),
    FrameResult(4, 200 * MS, 210 * MS, 210 * MS, None, Outcome.PENDING),
]
SPANS = [
    span(0, "register", (0,), 10, 10, 20),
    span(0, "segment", (0, 1), 20, 20, 70),
    span(0, "fuse", (0,), 70, 70, 90),
    span(2, "register", (0,), 110, 115, 125),
    span(2, "segment", (0, 1), 125, 140, 190),
    span(4, "register", (1,), 210, 210, 220),
]


def test_latency_splits_into_waiting_and_service() -> None:
    """Hand-worked: frame 0 waits 0 of 60 ms, frame 2 waits 20 of 80 ms; fuse is beside the path."""
    found = latency(RESULTS, SPANS)
    assert found.from_arrival is not None
    assert found.from_stamp is not None
    assert found.waiting is not None
    assert (found.from_arrival.n, found.from_arrival.mean, found.from_arrival.max) == (2, 70.0, 80.0)
    assert (found.from_stamp.mean, found.from_stamp.max) == (80.0, 90.0)
    assert (found.waiting.mean, found.waiting.max) == (10.0, 20.0)
    assert list(found.stages) == ["fuse", "register", "segment"]
    assert (found.stages["segment"].service.max, found.stages["segment"].waiting.max) == (50.0, 15.0)
    assert found.stages["register"].service.n == 3
    assert found.inside == ("register", "segment")


def test_a_background_keyframe_is_not_inside_its_own_answer() -> None:
    """In keyframe-async the network finishes after the answer: it is beside the latency, not inside."""
    result = FrameResult(0, 0, 0, 0, 30 * MS, Outcome.PROPAGATED, 0)
    spans = [span(0, "propagate", (0,), 0, 10, 30), span(0, "segment", (1,), 0, 0, 300)]
    found = latency([result], spans)
    assert found.inside == ("propagate",)
    assert found.waiting is not None
    assert found.waiting.max == 10.0
    side_by_side = latency([result], [*spans, span(0, "register", (1,), 0, 0, 20)])
    assert side_by_side.waiting is not None
    assert side_by_side.waiting.max == 0.0


def test_nothing_answered_has_no_latency() -> None:
    """An offline run, or one without any answer, has no latency and no rate."""
    offline = [FrameResult(0, 0, None, None, None, Outcome.SEGMENTED, 0)]
    found, rates = latency(offline, []), throughput(offline, [])
    assert (found.from_arrival, found.waiting, found.stages, found.inside) == (None, None, {}, ())
    assert (rates.output_hz, rates.offered_hz, rates.real_time_factor, rates.jitter_ms) == (None, None, None, None)
    assert rates.utilisation == ()
    assert throughput([], []).processed_share is None


def test_throughput_worked_by_hand() -> None:
    """Two answers 120 ms apart, three arrivals over 200 ms, five frames."""
    found = throughput(RESULTS, SPANS, deadline_ns=60 * MS)
    assert found.output_hz == pytest.approx(1 / 0.12, rel=1e-15)
    assert found.offered_hz == pytest.approx(3 / 0.2, rel=1e-15)
    assert (found.outputs, found.processed_share) == (2, 2 / 5)
    assert found.real_time_factor == pytest.approx(100 / 120, rel=1e-15)
    assert found.deadline_misses == 4  # frame 0 is just in time, frame 2 late, the others unanswered
    # From the first arrival, 10 ms, to the end of the last job, 220 ms.
    assert found.utilisation == pytest.approx((140 / 210, 110 / 210), rel=1e-15)
    assert throughput(RESULTS, SPANS).deadline_misses is None
    assert throughput(RESULTS, SPANS, rate=2.0).real_time_factor == pytest.approx(200 / 120, rel=1e-15)


def test_a_lossless_10_hz_run_has_10_hz() -> None:
    """N instants bound N - 1 intervals: not N / duration, which would say 10.2 Hz."""
    assert rate_hz([i * 100 * MS for i in range(50)]) == 10.0
    assert rate_hz([5]) is None
    assert rate_hz([5, 5]) is None


def test_jitter_is_the_spread_of_the_intervals() -> None:
    """Even outputs have none; intervals of 1 and 3 ms have a population deviation of 1 ms."""
    assert jitter_ms([0, 7 * MS, 14 * MS, 21 * MS]) == 0.0
    assert jitter_ms([0, 1 * MS, 4 * MS]) == 1.0
    assert jitter_ms([0, 1 * MS]) is None


def test_order_of_results_does_not_matter() -> None:
    """The meter gives the same numbers for frames in any order."""
    forth, back = ThroughputMeter(deadline_ns=60 * MS), ThroughputMeter(deadline_ns=60 * MS)
    for result in RESULTS:
        forth.update(result)
    for result in reversed(RESULTS):
        back.update(result)
    assert forth.compute(SPANS) == back.compute(SPANS[::-1])
    assert latency(RESULTS, SPANS) == latency(RESULTS[::-1], SPANS[::-1])


def test_outcomes_are_conserved() -> None:
    """Every outcome is a key; a lost frame, a doubled one and a second end are refused with the difference."""
    found = count_outcomes([r.outcome for r in RESULTS], 5)
    assert list(found) == list(Outcome)
    assert found[Outcome.SEGMENTED] == 2
    assert found[Outcome.PROPAGATED] == 0
    with pytest.raises(ValueError, match=r"6 frames, but 5 outcomes .*2 segmented.*: 1 without an outcome"):
        count_outcomes([r.outcome for r in RESULTS], 6)
    with pytest.raises(ValueError, match="1 counted twice"):
        count_outcomes([r.outcome for r in RESULTS], 4)
    meter = OutcomeCounter(2)
    meter.update(0, Outcome.SEGMENTED)
    with pytest.raises(ValueError, match="frame 0 ended as segmented and again as pending"):
        meter.update(0, Outcome.PENDING)
    with pytest.raises(ValueError, match="1 without an outcome"):
        meter.compute()
