"""simpy as the oracle: the same rules written down a second time, in another library's words."""

from collections import defaultdict
from collections.abc import Generator
from typing import Any

import numpy as np
import simpy

from stsem.chance import generator
from stsem.sim.cores import CorePool, Job
from stsem.sim.events import EventQueue, Priority

Stage = tuple[int, int]
"""(cores, cost)."""
Chains = list[tuple[int, list[Stage]]]
"""By frame: arrival, and the stages that follow each other."""
Row = tuple[int, int, tuple[int, ...], int, int, int]
"""(frame, stage number, cores, ready, start, end)."""


def random_chains(rng: np.random.Generator, cores: int) -> Chains:
    frames = int(rng.integers(1, 9))
    arrivals = rng.integers(0, 30, frames)
    return [
        (int(arrival), [(int(rng.integers(1, cores + 1)), int(rng.integers(1, 9))) for _ in range(rng.integers(1, 4))])
        for arrival in arrivals
    ]


def by_stsem(chains: Chains, cores: int) -> list[Row]:
    queue = EventQueue()
    pool = CorePool(queue, cores)

    def submit(frame: int, number: int) -> None:
        stages = chains[frame][1]
        if number < len(stages):
            claimed, cost = stages[number]
            then = lambda _: submit(frame, number + 1)  # noqa: E731
            pool.submit(Job(frame, str(number), number, claimed, lambda: (None, cost), then))

    for frame, (arrival, _) in enumerate(chains):
        queue.schedule(arrival, Priority.ARRIVAL, lambda frame=frame: submit(frame, 0))
    queue.run()
    return [(s.frame, int(s.stage), s.cores, s.ready_ns, s.start_ns, s.end_ns) for s in pool.spans]


class SimpyRobot:
    """A dispatcher process over a store of cores; it wakes once per instant, after everything else of the instant."""

    def __init__(self, chains: Chains, cores: int) -> None:
        self.env = simpy.Environment()
        self.cores = simpy.PriorityStore(self.env)
        self.cores.items = list(range(cores))
        self.waiting: list[tuple[int, int, int, simpy.Event]] = []
        self.bell = self.env.event()
        self.rows: list[Row] = []
        self.env.process(self.dispatcher())
        for frame, (arrival, stages) in enumerate(chains):
            self.env.process(self.frame(frame, arrival, stages))
        self.env.run()

    def frame(self, number: int, arrival: int, stages: list[Stage]) -> Generator[simpy.Event, Any, None]:
        yield self.env.timeout(arrival)
        for order, (claimed, cost) in enumerate(stages):
            ready, granted = int(self.env.now), self.env.event()
            self.waiting.append((number, order, claimed, granted))
            self.ring()
            held = yield granted
            start = int(self.env.now)
            yield self.env.timeout(cost)
            self.rows.append((number, order, held, ready, start, int(self.env.now)))
            for core in held:
                self.cores.put(core)
            self.ring()

    def ring(self) -> None:
        if not self.bell.triggered:
            self.bell.succeed()

    def dispatcher(self) -> Generator[simpy.Event, Any, None]:
        while True:
            yield self.bell
            settled = self.env.event()
            settled._ok, settled._value = True, None
            self.env.schedule(settled, priority=99)  # type: ignore[arg-type]
            yield settled
            self.bell = self.env.event()
            for request in sorted(self.waiting, key=lambda r: r[:2]):
                _, _, claimed, granted = request
                if claimed > len(self.cores.items):
                    break
                held = yield self.env.all_of([self.cores.get() for _ in range(claimed)])
                self.waiting.remove(request)
                granted.succeed(tuple(held.values()))


def test_thousands_of_random_job_sets_are_scheduled_as_simpy_does() -> None:
    shapes: dict[int, int] = defaultdict(int)
    for case in range(3000):
        rng = generator(0, "simpy", case)
        cores = 2 if case % 3 else int(rng.integers(1, 5))
        chains = random_chains(rng, cores)
        ours, theirs = by_stsem(chains, cores), SimpyRobot(chains, cores).rows
        assert sorted(ours) == sorted(theirs), f"case {case}: {cores} cores, {chains}"
        shapes[sum(start > ready for _, _, _, ready, start, _ in ours)] += 1
    assert sum(n for waits, n in shapes.items() if waits > 2) > 1000, "the cases must make jobs wait"
