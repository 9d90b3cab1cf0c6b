"""What is kept of a run: every frame's result without its pixels, the judgement, and a few frames to look at."""

from dataclasses import replace

import numpy as np

from stsem.classes import NO_LABEL, ClassSet, Labels
from stsem.log.log import Loaded
from stsem.metrics.scorecard import Scorecard
from stsem.replay.realtime import NewestAnswer
from stsem.replay.schedule import Slot
from stsem.result import FrameResult, Outcome


class Record:
    """The judge of one run.

    Args:
        slots: every frame of the log, in log order.
        scorecard: None when accuracy cannot be measured.
        watched: log indices whose answers are kept for pictures.
    """

    def __init__(self, slots: tuple[Slot, ...], scorecard: Scorecard | None, watched: frozenset[int]) -> None:
        self._slots, self._watched = slots, watched
        self.scorecard = scorecard
        self.results: list[FrameResult] = []
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
        never_came = result.arrival_ns is None and result.outcome in (Outcome.UNDECODABLE, Outcome.INCOMPLETE)
        if self.scorecard is not None and loaded.truth is not None and not never_came:
            self._judge(self.scorecard, result, loaded.truth)
        if result.index in self._watched and result.labels is not None:
            self.answers[result.index] = result.labels
        self.results.append(replace(result, labels=None, coverage=_coverage(result.labels)))

    def _judge(self, scorecard: Scorecard, result: FrameResult, truth: Labels) -> None:
        slot = self._slot(result.index)
        source = None if result.keyframe is None else self._slot(result.keyframe)
        scorecard.judge(
            result.index, slot.log_stamp_ns, truth, result.labels, outcome=result.outcome,
            distance=None if source is None else slot.index - source.index,
            distance_ns=None if source is None else slot.log_stamp_ns - source.log_stamp_ns,
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


def _coverage(labels: Labels | None) -> float | None:
    if labels is None:
        return None
    return 1.0 - int(np.count_nonzero(labels == NO_LABEL)) / labels.size
