"""Calibration and detection of errors: against formulas, against sorting, and as sums of parts."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from stsem.classes import NO_LABEL
from stsem.metrics.calibration import Calibration, CalibrationMeter
from stsem.metrics.reliability import BINS, IGNORED, area_under_roc, error_counts, reliability, rightness
from stsem.result import Outcome
from stsem.uncertainty import CONFIDENCE_STEPS, DOUBT, Uncertainty

SEGMENTED, PROPAGATED = Outcome.SEGMENTED, Outcome.PROPAGATED
Bytes = npt.NDArray[np.uint8]
LEVELS = arrays(np.uint8, st.integers(2, 60), elements=st.integers(0, 255))


def by_sorting(scores: npt.NDArray[np.float64], wrong: npt.NDArray[np.bool_]) -> float:
    """Area under the ROC curve by its definition: the curve from the sorted scores, and trapezia under it."""
    order = np.argsort(-scores, kind="stable")
    ends = np.append(np.flatnonzero(np.diff(scores[order])), len(scores) - 1)
    hits = np.append(0, np.cumsum(wrong[order])[ends]) / wrong.sum()
    alarms = np.append(0, np.cumsum(~wrong[order])[ends]) / (~wrong).sum()
    return float(np.trapezoid(hits, alarms))


def counts_of(levels: Bytes, wrong: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    return error_counts(levels[None], wrong[None].astype(np.uint8))


def random_frame(seed: int, classes: int = 5) -> tuple[Bytes, Bytes, npt.NDArray[np.float32]]:
    """Truth with ignored pixels, an answer with unlabelled ones, and a confidence that tells something."""
    rng = np.random.default_rng([9, seed])
    truth = rng.integers(0, classes, (30, 40)).astype(np.uint8)
    confidence = rng.integers(5, CONFIDENCE_STEPS, truth.shape) / CONFIDENCE_STEPS
    answer = np.where(rng.random(truth.shape) < confidence**2, truth, rng.integers(0, classes, truth.shape))
    answer[0], truth[:, 0] = NO_LABEL, NO_LABEL
    return truth, answer.astype(np.uint8), confidence.astype(np.float32)


@settings(max_examples=100, derandomize=True, deadline=None)
@given(levels=LEVELS, seed=st.integers(0, 1000))
def test_the_area_equals_that_under_the_sorted_curve(levels: Bytes, seed: int) -> None:
    wrong = np.random.default_rng(seed).random(len(levels)) < 0.4
    wrong[:2] = True, False
    assert area_under_roc(counts_of(levels, wrong)) == pytest.approx(by_sorting(levels.astype(float), wrong), abs=1e-12)


def test_the_area_is_exact_where_pairs_exceed_64_bits() -> None:
    """Half of the wrong pixels lie above all right ones, the others above half of them and level with the rest."""
    many = 10**10
    counts = np.array([[many, 0], [many, many], [0, many]], np.int64)
    assert area_under_roc(counts) == (1.0 + 0.75) / 2


@pytest.mark.parametrize("column", [0, 1])
def test_without_errors_or_without_hits_there_is_no_curve(column: int) -> None:
    counts = np.zeros((256, 2), np.int64)
    counts[:, column] = 3
    assert np.isnan(area_under_roc(counts))


@settings(max_examples=50, derandomize=True, deadline=None)
@given(levels=LEVELS, cut=st.integers(1, 59), seed=st.integers(0, 1000))
def test_counts_of_parts_are_the_counts_of_the_whole(levels: Bytes, cut: int, seed: int) -> None:
    """Merged or shuffled, the pixels are the same."""
    rng = np.random.default_rng(seed)
    wrong = rng.random(len(levels)) < 0.5
    whole, cut = counts_of(levels, wrong), min(cut, len(levels) - 1)
    parts = counts_of(levels[:cut], wrong[:cut]) + counts_of(levels[cut:], wrong[cut:])
    shuffled = rng.permutation(len(levels))
    np.testing.assert_array_equal(parts, whole)
    np.testing.assert_array_equal(counts_of(levels[shuffled], wrong[shuffled]), whole)
    assert whole.sum() == len(levels)


@settings(max_examples=50, derandomize=True, deadline=None)
@given(levels=LEVELS, seed=st.integers(0, 1000))
def test_only_the_order_of_levels_counts(levels: Bytes, seed: int) -> None:
    """A measure of half the range points as well; turned round, it points at what is left."""
    wrong = np.random.default_rng(seed).random(len(levels)) < 0.4
    wrong[:2] = True, False
    area = area_under_roc(counts_of(levels // 2, wrong))
    assert area_under_roc(counts_of(levels // 2 + 100, wrong)) == area
    assert area_under_roc(counts_of(255 - levels // 2, wrong)) == pytest.approx(1 - area, abs=1e-12)


def test_right_wrong_and_ignored() -> None:
    """No label is wrong, no truth is ignored, another size is taken by nearest neighbour."""
    truth = np.array([[0, 1, 1, 2, 255]], np.uint8)
    answer = np.array([[0, 0, 255, 2, 2]], np.uint8)
    assert rightness(truth, answer, 2).tolist() == [[0, 1, 1, IGNORED, IGNORED]]
    assert rightness(np.zeros((4, 4), np.uint8), np.array([[0, 1]], np.uint8), 2).tolist() == [[0, 0, 1, 1]] * 4


def test_calibration_by_hand() -> None:
    """60 pixels at 0.75 of which 40 are right, 20 at 1.0, all right: gaps of 1/12 and 0."""
    counts = np.zeros((CONFIDENCE_STEPS + 1, 2), np.int64)
    counts[48], counts[64] = (40, 20), (20, 0)
    found = reliability(counts, frames=2)
    assert found is not None
    assert (found.pixels, found.frames, found.accuracy, found.confidence) == (80, 2, 0.75, 65 / 80)
    assert found.ece == pytest.approx(60 / 80 / 12)
    assert found.mce == pytest.approx(1 / 12)
    full = {place: bin_ for place, bin_ in enumerate(found.bins) if bin_.pixels}
    assert set(full) == {11, 14}  # (11/15, 12/15] and (14/15, 1]
    assert (full[11].confidence, full[11].accuracy) == (0.75, pytest.approx(2 / 3))
    assert reliability(np.zeros_like(counts), frames=0) is None


def test_agrees_with_torchmetrics() -> None:
    """Expected and maximum calibration error, between the edges of bins: there conventions differ."""
    torch = pytest.importorskip("torch")
    theirs = pytest.importorskip("torchmetrics.functional.classification")
    truth, answer, confidence = random_frame(0)
    meter = CalibrationMeter(5)
    meter.update(truth, answer, outcome=SEGMENTED, confidence=confidence)
    found = meter.compute().segmented
    assert found is not None
    judged = truth < 5
    right = torch.from_numpy((truth == answer)[judged].astype(np.int64))
    said = torch.from_numpy(confidence[judged])
    for norm, value in (("l1", found.ece), ("max", found.mce)):
        expected = float(theirs.binary_calibration_error(said, right, n_bins=BINS, norm=norm))
        assert value == pytest.approx(expected, abs=1e-6), norm
    chances = torch.full((len(right), 5), 0.0)
    chances[:, 0], chances[:, 1] = said, 1 - said
    sure = said > 0.5  # elsewhere another class would be the most likely one
    counts = np.zeros((CONFIDENCE_STEPS + 1, 2), np.int64)
    np.add.at(counts, (np.rint(said[sure].numpy() * CONFIDENCE_STEPS).astype(int), 1 - right[sure].numpy()), 1)
    ours = reliability(counts, 1)
    assert ours is not None
    expected = float(theirs.multiclass_calibration_error(chances[sure], 1 - right[sure], 5, n_bins=BINS))
    assert ours.ece == pytest.approx(expected, abs=1e-6)


def test_a_meter_tells_network_from_prediction() -> None:
    """Strata apart, both together, detection by the network's answers alone, other outcomes in none."""
    meter, maps = CalibrationMeter(5), {}
    for seed, outcome in enumerate((SEGMENTED, PROPAGATED, SEGMENTED, Outcome.PENDING)):
        truth, answer, confidence = random_frame(seed)
        levels = np.random.default_rng(seed).integers(0, 256, truth.shape).astype(np.uint8)
        maps[seed] = levels.ravel(), (truth != answer).ravel(), (truth < 5).ravel(), confidence.ravel()
        said = Uncertainty(("entropy",), levels[None], 5)
        meter.update(truth, answer, outcome=outcome, confidence=confidence, uncertainty=said)
    found = meter.compute()
    assert found.segmented is not None
    assert found.propagated is not None
    assert found.answered is not None
    assert found.detection is not None
    assert (found.segmented.frames, found.propagated.frames, found.answered.frames) == (2, 1, 3)
    assert found.answered.pixels == 3 * 30 * 39
    levels, wrong, judged, confidence = (np.concatenate([maps[i][k] for i in (0, 2)]) for k in range(4))
    assert found.detection.wrong == pytest.approx(wrong[judged].mean())
    assert found.detection.auc == pytest.approx({
        "entropy": by_sorting(levels[judged].astype(float), wrong[judged]),
        DOUBT: by_sorting(1.0 - confidence[judged], wrong[judged]),
    })  # fmt: skip


def test_a_network_without_maps_is_judged_by_its_confidence() -> None:
    meter = CalibrationMeter(5)
    assert meter.compute() == Calibration(None, None, None, None)
    truth, answer, confidence = random_frame(3)
    meter.update(truth, answer, outcome=SEGMENTED, confidence=confidence)
    found = meter.compute().detection
    assert found is not None
    assert set(found.auc) == {DOUBT}
    assert found.auc[DOUBT] > 0.6
