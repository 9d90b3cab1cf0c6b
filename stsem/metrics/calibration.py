"""The calibration of one run: is what it says of its own answers true? Definitions in `stsem.metrics.reliability`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stsem.classes import Labels
from stsem.metrics.reliability import WRONG, Counts, Reliability, area_under_roc, error_counts, reliability, rightness
from stsem.metrics.scorecard import STRATA
from stsem.result import Outcome
from stsem.uncertainty import CONFIDENCE_STEPS, DOUBT, Confidence, Uncertainty


@dataclass(frozen=True)
class Detection:
    """How well measures of uncertainty tell wrong pixels from right ones.

    Args:
        auc: measure -> area under the ROC curve; NaN if every pixel is right, or none.
        wrong: share of the pixels that are wrong.
        pixels, frames: judged.
    """

    auc: Mapping[str, float]
    wrong: float
    pixels: int
    frames: int


@dataclass(frozen=True)
class Calibration:
    """What a `CalibrationMeter` found; None where there were no such pixels.

    Args:
        segmented, propagated, answered: answers of the network, predicted ones, and both together.
        detection: by the answers of the network.
    """

    segmented: Reliability | None
    propagated: Reliability | None
    answered: Reliability | None
    detection: Detection | None


class CalibrationMeter:
    """Counts the pixels of one run's answers by what was said of them.

    Args:
        classes: C, of the log.
    """

    unit: ClassVar[str] = "fraction"
    higher_is_better: ClassVar[bool] = False

    def __init__(self, classes: int) -> None:
        self._classes = classes
        self._said = {outcome: np.zeros((CONFIDENCE_STEPS + 1, 2), np.int64) for outcome in STRATA}
        self._frames = dict.fromkeys(STRATA, 0)
        self._maps: dict[str, Counts] = {}

    def update(
        self,
        truth: Labels,
        answer: Labels,
        *,
        outcome: Outcome,
        confidence: Confidence,
        uncertainty: Uncertainty | None = None,
    ) -> None:
        """Add an answer with its frame's truth.

        Args:
            truth: (H, W) uint8; what is no class of the log is ignored.
            answer: (h, w) uint8; a pixel without a label is wrong.
            outcome: how the answer was made; other outcomes than segmented and propagated are not counted.
            confidence: (h, w) float32 in 0..1, counted in steps of 1 / CONFIDENCE_STEPS.
            uncertainty: maps (h, w), counted for segmented frames.
        """
        if outcome not in self._said:
            return
        right = rightness(truth, answer, self._classes)
        steps = np.rint(confidence * np.float32(CONFIDENCE_STEPS)).astype(np.uint8)
        self._said[outcome] += error_counts(steps, right)[: CONFIDENCE_STEPS + 1]
        self._frames[outcome] += 1
        if uncertainty is None or outcome is not Outcome.SEGMENTED:
            return
        for measure in uncertainty.measures:
            counts = self._maps.setdefault(measure, np.zeros((256, 2), np.int64))
            counts += error_counts(uncertainty.of(measure), right)

    def compute(self) -> Calibration:
        """What was found so far."""
        segmented, propagated = (reliability(self._said[outcome], self._frames[outcome]) for outcome in STRATA)
        answered = reliability(np.sum(list(self._said.values()), axis=0), sum(self._frames.values()))
        return Calibration(segmented, propagated, answered, self._detection())

    def _detection(self) -> Detection | None:
        said = self._said[Outcome.SEGMENTED]
        if not (pixels := int(said.sum())):
            return None
        auc = {measure: area_under_roc(counts) for measure, counts in self._maps.items()}
        auc[DOUBT] = area_under_roc(said[::-1])
        return Detection(auc, int(said[:, WRONG].sum()) / pixels, pixels, self._frames[Outcome.SEGMENTED])
