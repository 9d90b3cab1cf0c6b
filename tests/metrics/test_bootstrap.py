import numpy as np
import numpy.typing as npt
import pytest
from scipy.signal import lfilter
from scipy.stats import bootstrap

from stsem.metrics.accumulate import Samples
from stsem.metrics.blocks import Blocks, NoInterval, autocorrelation_time, cut
from stsem.metrics.bootstrap import Interval, interval, over_logs, paired_difference, shared_blocks
from stsem.metrics.scores import scores_of_tally

PIXELS = 100_000
PERIOD_NS = 100_000_000


def ar1(n: int, phi: float, rng: np.random.Generator) -> npt.NDArray[np.float64]:
    """A stationary series of unit variance with autocorrelation phi^k; tau = (1 + phi) / (1 - phi)."""
    noise = rng.standard_normal(n + 200) * np.sqrt(1 - phi**2)
    return np.asarray(lfilter([1], [1, -phi], noise)[200:])


def one_class(accuracy: npt.NDArray[np.float64]) -> Samples:
    """Frames of PIXELS pixels of a single class with the given accuracies."""
    n, right = len(accuracy), np.round(np.clip(accuracy, 0, 1) * PIXELS).astype(np.int64)
    tallies = np.full((n, 3, 1), PIXELS, np.int64)
    tallies[:, 0, 0] = tallies[:, 2, 0] = right
    return Samples(np.arange(n), np.arange(n) * PERIOD_NS, tallies)


def two_runs(n: int, phi: float, rng: np.random.Generator) -> tuple[Samples, Samples]:
    """Two runs over the same frames, the second 0.03 worse, with common and own fluctuations."""
    common = 0.8 + 0.05 * ar1(n, phi, rng)
    return one_class(common + 0.02 * ar1(n, phi, rng)), one_class(common - 0.03 + 0.02 * ar1(n, phi, rng))


