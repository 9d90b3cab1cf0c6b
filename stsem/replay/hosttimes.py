"""What the stages cost on this host while a report was made: shown under `host`, never part of a result."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from stsem import hostclock
from stsem.frame import Frame, Segmentation
from stsem.geometry.features import Features
from stsem.geometry.homography import Homography
from stsem.inference.inferencer import Inferencer, Output
from stsem.inference.network import Network
from stsem.stages.fuse import Fuser
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagate import Propagation
from stsem.stages.register import Registering, Registration

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

    def __call__(self, frame: Frame, keyframe: Features | None, keyframe_index: int | None) -> Registration:
        """See `Registering`."""
        return self.times.measure("register", lambda: self.inner(frame, keyframe, keyframe_index))


@dataclass(frozen=True)
class TimedPropagation:
    """A timed `Propagation`."""

    inner: Propagation
    times: StageTimes

    @property
    def needs_homography(self) -> bool:
        """See `Propagation.needs_homography`."""
        return self.inner.needs_homography

    def propagate(self, keyframe: Keyframe, frame: Frame, homography: Homography | None) -> Segmentation:
        """See `Propagation.propagate`."""
        return self.times.measure("propagate", lambda: self.inner.propagate(keyframe, frame, homography))


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
