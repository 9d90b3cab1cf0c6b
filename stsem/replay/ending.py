"""How a frame ends: by which outcome, with which labels, from which keyframe, and why."""

from dataclasses import dataclass, replace

from stsem.frame import Segmentation
from stsem.log.log import Loaded
from stsem.replay.schedule import Slot
from stsem.result import FrameResult, Outcome
from stsem.stages.propagation.method import Predicted

NO_TRUTH = "no truth for the oracle"


@dataclass(frozen=True, eq=False)
class Ending:
    """How a frame was answered, or why it was not.

    Args:
        outcome: exactly one.
        answer: its labels; None without any.
        keyframe: log index of the keyframe that they come from.
        reason: why the frame was chosen as a keyframe, or why it has no answer.
        remark: what its prediction had to do without.
    """

    outcome: Outcome
    answer: Segmentation | None = None
    keyframe: int | None = None
    reason: str = ""
    remark: str = ""

    def result(
        self, slot: Slot, *, arrival_ns: int | None = None, taken_ns: int | None = None, ended_ns: int | None = None
    ) -> FrameResult:
        """The record of the frame at `slot`; the times are simulated, None without a clock."""
        found = FrameResult(
            slot.index, slot.stamp_ns, arrival_ns, taken_ns, ended_ns if self.outcome.is_answer else None,
            self.outcome, self.keyframe, self.reason, remark=self.remark,
        )  # fmt: skip
        answer = self.answer
        if answer is None:
            return found
        return replace(
            found, labels=answer.labels, confidence=answer.confidence, uncertainty=answer.uncertainty,
            covered=answer.covered,
        )  # fmt: skip


def segmented(index: int, answer: Segmentation | None, reason: str) -> Ending:
    """The frame `index` was chosen for `reason` and answered by the network; None: it could not be segmented."""
    if answer is None:
        return Ending(Outcome.NO_SOURCE, reason=NO_TRUTH)
    return Ending(Outcome.SEGMENTED, answer, index, reason)


def predicted(found: Predicted | None, reason: str = "") -> Ending:
    """A frame was predicted; None: from nothing. `reason`: why it was chosen as a keyframe all the same; "" if not."""
    if found is None:
        return Ending(Outcome.NO_SOURCE, reason=reason)
    return Ending(Outcome.PROPAGATED, found.answer, found.keyframe, reason, found.remark)


def unusable(slot: Slot, loaded: Loaded) -> Ending | None:
    """Why a frame cannot be answered at all; None if it can."""
    if loaded.frame is None:
        return Ending(Outcome.UNDECODABLE, reason="" if loaded.error is None else loaded.error.reason)
    if slot.missing:
        return Ending(Outcome.INCOMPLETE, reason=f"no {' and no '.join(slot.missing)}")
    return None