def several_classes(n: int, seed: int) -> Samples:
    """Frames of six classes, some of which are rarely there."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, 2000, (n, 6)) * (rng.random((n, 6)) < [1, 1, 0.8, 0.8, 0.4, 0.2])
    right = (truth * rng.uniform(0.5, 1, (n, 6))).astype(np.int64)
    predicted = right + np.roll(truth - right, 1, axis=1)
    return Samples(np.arange(n), np.arange(n) * PERIOD_NS, np.stack([right, truth, predicted], axis=1))


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.8])
def test_autocorrelation_time_of_a_known_process(phi: float) -> None:
    """For an AR(1) series tau is (1 + phi) / (1 - phi); the estimate errs on the long side."""
    tau = [autocorrelation_time(ar1(2000, phi, np.random.default_rng(seed))) for seed in range(20)]
    true = (1 + phi) / (1 - phi)
    assert 0.95 * true <= np.mean(tau) <= 1.3 * true + 2


def test_autocorrelation_time_of_series_without_one() -> None:
    """Constant, empty, unjudged, alternating and white series have tau near 1: a frame stands for itself."""
    for series in (np.ones(50), np.zeros(0), np.full(9, np.nan)):
        assert autocorrelation_time(series) == 1.0
    assert 1 <= autocorrelation_time(np.tile([0.0, 1.0], 30)) < 1.2
    assert 1 <= np.mean([autocorrelation_time(np.random.default_rng(i).random(500)) for i in range(20)]) < 1.5


def test_blocks_are_stretches_of_time() -> None:
    """A gap of the log is not bridged: blocks are cut by the clock, and empty stretches are no blocks."""
    stamps = np.concatenate([np.arange(60), np.arange(120, 180)]) * PERIOD_NS
    blocks = cut(stamps, [np.random.default_rng(0).random(120)])
    assert isinstance(blocks, Blocks)
    assert blocks.length_ns >= 3 * blocks.autocorrelation_ns
    first = [int(stamps[blocks.of_frame == b].min()) for b in range(blocks.count)]
    last = [int(stamps[blocks.of_frame == b].max()) for b in range(blocks.count)]
    assert max(b - a for a, b in zip(first, last, strict=True)) <= blocks.length_ns
    assert sorted(set(blocks.of_frame.tolist())) == list(range(blocks.count))


def test_no_interval_where_the_log_is_too_short() -> None:
    """A slow series leaves fewer than 8 blocks: there is a reason instead of an interval."""
    slow = one_class(np.linspace(0.5, 0.9, 200))
    found = interval(slow, "pixel_accuracy", seed=0)
    assert isinstance(found, NoInterval)
    assert "8 are needed" in found.reason
    few = interval(one_class(np.full(5, 0.5)), "miou", seed=0)
    assert few == NoInterval("5 judged frames cannot make 8 blocks")
    blind = Samples(np.arange(9), np.arange(9), np.zeros((9, 3, 2), np.int64))
    assert interval(blind, "miou", seed=0) == NoInterval("no pixel with truth was judged")


@pytest.mark.parametrize("metric", ["miou", "pixel_accuracy"])
def test_the_value_is_that_of_the_full_sample(metric: str) -> None:
    """Intervals are about the reported number itself, and contain it."""
    samples = several_classes(300, 1)
    found = interval(samples, metric, seed=0)  # type: ignore[arg-type]
    wanted = scores_of_tally(samples.tallies.sum(axis=0))
    assert isinstance(found, Interval)
    assert found.value == pytest.approx(getattr(wanted, metric), abs=1e-12)
    assert 0 <= found.low < found.value < found.high <= 1
    assert found.n == 300


@pytest.mark.parametrize(("n", "phi"), [(150, 0.0), (300, 0.5), (1000, 0.8)])
def test_a_95_per_cent_interval_covers_in_about_95_per_cent(n: int, phi: float) -> None:
    """Simulated coverage, single scores and paired differences, of independent and of correlated frames."""
    rng = np.random.default_rng(7)
    hits: dict[str, list[bool]] = {"single": [], "difference": []}
    for seed in range(120):
        base, other = two_runs(n, phi, rng)
        for name, found, true in (
            ("single", interval(base, "pixel_accuracy", seed=seed), 0.8),
            ("difference", paired_difference(base, other, "pixel_accuracy", seed=seed), -0.03),
        ):
            if isinstance(found, Interval):
                hits[name].append(found.low <= true <= found.high)
    for covered in hits.values():
        assert len(covered) > 90
        assert 0.88 <= np.mean(covered) <= 0.99


def test_the_saw_tooth_of_keyframes_does_not_hide_slow_changes() -> None:
    """Accuracy falls by 0.05 a frame until the next keyframe, over a slowly changing scene: coverage stays near 95 %.

    With the plain estimate of the autocorrelation time (1 here, 19 under the saw-tooth) it was 73 %.
    """
    rng, hits = np.random.default_rng(8), []
    for seed in range(120):
        found = interval(one_class(0.8 - 0.05 * (np.arange(1000) % 5) + 0.03 * ar1(1000, 0.9, rng)), "miou", seed=seed)
        if isinstance(found, Interval):
            hits.append(found.low <= 0.7 <= found.high)
    assert len(hits) > 80
    assert np.mean(hits) >= 0.86


def test_pairing_is_what_makes_differences_sharp() -> None:
    """The common fluctuation of two modes drops out of their difference."""
    base, other = two_runs(600, 0.5, np.random.default_rng(3))
    alone, paired = interval(base, "miou", seed=0), paired_difference(base, other, "miou", seed=0)
    assert isinstance(alone, Interval)
    assert isinstance(paired, Interval)
    assert paired.standard_error < 0.7 * alone.standard_error
    assert paired.high < 0


def test_agrees_with_scipy_on_a_plain_mean() -> None:
    """Equal frames without autocorrelation: the score is a mean, and scipy's BCa interval says nearly the same."""
    samples = one_class(np.random.default_rng(5).beta(8, 2, 300))
    ours = interval(samples, "pixel_accuracy", seed=1)
    blocks = shared_blocks([samples], "pixel_accuracy")
    assert isinstance(ours, Interval)
    assert isinstance(blocks, Blocks)
    means = blocks.sums(samples.pixel_accuracy) / np.bincount(blocks.of_frame)
    theirs = bootstrap((means,), np.mean, n_resamples=4000, rng=np.random.default_rng(0))
    width = theirs.confidence_interval.high - theirs.confidence_interval.low
    assert ours.standard_error == pytest.approx(float(theirs.standard_error), rel=0.06)
    assert ours.low == pytest.approx(float(theirs.confidence_interval.low), abs=0.1 * width)
    assert ours.high == pytest.approx(float(theirs.confidence_interval.high), abs=0.1 * width)


