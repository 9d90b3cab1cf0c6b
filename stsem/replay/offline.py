"""One mode without a clock: every frame in order, which is what papers measure (DESIGN 3, `--clock offline`)."""

from collections.abc import Sequence

from stsem.frame import Frame
from stsem.log.log import Loaded
from stsem.replay.answer import AnswerRule
from stsem.replay.ending import Ending, predicted, segmented, unusable
from stsem.replay.judging import Judge
from stsem.replay.schedule import Slot
from stsem.replay.tracking import posed
from stsem.stages.fuse import Fuser
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
        ending = unusable(slot, loaded)
        frame = None if loaded.frame is None or ending is not None else self._located(loaded.frame)
        if self._only_truth and not slot.has_truth:
            return
        if frame is not None:
            ending = self._answered(frame)
        if ending is not None:
            self._judge.ended(ending.result(slot), loaded)

    def _located(self, frame: Frame) -> Frame:
        return frame if self._tracker is None else posed(frame, self._tracker.prepare(frame)())

    def _answered(self, frame: Frame) -> Ending:
        registration = self._rule.register(frame) if self._rule.registers else None
        reason = self._rule.choose(frame, registration)
        if reason is None:
            return predicted(self._rule.propagate(frame, registration))
        answer = self._rule.segment(frame)
        if answer is not None:
            self._rule.finish(frame, answer)
            if self._fuse is not None and self._fuse.can_fuse(frame):
                self._fuse(frame, answer)
        return segmented(frame.index, answer, reason)
