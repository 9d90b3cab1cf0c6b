"""The judge of one run: answers against their own frames, and against the frames that they were used for."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, Bools, ClassSet, Labels
from stsem.metrics.accumulate import FrameTallies, FrameValues, IndexSet, Judged, Samples, Total
from stsem.metrics.by_distance import ByDistance, DistanceRow, DistanceSummary, summarise
from stsem.metrics.confusion import Matrix, confusion, resized
from stsem.metrics.durations import Durations, Summary
from stsem.metrics.scores import tally
from stsem.result import Outcome

STRATA = (Outcome.SEGMENTED, Outcome.PROPAGATED)
COVERED = "covered"
"""The stratum of those pixels of predicted answers that rest on evidence."""

SCORED = (Outcome.SEGMENTED, Outcome.PROPAGATED, Outcome.NO_SOURCE)
"""Outcomes that the offline and the delivered score contain: the mode answered, if only with "no label"."""


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Everything that a scorecard found.

    Args:
        own: answers against their own frames: the `offline` or the `delivered` score; None: nothing was answered.
        streaming: at every truth frame's arrival, the newest finished answer against that frame; None: not measured.
        age: of those newest answers, milliseconds: arrival of the truth frame - stamp of the answer used.
        strata: `own` of the segmented and of the propagated frames, and of the covered pixels of the latter; a stratum
            without frames is absent.
        by_distance: by distance to the keyframe (reported for the offline pass only).
        distance_summary: mean and minimum over the distances with enough frames; None without any.
        unknown: names of classes with truth pixels that the network does not know; they count as wrong.
        reason: why nothing was measured; "" when it was.
    """

    own: Judged | None
    streaming: Judged | None
    age: Summary | None
    strata: Mapping[str, Judged]
    by_distance: tuple[DistanceRow, ...]
    distance_summary: DistanceSummary | None
    unknown: tuple[str, ...]
    reason: str

    @property
    def measured(self) -> bool:
        """Whether there is any score."""
        return not self.reason


