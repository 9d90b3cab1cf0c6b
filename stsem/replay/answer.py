"""How one mode answers a frame: the order of the stages and the keyframes they remember. Knows no clock.

The real-time run calls these steps as jobs on the simulated cores, the offline run calls them in a row; so both answer
by the same rule.
"""

from dataclasses import dataclass, replace

from stsem.frame import Frame, Segmentation
from stsem.result import FrameResult
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagate import Propagation
from stsem.stages.register import Registering, Registration
from stsem.stages.segment import Segmenter
from stsem.stages.select import Candidate, KeyframePolicy, Motion

FIRST, EVERY_FRAME = "first", "every frame"


@dataclass(frozen=True, eq=False)
class Prediction:
    """The rule of modes that predict: when to look, and how to fill in.

    Args:
        policy: which frames become keyframes.
        method: how the others are labelled.
        register: needed by either; None if neither looks at a homography.
    """

    policy: KeyframePolicy
    method: Propagation
    register: Registering | None


class AnswerRule:
    """The steps of one mode over one log, with their memory.

    Args:
        segmenter: labels keyframes.
        prediction: None for `per-frame`, where every frame is a keyframe.
    """

    def __init__(self, segmenter: Segmenter, prediction: Prediction | None) -> None:
        self._segmenter, self._prediction = segmenter, prediction
        self._selected: tuple[Frame, Registration | None] | None = None
        self._source: Keyframe | None = None
        self._deferred: str | None = None
        self.moved = 0
        """Choices moved to the next frame that can be segmented (the oracle needs truth)."""

    @property
    def registers(self) -> bool:
        """Whether `register` has work to do."""
        return self._prediction is not None and self._prediction.register is not None

    @property
    def source(self) -> Keyframe | None:
        """The finished keyframe with the newest stamp."""
        return self._source

    def register(self, frame: Frame) -> Registration | None:
        """Features of `frame` and the homography from the last selected keyframe to it."""
        if self._prediction is None or self._prediction.register is None:
            return None
        keyframe, registration = self._selected or (None, None)
        if keyframe is None or registration is None:
            return self._prediction.register(frame, None, None)
        return self._prediction.register(frame, registration.features, keyframe.index)

    def choose(self, frame: Frame, registration: Registration | None) -> str | None:
        """Why `frame` is a keyframe, or None; a chosen frame is remembered as the last selected one."""
        if self._prediction is None:
            return EVERY_FRAME
        reason = self._deferred or self._reason(self._prediction.policy, frame, registration)
        if reason is None:
            return None
        if not self._segmenter.can_segment(frame.index):
            self.moved += self._deferred is None
            self._deferred = reason
            return None
        self._deferred = None
        self._selected = frame, registration
        return reason

    def segment(self, frame: Frame) -> Segmentation | None:
        """Labels from the network; None if this frame cannot be segmented at all. Call `finish` to make it a source."""
        answer = self._segmenter.segment(frame)
        return answer if self._segmenter.can_segment(frame.index) else None

    def finish(self, frame: Frame, answer: Segmentation) -> None:
        """The keyframe `frame` is finished: later frames may be predicted from it."""
        if self._source is None or frame.stamp_ns >= self._source.stamp_ns:
            self._source = Keyframe(frame.index, frame.stamp_ns, answer)

    def propagate(self, frame: Frame, registration: Registration | None) -> Segmentation | None:
        """Labels predicted from `source`; None without one, or in a mode that never predicts."""
        if self._prediction is None or self._source is None:
            return None
        homography = None if registration is None else registration.homography
        return self._prediction.method.propagate(self._source, frame, homography)

    def _reason(self, policy: KeyframePolicy, frame: Frame, registration: Registration | None) -> str | None:
        if self._selected is None:
            return FIRST
        last = self._selected[0]
        homography = None if registration is None else registration.homography
        motion = None if homography is None else Motion.of(homography, frame.size)
        return policy.reason(Candidate(frame.index, last.index, frame.stamp_ns - last.stamp_ns, motion))


def with_answer(result: FrameResult, answer: Segmentation | None) -> FrameResult:
    """`result` with the images of its answer, if there is one."""
    if answer is None:
        return result
    return replace(result, labels=answer.labels, confidence=answer.confidence, uncertainty=answer.uncertainty)
