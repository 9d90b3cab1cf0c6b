"""What every method of prediction is asked."""

from dataclasses import dataclass
from typing import Protocol

from stsem.frame import Frame, Segmentation
from stsem.stages.keyframe import Keyframe
from stsem.stages.register import Registration


@dataclass(frozen=True)
class Needs:
    """What must be computed, or must arrive, for a method.

    Args:
        points: features and homographies, by the stage `register`.
        follows: it must `see` every frame that is taken, as a part of `register`.
        space: registered depth, a pose and a camera without distortion, of every frame.
    """

    points: bool = False
    follows: bool = False
    space: bool = False


@dataclass(frozen=True, eq=False)
class Predicted:
    """An answer that was predicted.

    Args:
        answer: labels, confidence, and which pixels are covered; maps of uncertainty are about the keyframe alone.
        keyframe: log index of the keyframe that its distance counts from.
        remark: what the method had to do without, in a word or two; "" when it worked as meant.
    """

    answer: Segmentation
    keyframe: int
    remark: str = ""


class Propagation(Protocol):
    """Predicts labels from keyframes, in one run; it owns its memory.

    Calls come in the order of a run: `see` for each taken frame, then `selected` if it became a keyframe, else
    `predict`. A keyframe that was selected is either `finished`, any number of frames later, or `forgotten`; frames are
    predicted only from one that is finished and not forgotten.
    """

    @property
    def needs(self) -> Needs:
        """What it asks of others."""

    def see(self, frame: Frame, registration: Registration) -> None:
        """The next frame that was taken; called only if the method `follows`."""

    def selected(self, frame: Frame, registration: Registration | None) -> None:
        """The frame seen last became a keyframe; frames may be predicted from it later."""

    def finished(self, keyframe: Keyframe) -> None:
        """The labels of a keyframe are known."""

    def forgotten(self, index: int) -> None:
        """No frame will be predicted from the keyframe `index` as the newest any more."""

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """Labels for `frame`, at the size of its image, by the method's rule where nothing covers a pixel.

        Args:
            source: the finished keyframe with the newest stamp.
            frame: the frame that was seen last.
            registration: of `frame`; None if nobody registers.
        """

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        """Share of the pixels that keyframes cover, 0..1, once all that are selected are finished; None if unknown.

        Cheap, before the frame is predicted or selected; a part of the stage `register` where a policy asks.

        Args:
            frame: the frame that was seen last; some frame was selected before.
            registration: of `frame`.
        """


class Memoryless:
    """The part of a method that remembers nothing between frames."""

    def see(self, frame: Frame, registration: Registration) -> None:
        """See `Propagation.see`."""

    def selected(self, frame: Frame, registration: Registration | None) -> None:
        """See `Propagation.selected`."""

    def finished(self, keyframe: Keyframe) -> None:
        """See `Propagation.finished`."""

    def forgotten(self, index: int) -> None:
        """See `Propagation.forgotten`."""