def test_the_same_seed_gives_the_same_interval_and_another_one_nearly() -> None:
    """Deterministic by seed; the draws of two seeds differ by less than the interval's width."""
    samples = several_classes(300, 2)
    first, again, other = (interval(samples, "miou", seed=seed) for seed in (4, 4, 5))
    assert isinstance(first, Interval)
    assert isinstance(other, Interval)
    assert first == again
    assert first != other
    assert abs(first.low - other.low) < 0.2 * (first.high - first.low)


def test_no_difference_and_no_spread_are_points() -> None:
    """Equal runs differ by exactly 0 with a point interval; a perfect run has the point 1."""
    samples = several_classes(200, 3)
    same = paired_difference(samples, samples, "miou", seed=0)
    assert isinstance(same, Interval)
    assert (same.low, same.value, same.high) == (0, 0, 0)
    perfect = interval(one_class(np.ones(100)), "miou", seed=0)
    assert isinstance(perfect, Interval)
    assert (perfect.low, perfect.high) == (1, 1)


def test_a_difference_in_a_single_block_makes_no_interval() -> None:
    """Where only one stretch differs, most resamples know nothing about it."""
    base = several_classes(120, 4)
    tallies = base.tallies.copy()
    tallies[50, 0] //= 2
    found = paired_difference(base, Samples(base.index, base.stamp_ns, tallies), "pixel_accuracy", seed=0)
    assert isinstance(found, NoInterval)
    assert "differ from each other" in found.reason


def test_a_dropped_frame_stays_in_as_unlabelled() -> None:
    """Frames must be the same on both sides; one that was dropped counts as all "no label"."""
    base = several_classes(200, 5)
    dropped = base.tallies.copy()
    dropped[::7, 0] = dropped[::7, 2] = 0
    found = paired_difference(base, Samples(base.index, base.stamp_ns, dropped), "pixel_accuracy", seed=0)
    assert isinstance(found, Interval)
    assert found.high < 0
    missing = Samples(base.index[1:], base.stamp_ns[1:], base.tallies[1:])
    with pytest.raises(ValueError, match="same frames"):
        paired_difference(base, missing, "miou", seed=0)


def test_over_logs_resamples_whole_logs() -> None:
    """Ten logs or more: pooled value, units are logs; fewer: a reason."""
    logs = [several_classes(40, seed) for seed in range(12)]
    worse = [
        Samples(s.index, s.stamp_ns, np.concatenate([s.tallies[:, :1] * 9 // 10, s.tallies[:, 1:]], 1)) for s in logs
    ]
    found = over_logs(logs, worse, "miou", seed=0)
    pooled = [scores_of_tally(np.sum([s.tallies.sum(axis=0) for s in run], axis=0)).miou for run in (logs, worse)]
    assert isinstance(found, Interval)
    assert found.value == pytest.approx(pooled[1] - pooled[0], abs=1e-12)
    assert (found.units, found.n) == (12, 480)
    assert found.high < 0
    assert isinstance(over_logs(logs[:9], None, "miou", seed=0), NoInterval)
    assert isinstance(over_logs(logs, None, "pixel_accuracy", seed=0), Interval)
    with pytest.raises(ValueError, match="cannot be paired"):
        over_logs(logs, worse[:11], "miou", seed=0)
