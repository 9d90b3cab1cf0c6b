"""Where the cost of a job comes from. Every source answers alike: do the work, and say how long it took.

A source never looks at how busy this machine is, except `MeasuredCosts`, which is for a look and never gated.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from typing import Protocol, TypeVar

from stsem.chance import choose
from stsem.errors import CostError
from stsem.sim.profile import CostProfile, key

T = TypeVar("T")

Durations = dict[tuple[int, str, int], int]
"""(capture stamp, stage, cores) -> nanoseconds."""


class CostSource(Protocol):
    """What the pipeline asks for the cost of each job."""

    @property
    def sha256(self) -> str | None:
        """Digest of the source, the `costs_sha256` of a report; None when durations are measured as they happen."""

    def run(self, stamp_ns: int, stage: str, cores: int, compute: Callable[[], T]) -> tuple[T, int]:
        """Do `compute` and return its result with the job's cost in simulated nanoseconds.

        Args:
            stamp_ns: capture stamp of the frame, as in the log.
            stage: name of the stage.
            cores: how many cores the job holds.
            compute: the work itself.

        Raises:
            CostError: the source does not know this stage on this number of cores.
        """


class ProfileCosts:
    """Costs drawn from a profile (DESIGN 3).

    u = hash(seed, log sha256, stamp, stage) / 2^64 and cost = sorted samples[floor(u n)]. The draw depends on nothing
    else: modes share their luck, and the order of calls does not matter.

    Args:
        profile: the samples.
        seed: of the run.
        log_sha256: of the log, hexadecimal.
    """

    def __init__(self, profile: CostProfile, seed: int, log_sha256: str) -> None:
        self.profile = profile
        self.sha256 = profile.sha256
        self._seed = seed
        self._log_sha256 = log_sha256

    def cost_ns(self, stamp_ns: int, stage: str, cores: int) -> int:
        """The cost of a job, in nanoseconds.

        Raises:
            CostError: the profile has no such stage on this number of cores.
        """
        samples = self.profile.samples(stage, cores)
        return samples[choose(self._seed, len(samples), self._log_sha256, stamp_ns, stage)]

    def run(self, stamp_ns: int, stage: str, cores: int, compute: Callable[[], T]) -> tuple[T, int]:
        """See `CostSource.run`."""
        cost_ns = self.cost_ns(stamp_ns, stage, cores)
        return compute(), cost_ns


class ConstantCosts:
    """The fake for tests and worked examples: every job of a stage costs the same.

    Args:
        costs_ns: by `stage@cores` or, for any number of cores, by `stage`; the longer name wins.
    """

    def __init__(self, costs_ns: Mapping[str, int]) -> None:
        self._costs_ns = dict(costs_ns)
        self.sha256 = hashlib.sha256(json.dumps(self._costs_ns, sort_keys=True).encode()).hexdigest()

    def cost_ns(self, stage: str, cores: int) -> int:
        """The cost of a job, in nanoseconds.

        Raises:
            CostError: the stage has no cost.
        """
        for name in (key(stage, cores), stage):
            if name in self._costs_ns:
                return self._costs_ns[name]
        raise CostError(f"No cost is given for '{key(stage, cores)}', only for {', '.join(sorted(self._costs_ns))}.")

    def run(self, stamp_ns: int, stage: str, cores: int, compute: Callable[[], T]) -> tuple[T, int]:
        """See `CostSource.run`; `stamp_ns` does not matter."""
        cost_ns = self.cost_ns(stage, cores)
        return compute(), cost_ns


class TraceCosts:
    """The exact durations of an earlier run (`stsem.sim.trace.read_durations`).

    Args:
        durations: by mode.
        mode: whose durations to use.
        sha256: digest of the trace's file.

    Raises:
        CostError: the trace does not hold this mode.
    """

    def __init__(self, durations: Mapping[str, Durations], mode: str, sha256: str) -> None:
        if mode not in durations:
            raise CostError(
                f"The trace has no jobs of the mode '{mode}', only of {', '.join(durations) or 'none'}; "
                "record it with this mode."
            )
        self.sha256 = sha256
        self._durations = durations[mode]

    def cost_ns(self, stamp_ns: int, stage: str, cores: int) -> int:
        """The recorded cost of a job, in nanoseconds.

        Raises:
            CostError: the trace has no such job.
        """
        found = self._durations.get((stamp_ns, stage, cores))
        if found is None:
            recorded = ", ".join(sorted({key(stage, cores) for _, stage, cores in self._durations}))
            raise CostError(
                f"The trace has no '{key(stage, cores)}' for the frame at {stamp_ns} ns (it has {recorded}); "
                "a trace gives costs only to a run with the log and settings it was recorded with."
            )
        return found

    def run(self, stamp_ns: int, stage: str, cores: int, compute: Callable[[], T]) -> tuple[T, int]:
        """See `CostSource.run`."""
        cost_ns = self.cost_ns(stamp_ns, stage, cores)
        return compute(), cost_ns


class MeasuredCosts:
    """Each job costs what it takes on this machine, now: for a look, never gated.

    Args:
        clock_ns: a monotonic clock in nanoseconds; handed in, because nothing in `sim/` knows the host.
    """

    sha256: None = None

    def __init__(self, clock_ns: Callable[[], int]) -> None:
        self._clock_ns = clock_ns

    def run(self, stamp_ns: int, stage: str, cores: int, compute: Callable[[], T]) -> tuple[T, int]:
        """See `CostSource.run`; only the duration of `compute` matters."""
        before = self._clock_ns()
        result = compute()
        return result, self._clock_ns() - before
