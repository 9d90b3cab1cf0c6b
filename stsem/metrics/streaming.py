"""The streaming rule of sAP (Li et al., "Towards Streaming Perception", 2020), for label images.

At the arrival of every frame with truth, the answer that a robot would use at this instant is judged against the world
as it is now: the finished answer with the newest stamp, an answer finished at this very instant included. Before the
first answer everything is wrong, and the frame is a miss.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from stsem.classes import Labels
from stsem.metrics.accumulate import Judged, Total
from stsem.metrics.confusion import confusion


@dataclass(frozen=True, eq=False)
class Answer:
    """A finished answer: the capture stamp of its frame, the instant it was finished, its labels (H, W)."""

    stamp_ns: int
    finished_ns: int
    labels: Labels


@dataclass(frozen=True, eq=False)
class Instant:
    """The arrival of a frame with truth: log index, simulated time, truth (H, W)."""

    index: int
    now_ns: int
    truth: Labels


def newest_finished(answers: Iterable[Answer], now_ns: int) -> Answer | None:
    """The answer with the newest stamp among those finished at or before `now_ns`; None if there is none yet."""
    finished = [answer for answer in answers if answer.finished_ns <= now_ns]
    return max(finished, key=lambda answer: answer.stamp_ns, default=None)


def streaming(instants: Sequence[Instant], answers: Sequence[Answer], classes: int) -> Judged | None:
    """The streaming score of a whole run at once; None without an instant.

    The replay judges as it goes (`Scorecard.judge_streaming`) and keeps one answer at a time; this is the definition
    that it is tested against.
    """
    meter = StreamingMeter(classes)
    for instant in instants:
        meter.update(instant, newest_finished(answers, instant.now_ns))
    return meter.compute()


class StreamingMeter:
    """Accumulates instants with the answer of their moment.

    Args:
        classes: C.
    """

    unit: ClassVar[str] = "fraction"
    higher_is_better: ClassVar[bool] = True

    def __init__(self, classes: int) -> None:
        self._classes = classes
        self._total = Total(classes)

    def update(self, instant: Instant, answer: Answer | None) -> None:
        """Judge `answer` (None: a miss) against the truth of `instant`."""
        matrix = confusion(instant.truth, None if answer is None else answer.labels, self._classes)
        self._total.update(matrix, missed=answer is None)

    def compute(self) -> Judged | None:
        """The score so far; None before the first instant."""
        return self._total.compute()
