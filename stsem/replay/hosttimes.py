"""What the stages cost on this host while a report was made: shown under `host`, never part of a result."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from stsem import hostclock
from stsem.frame import Frame, Segmentation
from stsem.inference.inferencer import Inferencer, Output
from stsem.inference.network import Network
from stsem.stages.fuse import Fuser
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagation.method import Needs, Predicted, Propagation
from stsem.stages.register import Anchor, Registering, Registration

T = TypeVar("T")


@dataclass
class StageTime:
    """Wall-clock durations of one stage: how many, their sum, the longest."""

    n: int = 0
    total_ns: int = 0
    max_ns: int = 0

    def add(self, duration_ns: int) -> None:
        """Take in one duration."""
        self.n += 1
        self.total_ns += duration_ns
        self.max_ns = max(self.max_ns, duration_ns)


@dataclass
class StageTimes:
    """Wall-clock durations by stage.

    Attributes:
        stages: stage -> its durations.
    """

    stages: dict[str, StageTime] = field(default_factory=dict)

    def measure(self, stage: str, work: Callable[[], T]) -> T:
        """Do `work` and note how long it took."""
        before = hostclock.wall_ns()
        result = work()
        self.stages.setdefault(stage, StageTime()).add(hostclock.wall_ns() - before)
        return result


class TimedInferencer(Inferencer):
    """An `Inferencer` whose network is timed; what comes from a cache is not."""

    def __init__(self, network: Network, *, backend: str, precision: str, threads: int, times: StageTimes) -> None:
        super().__init__(network, backend=backend, precision=precision, threads=threads)
        self._times = times

    def compute(self, frame: Frame) -> Output:
        """See `Inferencer.compute`."""
        return self._times.measure("segment", lambda: super(TimedInferencer, self).compute(frame))


@dataclass(frozen=True)
class TimedRegister:
    """A timed `Registering`."""

    inner: Registering
    times: StageTimes

    def __call__(self, frame: Frame, anchors: Sequence[Anchor]) -> Registration:
        """See `Registering`."""
        return self.times.measure("register", lambda: self.inner(frame, anchors))


@dataclass(frozen=True)
class TimedPropagation:
    """A `Propagation` whose predictions are timed; what it sees is a part of `register`."""

    inner: Propagation
    times: StageTimes

    @property
    def needs(self) -> Needs:
        """See `Propagation.needs`."""
        return self.inner.needs

    def see(self, frame: Frame, registration: Registration) -> None:
        """See `Propagation.see`."""
        self.inner.see(frame, registration)

    def selected(self, frame: Frame, registration: Registration | None) -> None:
        """See `Propagation.selected`."""
        self.inner.selected(frame, registration)

    def finished(self, keyframe: Keyframe) -> None:
        """See `Propagation.finished`."""
        self.inner.finished(keyframe)

    def forgotten(self, index: int) -> None:
        """See `Propagation.forgotten`."""
        self.inner.forgotten(index)

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """See `Propagation.predict`."""
        return self.times.measure("propagate", lambda: self.inner.predict(source, frame, registration))

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        """See `Propagation.expected_coverage`."""
        return self.inner.expected_coverage(frame, registration)


@dataclass(frozen=True)
class TimedFuse:
    """A timed `Fuser`."""

    inner: Fuser
    times: StageTimes

    def can_fuse(self, frame: Frame) -> bool:
        """See `Fuser.can_fuse`."""
        return self.inner.can_fuse(frame)

    def __call__(self, frame: Frame, segmentation: Segmentation) -> None:
        """See `Fuser`."""
        self.times.measure("fuse", lambda: self.inner(frame, segmentation))
