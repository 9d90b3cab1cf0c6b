"""`track` beside the answer path: every frame that arrives, one at a time, in log order (DESIGN 3)."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from stsem.frame import Frame
from stsem.pose import Trajectory
from stsem.stages.track import Tracker, Tracking

Then = Callable[[Tracking], None]
StartTracking = Callable[[Frame, Callable[[], Tracking], Then], None]
"""(frame, work, then): makes the job that tracks a frame, and whatever must come before it."""


def posed(frame: Frame, tracking: Tracking) -> Frame:
    """The frame with the pose that predictions go by; without one when lost."""
    return replace(frame, T_WC=tracking.T_OC)


class KnownPoses:
    """A recorded trajectory in the place of a tracker: what a run would be like with these poses.

    Args:
        trajectory: of the camera, at the stamps of the frames.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self._found: dict[int, Tracking] = {}

    def prepare(self, frame: Frame) -> Callable[[], Tracking]:
        """See `Tracker.prepare`."""
        known = self._trajectory.at(frame.stamp_ns, 0)
        T_WC = None if known is None else known.T_WC
        found = self._found[frame.index] = Tracking(T_WC, T_WC, None)
        return lambda: found

    def of(self, index: int) -> Tracking | None:
        """See `Tracker.of`."""
        return self._found.get(index)


class TrackWorker:
    """Tracks one frame at a time; frames that arrive meanwhile wait, and none is dropped.

    A frame is tracked after all earlier ones of the log, whatever the order in which they arrive, so that every run
    gives SLAM the same frames in the same order. One without an image is passed over.

    Args:
        tracker: what tracks.
        first: log index of the first frame.
        start: makes a job.
    """

    def __init__(self, tracker: Tracker, first: int, start: StartTracking) -> None:
        self._tracker, self._next, self._start = tracker, first, start
        self._works: dict[int, Callable[[], Tracking]] = {}
        self._arrived: dict[int, Frame | None] = {}
        self._done: dict[int, Tracking] = {}
        self._waiting: defaultdict[int, list[Then]] = defaultdict(list)
        self._busy = False

    def prepare(self, frame: Frame) -> None:
        """A frame that will arrive; call in log order, for those that have an image."""
        self._works[frame.index] = self._tracker.prepare(frame)

    def arrive(self, index: int, frame: Frame | None) -> None:
        """A frame arrives; None when it has no image or lacks what it needs."""
        self._arrived[index] = None if frame is None else _without_pixels(frame)
        self._work()

    def after(self, index: int, then: Then) -> None:
        """Call `then` when the frame has been tracked: now, if it has."""
        if index in self._done:
            then(self._done[index])
        else:
            self._waiting[index].append(then)

    def _work(self) -> None:
        while not self._busy and self._next in self._arrived:
            index, self._next = self._next, self._next + 1
            frame, work = self._arrived.pop(index), self._works.pop(index, None)
            if frame is not None and work is not None:
                self._busy = True
                self._start(frame, work, partial(self._finished, index))

    def _finished(self, index: int, tracking: Tracking) -> None:
        self._busy = False
        self._done[index] = tracking
        for then in self._waiting.pop(index, ()):
            then(tracking)
        self._work()


class Decoding:
    """Decoding as a job (`--count-decode`), once for each frame, whoever needs it first.

    Args:
        start: makes the job for a frame and calls back when it is done; None where decoding is not counted.
    """

    def __init__(self, start: Callable[[Frame, Callable[[], None]], None] | None) -> None:
        self._start = start
        self._done: set[int] = set()
        self._waiting: dict[int, list[Callable[[], None]]] = {}

    def before(self, frame: Frame, then: Callable[[], None]) -> None:
        """Call `then` when the frame has been decoded: now, if it has, or where decoding takes no time."""
        index = frame.index
        if self._start is None or index in self._done:
            then()
        elif index in self._waiting:
            self._waiting[index].append(then)
        else:
            self._waiting[index] = [then]
            self._start(frame, lambda: self._finished(index))

    def _finished(self, index: int) -> None:
        self._done.add(index)
        for then in self._waiting.pop(index):
            then()


def _without_pixels(frame: Frame) -> Frame:
    """What a job is named and drawn by: index and stamp; frames that wait must not hold memory."""
    return replace(frame, image=frame.image[:0].copy(), previous=None, depth=None)
