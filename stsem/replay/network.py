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
Free = Callable[[], None]
Segment = Callable[[Frame, Then, Free], None]


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

    def segment(self, frame: Frame, then: Then, free: Free = lambda: None) -> None:
        """Segment `frame`.

        Args:
            frame: what was chosen.
            then: told when it is a keyframe, or with None when it cannot be segmented.
            free: told when no more work is to come, in the map neither.
        """

        def finished(answer: Segmentation | None) -> None:
            if answer is not None:
                self.rule.finish(frame, answer)
            then(answer)
            if answer is None or self.fuse is None:
                free()
            else:
                self._into_the_map(self.fuse, frame, answer, free)

        self.jobs.submit(frame, "segment", self.cores, lambda: self.rule.segment(frame), finished)

    def _into_the_map(self, fuse: Fuser, frame: Frame, answer: Segmentation, free: Free) -> None:
        def go_on(found: Frame) -> None:
            if fuse.can_fuse(found):
                self.jobs.submit(found, "fuse", 1, lambda: fuse(found, answer), lambda _: free())
            else:
                free()

        if self.track is None:
            go_on(frame)
        else:
            self.track.after(frame.index, lambda tracking: go_on(posed(frame, tracking)))


class Background:
    """Segments chosen frames beside the answer path, one at a time; at most two images are held.

    A frame that is chosen meanwhile waits in a mailbox of one; a newer one takes its place there, and the older will
    never be a keyframe. The next one starts when the one before is in the map: so there is one job here at any time,
    and a second core is left to the answers.

    Args:
        segment: starts the network on a frame, and tells when it is a keyframe, and when all work for it is done.
        abandon: told of a frame that lost its place.
    """

    def __init__(self, segment: Segment, abandon: Callable[[Frame], None]) -> None:
        self._segment, self._abandon = segment, abandon
        self._busy = False
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
        if not self._busy:
            self._start(frame)
            return
        if self._waiting is not None:
            self.replaced.append(self._waiting.index)
            self._abandon(self._waiting)
        self._waiting = frame

    def _start(self, frame: Frame) -> None:
        self._busy, self._running = True, frame
        self._segment(frame, partial(self._finish, frame.index), self._follow)

    def _finish(self, index: int, answer: Segmentation | None) -> None:
        if answer is None:
            raise ValueError(f"frame {index} was chosen as a keyframe, but cannot be segmented")
        self.finished.append(index)
        self._running = None

    def _follow(self) -> None:
        following, self._busy, self._waiting = self._waiting, False, None
        if following is not None:
            self._start(following)
