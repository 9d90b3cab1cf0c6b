"""Simulated time: a queue of actions in one total order.

An action is due at `(time_ns, priority, sequence)`. `sequence` counts the calls of `schedule`, so the order is total
and no comparison ever reaches the actions. Nothing here asks the host what time it is.
"""

from collections.abc import Callable
from enum import IntEnum
from heapq import heappop, heappush

Action = Callable[[], None]


class Priority(IntEnum):
    """Order of the events of one instant (DESIGN 3).

    FINISH comes before ARRIVAL: a frame that arrives when a job ends finds its result. OTHER is for whatever looks at
    the state those two leave behind. START is the core pool's: jobs start only when everything else of the instant has
    happened, so "oldest frame first" holds among all jobs that became ready at it, whatever the order of their events.
    """

    FINISH = 0
    ARRIVAL = 1
    OTHER = 2
    START = 3


class EventQueue:
    """The simulated clock.

    Args:
        start_ns: where it stands before the first event.
    """

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns
        self._heap: list[tuple[int, int, int, Action]] = []
        self._sequence = 0

    @property
    def now_ns(self) -> int:
        """Simulated time; it only ever grows."""
        return self._now_ns

    def __len__(self) -> int:
        return len(self._heap)

    def schedule(self, time_ns: int, priority: Priority, action: Action) -> None:
        """Have `action` called at `time_ns`; an event due now is allowed, also from within an event of this instant.

        Raises:
            ValueError: `time_ns` lies in the past.
            TypeError: `time_ns` is not an int (numpy integers wrap around, floats lose nanoseconds).
        """
        if type(time_ns) is not int:
            raise TypeError(f"simulated times are ints, but {time_ns!r} came")
        if time_ns < self._now_ns:
            raise ValueError(f"an event at {time_ns} ns was scheduled at {self._now_ns} ns: the past cannot be changed")
        heappush(self._heap, (time_ns, priority, self._sequence, action))
        self._sequence += 1

    def step(self) -> bool:
        """Advance to the next event and do it; False when there is none."""
        if not self._heap:
            return False
        self._now_ns, _, _, action = heappop(self._heap)
        action()
        return True

    def run(self) -> None:
        """Do every event, also those that events schedule."""
        while self.step():
            pass

    def run_until(self, end_ns: int) -> None:
        """Do every event due at or before `end_ns`, then stand at `end_ns`.

        Raises:
            ValueError: `end_ns` lies in the past.
        """
        if end_ns < self._now_ns:
            raise ValueError(f"cannot run until {end_ns} ns: it is {self._now_ns} ns already")
        while self._heap and self._heap[0][0] <= end_ns:
            self.step()
        self._now_ns = end_ns
