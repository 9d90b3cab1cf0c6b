"""One mode on the simulated clock: frames arrive, wait, are taken, answered, or end otherwise (DESIGN 3)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from stsem.frame import Frame
from stsem.log.log import Loaded
from stsem.replay.answer import AnswerRule
from stsem.replay.ending import Ending, unusable
from stsem.replay.jobs import Jobs
from stsem.replay.judging import Judge, NewestAnswer
from stsem.replay.network import Background, NetworkJobs
from stsem.replay.path import AnswerPath
from stsem.replay.queues import Mailbox
from stsem.replay.schedule import Slot, watermarks
from stsem.replay.tracking import Decoding, TrackWorker
from stsem.replay.waiting import WaitingRoom
from stsem.result import Outcome, Span
from stsem.sim.cores import CorePool
from stsem.sim.costs import CostSource
from stsem.sim.events import EventQueue, Priority
from stsem.stages.fuse import Fuser
from stsem.stages.track import Tracker, Tracking


@dataclass(frozen=True, eq=False)
class Machine:
    """What a run needs besides its rule.

    Args:
        cores: simulated cores.
        network_cores: cores the network claims.
        costs: how long jobs last.
        mailbox: the queue rule.
        fuse: the map beside the path; None without one.
        count_decode: whether decoding is a job on the path (`--count-decode`); the work itself is done before.
        reload: loads a frame again that had to wait long; None keeps every waiting frame in memory.
        tracker: finds the poses; None where the log gives them.
        pose_on_path: whether an answer needs the pose that `tracker` finds, so that `track` lies on the path.
        in_background: whether keyframes are segmented beside the path, and answered by prediction.
    """

    cores: int
    network_cores: int
    costs: CostSource
    mailbox: Mailbox
    fuse: Fuser | None = None
    count_decode: bool = False
    reload: Callable[[int], Loaded] | None = None
    tracker: Tracker | None = None
    pose_on_path: bool = False
    in_background: bool = False


@dataclass(frozen=True, eq=False)
class _Task:
    """A frame between taken and answered."""

    slot: Slot
    loaded: Loaded
    taken_ns: int


@dataclass(eq=False)
class _State:
    waiting: WaitingRoom
    task: _Task | None = None
    newest: NewestAnswer | None = None


class RealTimeRun:
    """The state machine of one mode.

    Push the frames of the log in log order; each call advances the clock as far as the frames pushed so far determine
    it. At most one frame is between taken and answered; the next one is taken from the mailbox at that instant.

    Args:
        slots: every frame of the log, in log order.
        rule: how the mode answers.
        machine: cores, costs, queue.
        judge: told of arrivals and ends.
    """

    def __init__(self, slots: Sequence[Slot], rule: AnswerRule, machine: Machine, judge: Judge) -> None:
        self._slots, self._mailbox, self._judge = slots, machine.mailbox, judge
        self._marks = watermarks(slots)
        self._queue = EventQueue(min((slot.arrival_ns for slot in slots), default=0))
        self._pool = CorePool(self._queue, machine.cores)
        self._jobs = Jobs(self._pool, machine.costs)
        self._pushed = 0
        self._state = _State(WaitingRoom(machine.reload))
        self._decoding = Decoding(self._decode if machine.count_decode else None)
        first = min((slot.index for slot in slots), default=0)
        self._track = None if machine.tracker is None else TrackWorker(machine.tracker, first, self._start_tracking)
        network = NetworkJobs(self._jobs, rule, machine.network_cores, machine.fuse, self._track)
        self.background = Background(network.segment, rule.abandon) if machine.in_background else None
        """Keyframes beside the path; None in a mode whose answers wait for the network."""
        on_path = self._track if machine.pose_on_path else None
        self._path = AnswerPath(self._jobs, rule, self._decoding, on_path, network, self.background)

    @property
    def spans(self) -> Sequence[Span]:
        """Every job, in order of start."""
        return self._pool.spans

    def push(self, loaded: Loaded) -> None:
        """The next frame of the log."""
        slot, mark = self._slots[self._pushed], self._marks[self._pushed]
        self._pushed += 1
        if self._track is not None and loaded.frame is not None and not slot.missing:
            self._track.prepare(loaded.frame)
        self._queue.schedule(slot.arrival_ns, Priority.ARRIVAL, lambda: self._arrive(slot, loaded))
        if mark - 1 > self._queue.now_ns:
            self._queue.run_until(mark - 1)

    def finish(self, horizon_ns: int) -> None:
        """Let the clock run to `horizon_ns`; whatever is unfinished then is pending."""
        self._queue.run_until(max(horizon_ns, self._queue.now_ns))
        state, pending = self._state, Ending(Outcome.PENDING)
        if state.task is not None:
            self._end(state.task.slot, state.task.loaded, pending, taken_ns=state.task.taken_ns)
            state.task = None
        while (index := self._mailbox.take()) is not None:
            self._end(self._slot(index), state.waiting.pop(index), pending)

    def _slot(self, index: int) -> Slot:
        return self._slots[index - self._slots[0].index]

    def _arrive(self, slot: Slot, loaded: Loaded) -> None:
        self._judge.arrived(slot, loaded, self._state.newest)
        if self._track is not None:
            self._track.arrive(slot.index, None if slot.missing else loaded.frame)
        ending = unusable(slot, loaded)
        if ending is None:
            self._enqueue(slot, loaded)
        else:
            self._end(slot, loaded, ending)

    def _enqueue(self, slot: Slot, loaded: Loaded) -> None:
        self._state.waiting.put(loaded)
        dropped = self._mailbox.put(slot.index)
        if dropped is not None:
            self._end(self._slot(dropped), self._state.waiting.pop(dropped), Ending(Outcome.DROPPED_BUSY))
        self._take()

    def _take(self) -> None:
        if self._state.task is not None or (index := self._mailbox.take()) is None:
            return
        loaded = self._state.waiting.pop(index)
        if loaded.frame is None:
            raise ValueError(f"frame {index} has no image and cannot be taken")
        task = _Task(self._slot(index), loaded, self._queue.now_ns)
        self._state.task = task
        self._path.answer(loaded.frame, lambda ending: self._answered(task, ending))

    def _answered(self, task: _Task, ending: Ending) -> None:
        state, answer = self._state, ending.answer
        state.task = None
        if answer is not None and (state.newest is None or task.slot.stamp_ns >= state.newest.stamp_ns):
            state.newest = NewestAnswer(task.slot.stamp_ns, answer.labels)
        self._end(task.slot, task.loaded, ending, taken_ns=task.taken_ns)
        self._take()

    def _end(self, slot: Slot, loaded: Loaded, ending: Ending, *, taken_ns: int | None = None) -> None:
        now_ns = self._queue.now_ns
        result = ending.result(slot, arrival_ns=slot.arrival_ns, taken_ns=taken_ns, ended_ns=now_ns)
        self._judge.ended(result, loaded)

    def _decode(self, frame: Frame, then: Callable[[], None]) -> None:
        self._jobs.submit(frame, "decode", 1, lambda: None, lambda _: then())

    def _start_tracking(self, frame: Frame, work: Callable[[], Tracking], then: Callable[[Tracking], None]) -> None:
        self._decoding.before(frame, lambda: self._jobs.submit(frame, "track", 1, work, then))
