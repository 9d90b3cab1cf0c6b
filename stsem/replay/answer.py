"""How one mode answers a frame: the order of the stages and the keyframes they remember. Knows no clock.

The real-time run calls these steps as jobs on the simulated cores, the offline run calls them in a row; so both answer
by the same rule.
"""

from dataclasses import dataclass

from stsem.frame import Frame, Segmentation
from stsem.stages.candidate import Candidate, KeyframePolicy, Motion
from stsem.stages.keyframe import Keyframe, view_of
from stsem.stages.propagation.method import Predicted, Propagation
from stsem.stages.register import Anchor, Registering, Registration
from stsem.stages.segment import Segmenter

FIRST, EVERY_FRAME = "first", "every frame"


@dataclass(frozen=True, eq=False)
class Prediction:
    """The rule of modes that predict: when to look, and how to fill in.

    Args:
        policy: which frames become keyframes.
        method: how the others are labelled; of this run alone.
        register: what relates frames to keyframes; None if nobody asks.
    """

    policy: KeyframePolicy
    method: Propagation
    register: Registering | None


@dataclass(frozen=True, eq=False)
class _Chosen:
    """A frame that was selected, and what related it to those before."""

    frame: Frame
    registration: Registration | None

    @property
    def anchor(self) -> Anchor | None:
        features = None if self.registration is None else self.registration.features
        return None if features is None else Anchor(self.frame.index, features)


class AnswerRule:
    """The steps of one mode over one log, with the keyframes it remembers.

    Frames are predicted from `source`, the finished keyframe with the newest stamp. Between a keyframe's choice and its
    labels any number of frames may be answered; each is registered to the last *selected* keyframe if the policy looks
    at that, and to the source if the method does.

    Args:
        segmenter: labels keyframes.
        prediction: None for `per-frame`, where every frame is a keyframe.
    """

    def __init__(self, segmenter: Segmenter, prediction: Prediction | None) -> None:
        self._segmenter, self._prediction = segmenter, prediction
        self._selected: _Chosen | None = None
        self._unfinished: dict[int, _Chosen] = {}
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
        """What relates `frame` to the last selected keyframe and to the source."""
        if self._prediction is None or self._prediction.register is None:
            return None
        return self._prediction.register(frame, self._anchors(self._prediction))

    def choose(self, frame: Frame, registration: Registration | None) -> str | None:
        """Why `frame` is a keyframe, or None; a chosen frame is remembered as the last selected one.

        It must be given to `finish` or `abandon` later.
        """
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
        self._selected = self._unfinished[frame.index] = _Chosen(frame, registration)
        self._prediction.method.selected(frame, registration)
        return reason

    def segment(self, frame: Frame) -> Segmentation | None:
        """Labels from the network; None if this frame cannot be segmented at all. Call `finish` to make it a source."""
        answer = self._segmenter.segment(frame)
        return answer if self._segmenter.can_segment(frame.index) else None

    def finish(self, frame: Frame, answer: Segmentation) -> None:
        """The keyframe `frame` is finished: later frames may be predicted from it."""
        chosen, method = self._unfinished.pop(frame.index, None), self._method
        anchor = None if chosen is None else chosen.anchor
        features = None if anchor is None else anchor.features
        keyframe = Keyframe(frame.index, frame.stamp_ns, answer, features, view_of(frame), frame.image)
        if method is not None:
            method.finished(keyframe)
        older, self._source = self._source, keyframe
        if older is not None and older.stamp_ns > keyframe.stamp_ns:
            older, self._source = keyframe, older
        if method is not None and older is not None and older.index != self._source.index:
            method.forgotten(older.index)

    def abandon(self, frame: Frame) -> None:
        """The chosen `frame` will not be segmented after all: a newer one took its place before the network."""
        self._unfinished.pop(frame.index, None)
        if self._method is not None:
            self._method.forgotten(frame.index)

    def propagate(self, frame: Frame, registration: Registration | None) -> Predicted | None:
        """Labels predicted from `source`; None without one, or in a mode that never predicts."""
        if self._prediction is None or self._source is None:
            return None
        return self._prediction.method.predict(self._source, frame, registration)

    @property
    def _method(self) -> Propagation | None:
        return None if self._prediction is None else self._prediction.method

    def _anchors(self, rule: Prediction) -> tuple[Anchor, ...]:
        """The last selected keyframe if the policy looks at it, the source if the method does, each once."""
        found: dict[int, Anchor] = {}
        looks = rule.policy.needs_homography or rule.policy.needs_coverage
        if looks and self._selected is not None and (anchor := self._selected.anchor):
            found[anchor.index] = anchor
        source = self._source
        if rule.method.needs.points and source is not None and source.features is not None:
            found.setdefault(source.index, Anchor(source.index, source.features))
        return tuple(found.values())

    def _reason(self, policy: KeyframePolicy, frame: Frame, registration: Registration | None) -> str | None:
        if self._selected is None:
            return FIRST
        last = self._selected.frame
        homography = None if registration is None else registration.homographies.get(last.index)
        motion = None if homography is None else Motion.of(homography, frame.size)
        coverage = None if registration is None else registration.coverage
        elapsed_ns = frame.stamp_ns - last.stamp_ns
        return policy.reason(Candidate(frame.index, frame.stamp_ns, last.index, elapsed_ns, motion, coverage))
