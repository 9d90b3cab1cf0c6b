"""One mode without a clock: every frame in order, which is what papers measure (DESIGN 3, `--clock offline`)."""

from collections.abc import Sequence

from stsem.frame import Frame, Segmentation
from stsem.log.log import Loaded
from stsem.replay.answer import AnswerRule, with_answer
from stsem.replay.realtime import Judge
from stsem.replay.schedule import Slot
from stsem.replay.tracking import posed
from stsem.result import FrameResult, Outcome
from stsem.stages.fuse import Fuser
from stsem.stages.propagation.method import Predicted
from stsem.stages.track import Tracker


class OfflineRun:
    """Answers each frame when it is pushed.

    Args:
        slots: every frame of the log, in log order.
        rule: how the mode answers.
        judge: told of every end (never of arrivals: there is no clock).
        fuse: the map; None without one.
        only_truth: skip frames without truth where no later frame depends on them (`per-frame`); they have no outcome.
        tracker: finds the poses, of every frame; None where the log gives them.
    """

    def __init__(
        self, slots: Sequence[Slot], rule: AnswerRule, judge: Judge, *, fuse: Fuser | None, only_truth: bool,
        tracker: Tracker | None = None,
    ) -> None:  # fmt: skip
        self._slots, self._rule, self._judge, self._fuse = slots, rule, judge, fuse
        self._only_truth, self._tracker = only_truth, tracker
        self._pushed = 0

    def push(self, loaded: Loaded) -> None:
        """The next frame of the log."""
        slot = self._slots[self._pushed]
        self._pushed += 1
        frame = None if loaded.frame is None or slot.missing else self._located(loaded.frame)
        if self._only_truth and not slot.has_truth:
            return
        if frame is not None:
            self._answer(slot, loaded, frame)
        elif loaded.frame is None:
            reason = "" if loaded.error is None else loaded.error.reason
            self._end(slot, loaded, Outcome.UNDECODABLE, reason=reason)
        else:
            self._end(slot, loaded, Outcome.INCOMPLETE, reason=f"no {' and no '.join(slot.missing)}")

    def _located(self, frame: Frame) -> Frame:
        return frame if self._tracker is None else posed(frame, self._tracker.prepare(frame)())

    def _answer(self, slot: Slot, loaded: Loaded, frame: Frame) -> None:
        registration = self._rule.register(frame) if self._rule.registers else None
        reason = self._rule.choose(frame, registration)
        if reason is None:
            self._predicted(slot, loaded, self._rule.propagate(frame, registration))
            return
        answer = self._rule.segment(frame)
        if answer is None:
            self._end(slot, loaded, Outcome.NO_SOURCE, reason="no truth for the oracle")
            return
        self._rule.finish(frame, answer)
        if self._fuse is not None and self._fuse.can_fuse(frame):
            self._fuse(frame, answer)
        self._end(slot, loaded, Outcome.SEGMENTED, answer=answer, keyframe=slot.index, reason=reason)

    def _predicted(self, slot: Slot, loaded: Loaded, found: Predicted | None) -> None:
        if found is None:
            self._end(slot, loaded, Outcome.NO_SOURCE)
        else:
            self._end(
                slot, loaded, Outcome.PROPAGATED, answer=found.answer, keyframe=found.keyframe, reason=found.remark
            )

    def _end(
        self, slot: Slot, loaded: Loaded, outcome: Outcome, *, answer: Segmentation | None = None,
        keyframe: int | None = None, reason: str = "",
    ) -> None:  # fmt: skip
        result = FrameResult(slot.index, slot.stamp_ns, None, None, None, outcome, keyframe, reason)
        self._judge.ended(with_answer(result, answer), loaded)
