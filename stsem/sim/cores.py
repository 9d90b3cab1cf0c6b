"""The robot's cores: jobs wait, start, hold their cores for their cost, and only then show their result."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from heapq import heappop, heappush
from typing import Any, Generic, TypeVar

from stsem.errors import UsageError
from stsem.result import Span, Spans
from stsem.sim.events import EventQueue, Priority

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Job(Generic[T]):
    """A piece of work for one frame.

    Args:
        frame: log index of the frame; a smaller one is older and goes first.
        stage: name of the stage, for the trace and the profile.
        order: place in the pipeline; among jobs of one frame the smaller goes first.
        cores: how many it holds, all at once, from start to end.
        work: called once, when the job STARTS, so it sees the state of that moment; returns the result and the cost in
            simulated nanoseconds (see `stsem.sim.costs`).
        on_finish: called with the result when the cost has passed; nobody can have it earlier.
    """

    frame: int
    stage: str
    order: int
    cores: int
    work: Callable[[], tuple[T, int]]
    on_finish: Callable[[T], None]


@dataclass(frozen=True, order=True)
class _Ready:
    """A waiting job, ordered oldest frame first, then pipeline order; the last two fields only break ties."""

    frame: int
    order: int
    stage: str
    sequence: int
    ready_ns: int
    job: Any


class CorePool:
    """A fixed number of equal cores, without preemption.

    Ready jobs start oldest frame first, then in pipeline order. Nothing overtakes: while the first of them does not
    fit, nothing behind it starts, so a 2-core job gets its cores as soon as the running jobs end. A job takes the
    lowest free cores. Starts happen after all finishes and arrivals of an instant (`Priority.START`).

    Args:
        queue: the clock it lives on.
        cores: how many.
    """

    def __init__(self, queue: EventQueue, cores: int) -> None:
        if cores < 1:
            raise UsageError(f"A robot needs at least one core, but {cores} came; give --cores 1 or more.")
        self._queue = queue
        self._cores = cores
        self._free = list(range(cores))
        self._ready: list[_Ready] = []
        self._spans = Spans()
        self._sequence = 0
        self._start_is_due = False

    @property
    def cores(self) -> int:
        """How many cores there are."""
        return self._cores

    @property
    def spans(self) -> Sequence[Span]:
        """Every job started so far, in order of start, and further ones as they start; `end_ns` may lie ahead."""
        return self._spans

    @property
    def running(self) -> tuple[Span, ...]:
        """The jobs that hold cores now: started, not finished."""
        now = self._queue.now_ns
        return tuple(span for span in self._spans if span.end_ns > now)

    @property
    def waiting(self) -> tuple[Job[Any], ...]:
        """The jobs that are ready but not started, in the order in which they will start."""
        return tuple(entry.job for entry in sorted(self._ready))

    def submit(self, job: Job[Any]) -> None:
        """Make `job` ready now.

        Raises:
            UsageError: it claims more cores than there are, or none.
        """
        if not 1 <= job.cores <= self._cores:
            raise UsageError(
                f"The stage '{job.stage}' claims {job.cores} cores, but the simulated robot has {self._cores}; "
                f"give --cores {max(job.cores, 1)} or more."
            )
        now = self._queue.now_ns
        heappush(self._ready, _Ready(job.frame, job.order, job.stage, self._sequence, now, job))
        self._sequence += 1
        self._request_start()

    def utilisation(self, start_ns: int, end_ns: int) -> tuple[float, ...]:
        """Share of the time from `start_ns` to `end_ns` in which each core was held; zeros for an empty interval."""
        busy = [0] * self._cores
        for span in self._spans:
            held = max(0, min(span.end_ns, end_ns) - max(span.start_ns, start_ns))
            for core in span.cores:
                busy[core] += held
        length = end_ns - start_ns
        return tuple(held / length if length > 0 else 0.0 for held in busy)

    def _request_start(self) -> None:
        if not self._start_is_due:
            self._start_is_due = True
            self._queue.schedule(self._queue.now_ns, Priority.START, self._start_ready)

    def _start_ready(self) -> None:
        self._start_is_due = False
        while self._ready and self._ready[0].job.cores <= len(self._free):
            self._start(heappop(self._ready))

    def _start(self, entry: _Ready) -> None:
        job, now = entry.job, self._queue.now_ns
        held, self._free = tuple(self._free[: job.cores]), self._free[job.cores :]
        result, cost_ns = job.work()
        if type(cost_ns) is not int or cost_ns < 0:
            raise ValueError(f"the cost of '{job.stage}' must be an int of at least 0 ns, but {cost_ns!r} came")
        self._spans.append(Span(job.frame, job.stage, held, entry.ready_ns, now, now + cost_ns))
        self._queue.schedule(now + cost_ns, Priority.FINISH, partial(self._finish, job, held, result))

    def _finish(self, job: Job[T], held: tuple[int, ...], result: T) -> None:
        self._free = sorted((*self._free, *held))
        job.on_finish(result)
        self._request_start()
