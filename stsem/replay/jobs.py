"""The work of the stages as jobs on the simulated cores."""

from collections.abc import Callable
from typing import TypeVar

from stsem.frame import Frame
from stsem.result import STAGES
from stsem.sim.cores import CorePool, Job
from stsem.sim.costs import CostSource

T = TypeVar("T")

ORDER = {stage: place for place, stage in enumerate(STAGES)}
"""Place of each stage in the pipeline: among jobs of one frame the smaller goes first."""


class Jobs:
    """Makes jobs that last as long as their cost.

    Args:
        pool: the cores.
        costs: how long jobs last.
    """

    def __init__(self, pool: CorePool, costs: CostSource) -> None:
        self._pool, self._costs = pool, costs

    def submit(
        self, frame: Frame, stage: str, cores: int, work: Callable[[], T], on_finish: Callable[[T], None]
    ) -> None:
        """Have `work` done for `frame` when `cores` are free; `on_finish` gets its result at the end."""
        costs = self._costs

        def run() -> tuple[T, int]:
            return costs.run(frame.stamp_ns, stage, cores, work)

        self._pool.submit(Job(frame.index, stage, ORDER[stage], cores, run, on_finish))
