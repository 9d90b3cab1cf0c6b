"""What became of a frame: its outcome, and the spans of core time spent on it."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from struct import Struct

from stsem.classes import Bools, Labels
from stsem.packed import Codes, Packed, packed_time, unpacked_time
from stsem.uncertainty import Confidence, Uncertainty

STAGES: tuple[str, ...] = ("decode", "register", "segment", "propagate", "track", "fuse")
"""Every stage that can hold a core, in pipeline order: among jobs of one frame the earlier stage goes first, and
tables, columns and pictures follow the same order. `decode` is a job only where `--count-decode` makes it one."""

ANSWER_STAGES: tuple[str, ...] = tuple(stage for stage in STAGES if stage not in ("track", "fuse"))
"""Stages between taking a frame and answering it; `track` and `fuse` work beside them. In pipeline order. Where the
answer needs the pose that SLAM finds, `track` lies between, too."""


class Outcome(StrEnum):
    """How the ANSWER to a frame was made (DESIGN 5); every frame ends in exactly one."""

    SEGMENTED = "segmented"
    PROPAGATED = "propagated"
    NO_SOURCE = "no_source"
    DROPPED_BUSY = "dropped_busy"
    UNDECODABLE = "undecodable"
    INCOMPLETE = "incomplete"
    PENDING = "pending"

    @property
    def is_answer(self) -> bool:
        """Whether a frame with this outcome was answered with labels."""
        return self in (Outcome.SEGMENTED, Outcome.PROPAGATED)


@dataclass(frozen=True, slots=True)
class Span:
    """One job on the simulated cores. Times are simulated nanoseconds, zero at the first frame's stamp.

    Args:
        frame: log index of the frame it worked for.
        stage: one of `STAGES`; `decode` only where decoding is counted, `track` only where poses come from SLAM.
        cores: the cores it held, ascending.
        ready_ns: when it could have started.
        start_ns, end_ns: when it held its cores, half-open.
    """

    frame: int
    stage: str
    cores: tuple[int, ...]
    ready_ns: int
    start_ns: int
    end_ns: int


@dataclass(frozen=True, eq=False, slots=True)
class FrameResult:
    """The record of one frame in one run.

    Args:
        index: log index.
        stamp_ns: simulated capture stamp: time since the first frame's, divided by the rate; the same offline.
        arrival_ns: simulated arrival; None offline, or if it never arrived.
        taken_ns: when the answer path took it; None if it did not, or offline.
        answered_ns: when its labels were finished; None if never, or offline.
        outcome: exactly one.
        keyframe: log index of the keyframe that its labels come from (its own index when segmented); None without.
        reason: why it became a keyframe (`first`, `rotation`, `translation`, `time`, `interval`, `no homography`,
            `every frame`, ...), or why it has no answer; "" otherwise.
        coverage: share of pixels of `labels` that are not NO_LABEL; None without an answer.
        spans: its jobs, in order of start.
        labels: (H, W) uint8 in the log's classes; None without an answer.
        confidence: (H, W) float32 that goes with the labels; None where none is stated.
        uncertainty: maps (H, W) from the network; None where it gives none, and for answers that were predicted.
        covered: (H, W) bool, the pixels of a predicted answer that rest on evidence; None where nobody says.
        covered_share: the share of them, 0..1.
        remark: what its prediction had to do without; "" otherwise.
    """

    index: int
    stamp_ns: int
    arrival_ns: int | None
    taken_ns: int | None
    answered_ns: int | None
    outcome: Outcome
    keyframe: int | None = None
    reason: str = ""
    coverage: float | None = None
    spans: tuple[Span, ...] = field(default=())
    labels: Labels | None = None
    confidence: Confidence | None = None
    uncertainty: Uncertainty | None = None
    covered: Bools | None = None
    covered_share: float | None = None
    remark: str = ""


class Spans(Packed[Span]):
    """Jobs in 31 bytes each."""

    layout = Struct("<ibhqqq")

    def __init__(self, items: Iterable[Span] = ()) -> None:
        self._stages: Codes[str] = Codes()
        self._cores: Codes[tuple[int, ...]] = Codes()
        super().__init__(items)

    def _pack(self, item: Span) -> tuple[int, ...]:
        stage, cores = self._stages.code(item.stage), self._cores.code(item.cores)
        return item.frame, stage, cores, item.ready_ns, item.start_ns, item.end_ns

    def _unpack(self, frame: int, stage: int, cores: int, *times_ns: int) -> Span:
        return Span(frame, self._stages.value(stage), self._cores.value(cores), *times_ns)


_OUTCOMES = tuple(Outcome)


class Results(Packed[FrameResult]):
    """What became of frames, without spans and images, in 65 bytes each."""

    layout = Struct("<iqqqqbiiddi")

    def __init__(self, items: Iterable[FrameResult] = ()) -> None:
        self._reasons: Codes[str] = Codes()
        self._remarks: Codes[str] = Codes()
        super().__init__(items)

    def _pack(self, item: FrameResult) -> tuple[float, ...]:
        return (
            item.index, item.stamp_ns, packed_time(item.arrival_ns), packed_time(item.taken_ns),
            packed_time(item.answered_ns), _OUTCOMES.index(item.outcome),
            -1 if item.keyframe is None else item.keyframe, self._reasons.code(item.reason),
            -1.0 if item.coverage is None else item.coverage,
            -1.0 if item.covered_share is None else item.covered_share, self._remarks.code(item.remark),
        )  # fmt: skip

    def _unpack(
        self, index: int, stamp_ns: int, arrival_ns: int, taken_ns: int, answered_ns: int, outcome: int,
        keyframe: int, reason: int, coverage: float, covered_share: float, remark: int,
    ) -> FrameResult:  # fmt: skip
        return FrameResult(
            index, stamp_ns, unpacked_time(arrival_ns), unpacked_time(taken_ns), unpacked_time(answered_ns),
            _OUTCOMES[outcome], None if keyframe < 0 else keyframe, self._reasons.value(reason),
            None if coverage < 0 else coverage, covered_share=None if covered_share < 0 else covered_share,
            remark=self._remarks.value(remark),
        )  # fmt: skip