class Scorecard:
    """Judges one run (mode x clock).

    Args:
        classes: of the log; label ids of truth and answers are positions in it.
        known: (C,) bool, which of them the network knows; None: all of them, or not stated.

    Raises:
        ValueError: `known` has another length than `classes`.
    """

    unit: ClassVar[str] = "fraction"
    higher_is_better: ClassVar[bool] = True

    def __init__(self, classes: ClassSet, known: npt.NDArray[np.bool_] | None = None) -> None:
        if known is not None and known.shape != (len(classes),):
            raise ValueError(f"`known` of shape {known.shape} does not fit {len(classes)} classes")
        self._classes, self._known = classes, known
        self._own, self._streaming = self._total(), self._total()
        self._strata = {str(stratum): self._total() for stratum in (*STRATA, COVERED)}
        self._frames, self._instants = FrameTallies(len(classes)), FrameTallies(len(classes))
        self._scored = IndexSet()
        self._distances = ByDistance(len(classes))
        self._ages = Durations()

    @property
    def class_count(self) -> int:
        """C, of the log."""
        return len(self._classes)

    def judge(
        self,
        index: int,
        stamp_ns: int,
        truth: Labels,
        answer: Labels | None,
        *,
        outcome: Outcome,
        distance: int | None,
        distance_ns: int | None,
        covered: Bools | None = None,
    ) -> None:
        """Judge an answer against its own frame (offline, or as delivered): once for EVERY frame with truth.

        The score contains the outcomes `SCORED`; a dropped, pending, undecodable or incomplete frame is no answer of
        the mode and stays out of it. The samples for pairing contain every frame, those as all "no label".

        Args:
            index: log index.
            stamp_ns: capture stamp.
            truth: (H, W) uint8, NO_LABEL is ignored.
            answer: (h, w) uint8; None when the frame got no answer.
            outcome: how the answer was made, or why there is none.
            distance, distance_ns: to the keyframe that the answer comes from, in log indices and stamps; or None.
            covered: (h, w) bool, the pixels of a predicted answer that rest on evidence; None where nobody says.

        Raises:
            ValueError: the frame was judged before, or an image is not a label image.
        """
        matrix = confusion(truth, answer, len(self._classes))
        self._frames.update(index, stamp_ns, matrix)
        if outcome in SCORED:
            self._own.update(matrix, missed=answer is None)
            self._scored.add(index)
        if outcome in STRATA:
            self._strata[outcome].update(matrix, missed=answer is None)
        there = None if answer is None or covered is None else self._where(covered, truth, answer)
        if there is not None:
            self._strata[COVERED].update(there, missed=False)
        if answer is not None and distance is not None and distance_ns is not None:
            self._distances.update(distance, distance_ns, matrix, there)

    def judge_streaming(self, index: int, truth: Labels, answer: Labels | None, *, age_ns: int | None) -> None:
        """Judge, at the arrival of frame `index`, the finished answer with the newest stamp against THIS frame's truth.

        To be called once for EVERY frame with truth: undecodable and incomplete ones too, at their log time.

        Args:
            index: log index of the frame whose truth it is.
            truth: (H, W) uint8, NO_LABEL is ignored.
            answer: (h, w) uint8; None before the first answer: a miss, every pixel is wrong.
            age_ns: this instant - stamp of the answer, on the simulated clock; None with a miss.

        Raises:
            ValueError: the frame was judged so before, or an image is not a label image.
        """
        matrix = confusion(truth, answer, len(self._classes))
        self._instants.update(index, 0, matrix)
        self._streaming.update(matrix, missed=answer is None)
        if age_ns is not None:
            self._ages.update(age_ns)

    def compute(self) -> Accuracy:
        """All scores of the run."""
        own, streaming = self._own.compute(), self._streaming.compute()
        widest = streaming or own
        reason, unknown = self._why_nothing(widest), self._unknown(widest)
        if reason:
            return Accuracy(None, None, None, {}, (), None, unknown, reason)
        rows = self._distances.compute()
        strata = {stratum: found for stratum, kept in self._strata.items() if (found := kept.compute())}
        return Accuracy(
            own=own,
            streaming=streaming,
            age=self._ages.compute(),
            strata=strata,
            by_distance=rows,
            distance_summary=summarise(rows),
            unknown=unknown,
            reason="",
        )

    def samples(self) -> Samples:
        """Tallies of every frame given to `judge`, for intervals and pairing; unanswered ones as all "no label"."""
        return self._frames.compute()

    def streaming_samples(self) -> Samples:
        """Per-frame tallies of the streaming judgement; stamps are those given to `judge` for the same frames.

        Raises:
            ValueError: a frame was judged streaming, but never against itself.
        """
        found, own = self._instants.compute(), self._frames.compute()
        missing = np.setdiff1d(found.index, own.index)
        if len(missing):
            raise ValueError(f"frame {missing[0]} was judged streaming only; judge every frame with truth both ways")
        return Samples(found.index, own.stamp_ns[np.searchsorted(own.index, found.index)], found.tallies)

    def pixel_accuracy(self) -> FrameValues:
        """Pixel accuracy of the scored answers by log index (frames.csv); NaN: the truth is all "ignore"."""
        found = self.samples()
        scored = np.array([index in self._scored for index in found.index], np.bool_)
        return FrameValues(found.index[scored], found.pixel_accuracy[scored])

    def streaming_pixel_accuracy(self) -> FrameValues:
        """The same for the streaming judgement."""
        found = self._instants.compute()
        return FrameValues(found.index, found.pixel_accuracy)

    def _where(self, covered: Bools, truth: Labels, answer: Labels) -> Matrix:
        """The matrix of the `covered` pixels alone."""
        height, width = truth.shape
        seen = resized(covered.view(np.uint8), width, height).view(np.bool_)
        return confusion(np.where(seen, truth, np.uint8(NO_LABEL)), answer, len(self._classes))

    def _total(self) -> Total:
        return Total(len(self._classes), self._known)

    def _why_nothing(self, judged: Judged | None) -> str:
        if judged is None:
            return "no frame with truth was answered"
        if not judged.scores.pixels:
            return "the truth labels no pixel with a class of the log"
        if judged.classes_common == 0:
            return "the network and the truth have no class in common"
        return ""

    def _unknown(self, judged: Judged | None) -> tuple[str, ...]:
        if judged is None or self._known is None:
            return ()
        shown = tally(judged.matrix)[1] > 0
        return tuple(name for name, seen, knows in zip(self._classes.names, shown, self._known, strict=True)
                     if seen and not knows)  # fmt: skip
