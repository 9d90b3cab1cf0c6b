"""What is kept of a run: every frame's result without its pixels, the judgement, and a few frames to look at."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from stsem.classes import NO_LABEL, Bools, ClassSet, Labels
from stsem.frame import Frame
from stsem.log.log import Loaded
from stsem.metrics.calibration import CalibrationMeter
from stsem.metrics.consistency import ConsistencyMeter
from stsem.metrics.scorecard import Scorecard
from stsem.replay.judging import NewestAnswer
from stsem.replay.schedule import Slot
from stsem.replay.unsure import Unsurest
from stsem.result import FrameResult, Outcome, Results

Watch = Callable[[FrameResult, Frame], None]
"""Called with the result of an answered frame, labels included, and the frame."""


class Record:
    """The judge of one run.

    Args:
        slots: every frame of the log, in log order.
        scorecard: None when accuracy cannot be measured.
        watched: log indices whose answers are kept for pictures.
        classes: of the answers; None to leave temporal consistency, and the frame to look at, out.
        watch: called with every answered frame; None when nobody looks.
    """

    def __init__(
        self,
        slots: Sequence[Slot],
        scorecard: Scorecard | None,
        watched: frozenset[int],
        classes: ClassSet | None = None,
        watch: Watch | None = None,
    ) -> None:
        self._slots, self._watched = slots, watched
        self.scorecard = scorecard
        self.consistency = None if classes is None else ConsistencyMeter(len(classes))
        self.calibration = None if scorecard is None else CalibrationMeter(scorecard.class_count)
        self.unsurest = None if classes is None else Unsurest()
        self._watch = watch
        self.results = Results()
        self.answers: dict[int, Labels] = {}

    def arrived(self, slot: Slot, loaded: Loaded, newest: NewestAnswer | None) -> None:
        """Streaming judgement: what was available when this frame arrived, against this frame's truth."""
        if self.scorecard is None or loaded.truth is None:
            return
        labels = None if newest is None else newest.labels
        age = None if newest is None else slot.arrival_ns - newest.stamp_ns
        self.scorecard.judge_streaming(slot.index, loaded.truth, labels, age_ns=age)

    def ended(self, result: FrameResult, loaded: Loaded) -> None:
        """Judge the answer against its own frame, and keep the result without its labels.

        Without a clock, a frame that cannot be decoded or completed was never asked about, and is not judged.
        """
        result = replace(result, coverage=_coverage(result.labels), covered_share=_share(result.covered))
        never_came = result.arrival_ns is None and result.outcome in (Outcome.UNDECODABLE, Outcome.INCOMPLETE)
        if self.scorecard is not None and loaded.truth is not None and not never_came:
            self._judge(self.scorecard, result, loaded.truth)
        if result.labels is not None:
            self._look(result, loaded, result.labels)
        self.results.append(result)

    def _look(self, result: FrameResult, loaded: Loaded, labels: Labels) -> None:
        if result.index in self._watched:
            self.answers[result.index] = labels
        if self.consistency is not None:
            self.consistency.update(labels)
        if self.unsurest is not None:
            self.unsurest.update(result, loaded)
        if self._watch is not None and loaded.frame is not None:
            self._watch(result, loaded.frame)

    def _judge(self, scorecard: Scorecard, result: FrameResult, truth: Labels) -> None:
        slot = self._slot(result.index)
        source = None if result.keyframe is None else self._slot(result.keyframe)
        scorecard.judge(
            result.index, slot.log_stamp_ns, truth, result.labels, outcome=result.outcome,
            distance=None if source is None else slot.index - source.index,
            distance_ns=None if source is None else slot.log_stamp_ns - source.log_stamp_ns,
            covered=result.covered,
        )  # fmt: skip
        if self.calibration is not None and result.labels is not None and result.confidence is not None:
            self.calibration.update(
                truth, result.labels, outcome=result.outcome, confidence=result.confidence,
                uncertainty=result.uncertainty,
            )  # fmt: skip

    def _slot(self, index: int) -> Slot:
        return self._slots[index - self._slots[0].index]


def scorecard_for(classes: ClassSet, known: Labels | None) -> Scorecard:
    """A scorecard that knows which classes the network has.

    Args:
        classes: of the log.
        known: (256,) translation from the network's ids to the log's; None when every class is known (oracle).
    """
    mask = None if known is None else np.isin(np.arange(len(classes)), known[known != NO_LABEL])
    return Scorecard(classes, mask)


def _share(covered: Bools | None) -> float | None:
    return None if covered is None else int(np.count_nonzero(covered)) / max(1, covered.size)


def _coverage(labels: Labels | None) -> float | None:
    if labels is None:
        return None
    return 1.0 - int(np.count_nonzero(labels == NO_LABEL)) / labels.size
