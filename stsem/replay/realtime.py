"""One mode on the simulated clock: frames arrive, wait, are taken, answered, or end otherwise (DESIGN 3)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from stsem.classes import Labels
from stsem.frame import Frame, Segmentation
from stsem.log.log import Loaded
from stsem.replay.answer import AnswerRule, with_answer
from stsem.replay.queues import Mailbox
from stsem.replay.schedule import Slot, watermarks
from stsem.replay.tracking import Decoding, TrackWorker, posed
from stsem.replay.waiting import WaitingRoom
from stsem.result import STAGES, FrameResult, Outcome, Span
from stsem.sim.cores import CorePool, Job
from stsem.sim.costs import CostSource
from stsem.sim.events import EventQueue, Priority
from stsem.stages.fuse import Fuser
from stsem.stages.propagation.method import Predicted
from stsem.stages.register import Registration
from stsem.stages.track import Tracker, Tracking

T = TypeVar("T")

ORDER = {stage: place for place, stage in enumerate(STAGES)}
"""Place of each stage in the pipeline: among jobs of one frame the smaller goes first."""


@dataclass(frozen=True, eq=False)
class NewestAnswer:
    """The finished answer with the newest stamp.

    Args:
        stamp_ns: simulated capture stamp of its frame.
        labels: (H, W) uint8.
    """

    stamp_ns: int
    labels: Labels


class Judge(Protocol):
    """Who watches a run: told every arrival and every end, in simulated order."""

    def arrived(self, slot: Slot, loaded: Loaded, newest: NewestAnswer | None) -> None:
        """A frame arrives, or would have; `newest` is what a robot would act on at this instant."""

    def ended(self, result: FrameResult, loaded: Loaded) -> None:
        """A frame has got its outcome; `loaded` still holds its image and truth."""


@dataclass(eq=False)
class _Task:
    """A frame between taken and answered."""

    slot: Slot
    loaded: Loaded
    frame: Frame
    taken_ns: int
    registration: Registration | None = None
    reason: str = ""


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
        self._slots, self._rule, self._machine, self._judge = slots, rule, machine, judge
        self._marks = watermarks(slots)
        self._queue = EventQueue(min((slot.arrival_ns for slot in slots), default=0))
        self._pool = CorePool(self._queue, machine.cores)
        self._pushed = 0
        self._state = _State(WaitingRoom(machine.reload))
        self._decoding = Decoding(self._decode if machine.count_decode else None)
        first = min((slot.index for slot in slots), default=0)
        self._track = None if machine.tracker is None else TrackWorker(machine.tracker, first, self._start_tracking)

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
        state = self._state
        if state.task is not None:
            self._end(state.task.slot, state.task.loaded, Outcome.PENDING, taken_ns=state.task.taken_ns)
            state.task = None
        while (index := self._machine.mailbox.take()) is not None:
            self._end(self._slot(index), state.waiting.pop(index), Outcome.PENDING)

    def _slot(self, index: int) -> Slot:
        return self._slots[index - self._slots[0].index]

    def _arrive(self, slot: Slot, loaded: Loaded) -> None:
        self._judge.arrived(slot, loaded, self._state.newest)
        if self._track is not None:
            self._track.arrive(slot.index, None if slot.missing else loaded.frame)
        if loaded.frame is None:
            self._end(slot, loaded, Outcome.UNDECODABLE, reason="" if loaded.error is None else loaded.error.reason)
        elif slot.missing:
            self._end(slot, loaded, Outcome.INCOMPLETE, reason=f"no {' and no '.join(slot.missing)}")
        else:
            self._enqueue(slot, loaded)

    def _enqueue(self, slot: Slot, loaded: Loaded) -> None:
        self._state.waiting.put(loaded)
        dropped = self._machine.mailbox.put(slot.index)
        if dropped is not None:
            self._end(self._slot(dropped), self._state.waiting.pop(dropped), Outcome.DROPPED_BUSY)
        self._take()

    def _take(self) -> None:
        if self._state.task is not None or (index := self._machine.mailbox.take()) is None:
            return
        loaded = self._state.waiting.pop(index)
        if loaded.frame is None:
            raise ValueError(f"frame {index} has no image and cannot be taken")
        task = _Task(self._slot(index), loaded, loaded.frame, self._queue.now_ns)
        self._state.task = task
        self._decoding.before(task.frame, lambda: self._locate(task))

    def _locate(self, task: _Task) -> None:
        def go_on(tracking: Tracking) -> None:
            task.frame = posed(task.frame, tracking)
            self._register(task)

        if self._track is not None and self._machine.pose_on_path:
            self._track.after(task.slot.index, go_on)
        else:
            self._register(task)

    def _register(self, task: _Task) -> None:
        def choose(registration: Registration | None) -> None:
            task.registration = registration
            self._choose(task)

        if self._rule.registers:
            self._submit(task.frame, "register", 1, lambda: self._rule.register(task.frame), choose)
        else:
            choose(None)

    def _choose(self, task: _Task) -> None:
        reason = self._rule.choose(task.frame, task.registration)
        if reason is not None:
            task.reason = reason
            cores = self._machine.network_cores
            segment = self._rule.segment
            self._submit(
                task.frame, "segment", cores, lambda: segment(task.frame),
                lambda answer: self._segmented(task, answer),
            )  # fmt: skip
        elif self._rule.source is None:
            self._answer(task, Outcome.NO_SOURCE, None, None)
        else:
            propagate = self._rule.propagate
            self._submit(
                task.frame, "propagate", 1, lambda: propagate(task.frame, task.registration),
                lambda found: self._predicted(task, found),
            )  # fmt: skip

    def _predicted(self, task: _Task, found: Predicted | None) -> None:
        if found is None:
            self._answer(task, Outcome.NO_SOURCE, None, None)
        else:
            task.reason = found.remark
            self._answer(task, Outcome.PROPAGATED, found.answer, found.keyframe)

    def _segmented(self, task: _Task, answer: Segmentation | None) -> None:
        if answer is None:
            task.reason = "no truth for the oracle"
            self._answer(task, Outcome.NO_SOURCE, None, None)
            return
        self._rule.finish(task.frame, answer)
        if self._track is None:
            self._fuse(task.frame, answer)
        else:
            self._track.after(task.slot.index, lambda tracking: self._fuse(posed(task.frame, tracking), answer))
        self._answer(task, Outcome.SEGMENTED, answer, task.slot.index)

    def _fuse(self, frame: Frame, answer: Segmentation) -> None:
        fuse = self._machine.fuse
        if fuse is not None and fuse.can_fuse(frame):
            self._submit(frame, "fuse", 1, lambda: fuse(frame, answer), lambda _: None)

    def _decode(self, frame: Frame, then: Callable[[], None]) -> None:
        self._submit(frame, "decode", 1, lambda: None, lambda _: then())

    def _start_tracking(self, frame: Frame, work: Callable[[], Tracking], then: Callable[[Tracking], None]) -> None:
        self._decoding.before(frame, lambda: self._submit(frame, "track", 1, work, then))

    def _answer(self, task: _Task, outcome: Outcome, answer: Segmentation | None, source: int | None) -> None:
        self._state.task = None
        newest = self._state.newest
        if answer is not None and (newest is None or task.slot.stamp_ns >= newest.stamp_ns):
            self._state.newest = NewestAnswer(task.slot.stamp_ns, answer.labels)
        self._end(
            task.slot, task.loaded, outcome, taken_ns=task.taken_ns, answered_ns=self._queue.now_ns, answer=answer,
            keyframe=source, reason=task.reason,
        )  # fmt: skip
        self._take()

    def _end(
        self, slot: Slot, loaded: Loaded, outcome: Outcome, *, taken_ns: int | None = None,
        answered_ns: int | None = None, answer: Segmentation | None = None, keyframe: int | None = None,
        reason: str = "",
    ) -> None:  # fmt: skip
        result = FrameResult(
            index=slot.index, stamp_ns=slot.stamp_ns, arrival_ns=slot.arrival_ns, taken_ns=taken_ns,
            answered_ns=answered_ns if outcome.is_answer else None, outcome=outcome, keyframe=keyframe, reason=reason,
        )  # fmt: skip
        self._judge.ended(with_answer(result, answer), loaded)

    def _submit(
        self, frame: Frame, stage: str, cores: int, work: Callable[[], T], on_finish: Callable[[T], None]
    ) -> None:
        costs = self._machine.costs
        self._pool.submit(
            Job(
                frame.index,
                stage,
                ORDER[stage],
                cores,
                lambda: costs.run(frame.stamp_ns, stage, cores, work),
                on_finish,
            )
        )
