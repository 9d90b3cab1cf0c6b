"""The answer path on the simulated clock: what happens to a frame between taken and answered (DESIGN 3)."""

from collections.abc import Callable
from dataclasses import dataclass

from stsem.frame import Frame
from stsem.replay.answer import AnswerRule
from stsem.replay.ending import Ending, predicted, segmented
from stsem.replay.jobs import Jobs
from stsem.replay.network import Background, NetworkJobs
from stsem.replay.tracking import Decoding, TrackWorker, posed
from stsem.stages.register import Registration

Then = Callable[[Ending], None]


@dataclass(frozen=True, eq=False)
class AnswerPath:
    """The stages that a frame goes through, as jobs: decode, track, register, then segment or propagate.

    Args:
        jobs: makes the jobs.
        rule: decides and does the work.
        decoding: comes first.
        track: gives each frame its pose before anything else; None where answers need none that must be found.
        network: segments keyframes, while their answers wait for it.
        background: takes the keyframes instead, so that no answer waits for the network; None where they do.
    """

    jobs: Jobs
    rule: AnswerRule
    decoding: Decoding
    track: TrackWorker | None
    network: NetworkJobs
    background: Background | None

    def answer(self, frame: Frame, then: Then) -> None:
        """Answer `frame`; `then` is told how, when the answer is there."""
        self.decoding.before(frame, lambda: self._locate(frame, then))

    def _locate(self, frame: Frame, then: Then) -> None:
        if self.track is None:
            self._register(frame, then)
        else:
            self.track.after(frame.index, lambda tracking: self._register(posed(frame, tracking), then))

    def _register(self, frame: Frame, then: Then) -> None:
        if self.rule.registers:
            self.jobs.submit(
                frame, "register", 1, lambda: self.rule.register(frame), lambda found: self._choose(frame, found, then)
            )
        else:
            self._choose(frame, None, then)

    def _choose(self, frame: Frame, registration: Registration | None, then: Then) -> None:
        reason = self.rule.choose(frame, registration)
        if reason is None:
            self._predict(frame, registration, "", then)
        elif self.background is None:
            self.network.segment(frame, lambda answer: then(segmented(frame.index, answer, reason)))
        else:
            self.background.hand(frame, reason)
            self._predict(frame, registration, reason, then)

    def _predict(self, frame: Frame, registration: Registration | None, reason: str, then: Then) -> None:
        if self.rule.source is None:
            then(predicted(None, reason))
        else:
            self.jobs.submit(
                frame, "propagate", 1, lambda: self.rule.propagate(frame, registration),
                lambda found: then(predicted(found, reason)),
            )  # fmt: skip
