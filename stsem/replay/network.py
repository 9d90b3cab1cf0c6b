"""The network at work: on the answer path, or in the background behind a mailbox of one (DESIGN 3)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from stsem.frame import Frame, Segmentation
from stsem.replay.answer import AnswerRule
from stsem.replay.jobs import Jobs
from stsem.replay.tracking import TrackWorker, posed
from stsem.stages.fuse import Fuser

Then = Callable[[Segmentation | None], None]


@dataclass(frozen=True, eq=False)
class NetworkJobs:
    """Segments chosen frames: each becomes a keyframe to predict from, and goes into the map.

    Args:
        jobs: makes the jobs.
        rule: does the work.
        cores: that the network claims.
        fuse: the map; None without one.
        track: finds the poses that the map takes; None where frames come with theirs.
    """

    jobs: Jobs
    rule: AnswerRule
    cores: int
    fuse: Fuser | None
    track: TrackWorker | None

    def segment(self, frame: Frame, then: Then) -> None:
        """Segment `frame`; `then` is told when it is a keyframe, or with None when it cannot be segmented."""

        def finished(answer: Segmentation | None) -> None:
            if answer is not None:
                self.rule.finish(frame, answer)
                self._into_the_map(frame, answer)
            then(answer)

        self.jobs.submit(frame, "segment", self.cores, lambda: self.rule.segment(frame), finished)

    def _into_the_map(self, frame: Frame, answer: Segmentation) -> None:
        if self.track is None:
            self._fuse(frame, answer)
        else:
            self.track.after(frame.index, lambda tracking: self._fuse(posed(frame, tracking), answer))

    def _fuse(self, frame: Frame, answer: Segmentation) -> None:
        fuse = self.fuse
        if fuse is not None and fuse.can_fuse(frame):
            self.jobs.submit(frame, "fuse", 1, lambda: fuse(frame, answer), lambda _: None)


class Background:
    """Segments chosen frames beside the answer path, one at a time; at most two images are held.

    A frame that is chosen while the network is busy waits in a mailbox of one; a newer one takes its place there, and
    the older will never be a keyframe.

    Args:
        segment: starts the network on a frame and tells when it has finished.
        abandon: told of a frame that lost its place.
    """

    def __init__(self, segment: Callable[[Frame, Then], None], abandon: Callable[[Frame], None]) -> None:
        self._segment, self._abandon = segment, abandon
        self._running: Frame | None = None
        self._waiting: Frame | None = None
        self.chosen: dict[int, str] = {}
        """Log index of every frame that was chosen -> why, in order."""
        self.finished: list[int] = []
        """Those that became keyframes, in order."""
        self.replaced: list[int] = []
        """Those that lost their place before the network to a newer one."""

    @property
    def unfinished(self) -> tuple[int, ...]:
        """Those that the network works on, or that wait for it."""
        return tuple(frame.index for frame in (self._running, self._waiting) if frame is not None)

    def hand(self, frame: Frame, reason: str) -> None:
        """The frame was chosen for `reason`, and goes to the network, or into its mailbox."""
        self.chosen[frame.index] = reason
        if self._running is None:
            self._start(frame)
            return
        if self._waiting is not None:
            self.replaced.append(self._waiting.index)
            self._abandon(self._waiting)
        self._waiting = frame

    def _start(self, frame: Frame) -> None:
        self._running = frame
        self._segment(frame, partial(self._finished, frame.index))

    def _finished(self, index: int, answer: Segmentation | None) -> None:
        if answer is None:
            raise ValueError(f"frame {index} was chosen as a keyframe, but cannot be segmented")
        self.finished.append(index)
        self._running, following, self._waiting = None, self._waiting, None
        if following is not None:
            self._start(following)
