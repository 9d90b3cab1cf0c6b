"""The runs of one mode, with a clock and without, fed with the same frames."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from stsem.frame import Frame
from stsem.log.log import Loaded
from stsem.mapping.anchored import AnchoredCloud
from stsem.mapping.cloud import LabelledCloud
from stsem.pose import Trajectory
from stsem.replay.answer import AnswerRule
from stsem.replay.build import Model, build_rule
from stsem.replay.config import RunConfig
from stsem.replay.hosttimes import StageTimes, TimedFuse
from stsem.replay.modes import Mode
from stsem.replay.network import Background
from stsem.replay.offline import OfflineRun
from stsem.replay.queues import Mailbox, parse_queue
from stsem.replay.realtime import Machine, RealTimeRun
from stsem.replay.record import Record, Watch, scorecard_for
from stsem.replay.schedule import Slot
from stsem.replay.tracking import KnownPoses
from stsem.result import FrameResult, Outcome, Span
from stsem.sim.costs import CostSource
from stsem.stages.fuse import AnchoredFuse, Fuse, Fuser
from stsem.stages.propagate import PROPAGATIONS
from stsem.stages.segment import Segmenter
from stsem.stages.track import SlamTracker, Tracker

CostsOf = Callable[[Mode], CostSource]
"""Cost source of a mode."""


@dataclass(eq=False)
class ModeRun:
    """One mode over one log: with a clock, without, or both.

    Args:
        mode: which.
        cloud: the labelled points; None without a map.
        tracker: what found the poses; None where the log gives them, or nothing does.
        pose_on_path: whether its answers need what the tracker finds.
        real_time, offline: what was kept of the two passes; None if one did not run.
        by_log: of an offline pass with the log's poses, where those of SLAM were used and predictions depend on them.
        rule: of the real-time pass, or of the offline one if there is no other.
        spans: jobs of the real-time run.
        background: what was segmented beside its answers; None where answers wait for the network.
    """

    mode: Mode
    cloud: LabelledCloud | None = None
    tracker: SlamTracker | None = None
    pose_on_path: bool = False
    real_time: Record | None = None
    offline: Record | None = None
    by_log: Record | None = None
    rule: AnswerRule | None = None
    spans: Sequence[Span] = ()
    background: Background | None = None

    @property
    def keyframes(self) -> dict[int, str]:
        """Log index of each frame of `record` that the network has labelled -> why it was chosen, by index."""
        if self.background is not None:
            return {index: self.background.chosen[index] for index in sorted(self.background.finished)}
        return {r.index: r.reason for r in self.record.results if r.outcome is Outcome.SEGMENTED}

    @property
    def record(self) -> Record:
        """Of the real-time pass, or of the offline one if there is no other."""
        found = self.real_time or self.offline
        if found is None:
            raise ValueError(f"{self.mode.name} ran neither with a clock nor without")
        return found


@dataclass(frozen=True, eq=False)
class Setup:
    """What the lanes of one replay share.

    Args:
        config: what to do.
        model: what segments, and in which classes.
        segmenter: shared: it computes each frame once.
        costs_of: where durations come from; None without a clock.
        slots: every frame on the simulated clock.
        pictured: log indices whose answers are kept for pictures.
        fused: whether a map is built.
        times: where wall-clock durations go.
        reload: loads a frame of the log again.
        log_poses: the log's own poses at the frames' stamps, to compare with where SLAM runs; None without any.
        trackers: makes what finds the poses, or hands out one that all share; None where nothing does.
    """

    config: RunConfig
    model: Model
    segmenter: Segmenter
    costs_of: CostsOf | None
    slots: Sequence[Slot]
    pictured: frozenset[int]
    fused: bool
    times: StageTimes = field(default_factory=StageTimes)
    reload: Callable[[int], Loaded] | None = None
    log_poses: Trajectory | None = None
    trackers: Callable[[], SlamTracker] | None = None


def needs_pose(mode: Mode, config: RunConfig, tracker: Tracker | None) -> bool:
    """Whether the answers of `mode` need the pose that `tracker` finds."""
    return tracker is not None and not mode.segments_every_frame and PROPAGATIONS[config.propagation].needs.space


class Lane:
    """One mode; push every frame of the log, then finish.

    Args:
        setup: shared by all lanes.
        mode: of this one.
        watch: called with every answered frame of the run that the report is about.
    """

    def __init__(self, setup: Setup, mode: Mode, watch: Watch | None) -> None:
        config = setup.config
        self._setup = setup
        tracker = self._tracker()
        self._run = ModeRun(mode, tracker=tracker, pose_on_path=needs_pose(mode, config, tracker))
        self._anchored: AnchoredCloud | None = None
        self._clocked = None if setup.costs_of is None else self._with_clock(setup.costs_of(mode), watch)
        without = config.clock == "offline" or (config.offline and not setup.model.reason)
        self._plain = self._without_clock(watch) if without else None
        self._by_log = self._with_poses_of_the_log() if without and self._run.pose_on_path else None

    def push(self, loaded: Loaded) -> None:
        """The next frame of the log."""
        if self._clocked is not None:
            self._clocked.push(loaded)
        for plain in (self._plain, self._by_log):
            if plain is not None:
                plain.push(loaded)

    def finish(self, horizon_ns: int) -> ModeRun:
        """End the clock at `horizon_ns`; returns what came of it, results by log index."""
        run = self._run
        if self._clocked is not None:
            self._clocked.finish(horizon_ns)
            run.spans = self._clocked.spans
        if self._anchored is not None and run.tracker is not None:
            run.cloud = self._anchored.cloud(run.tracker.keyframe_poses)
        for record in (run.real_time, run.offline):
            if record is not None:
                record.results.sort(key=lambda result: result.index)
        return run

    def _with_clock(self, costs: CostSource, watch: Watch | None) -> RealTimeRun:
        setup, run, config = self._setup, self._run, self._setup.config
        run.rule, run.real_time = self._rule(), self._record(primary=True, watch=watch)
        capacity, newest_wins = parse_queue(config.queue)
        machine = Machine(
            cores=config.cores, network_cores=run.mode.cores(config.cores, tracks=run.tracker is not None),
            costs=costs, mailbox=Mailbox(capacity, newest_wins), fuse=self._fuse(), count_decode=config.count_decode,
            reload=setup.reload, tracker=run.tracker, pose_on_path=run.pose_on_path,
            in_background=run.mode.in_background,
        )  # fmt: skip
        clocked = RealTimeRun(setup.slots, run.rule, machine, run.real_time)
        run.background = clocked.background
        return clocked

    def _without_clock(self, watch: Watch | None) -> OfflineRun:
        setup, run = self._setup, self._run
        primary, rule = run.real_time is None, self._rule()
        run.offline, run.rule = self._record(primary=primary, watch=watch), run.rule or rule
        only_truth = run.mode.segments_every_frame and not primary
        fuse = self._fuse() if primary else None
        tracker = run.tracker if primary else self._tracker()
        return OfflineRun(setup.slots, rule, run.offline, fuse=fuse, only_truth=only_truth, tracker=tracker)

    def _with_poses_of_the_log(self) -> OfflineRun | None:
        setup, run = self._setup, self._run
        if setup.log_poses is None or setup.model.reason:
            return None
        run.by_log = Record(setup.slots, scorecard_for(setup.model.classes, setup.model.translation), frozenset())
        poses = KnownPoses(setup.log_poses)
        return OfflineRun(setup.slots, self._rule(), run.by_log, fuse=None, only_truth=False, tracker=poses)

    def _rule(self) -> AnswerRule:
        setup = self._setup
        return build_rule(self._run.mode, setup.segmenter, setup.model.classes, setup.config, setup.times)

    def _fuse(self) -> Fuser | None:
        tracker, times = self._run.tracker, self._setup.times
        if not self._setup.fused:
            return None
        if tracker is None:
            self._run.cloud = LabelledCloud()
            return TimedFuse(Fuse(self._run.cloud), times)
        self._anchored = AnchoredCloud()
        return TimedFuse(AnchoredFuse(self._anchored, tracker.anchor), times)

    def _tracker(self) -> SlamTracker | None:
        return None if self._setup.trackers is None else self._setup.trackers()

    def _record(self, *, primary: bool, watch: Watch | None) -> Record:
        setup, model = self._setup, self._setup.model
        scores = None if model.reason else scorecard_for(model.classes, model.translation)
        classes = model.classes if primary else None
        return Record(setup.slots, scores, setup.pictured, classes, self._posed(watch) if primary else None)

    def _posed(self, watch: Watch | None) -> Watch | None:
        """`watch`, shown frames with the poses that were found."""
        tracker = self._run.tracker
        if watch is None or tracker is None:
            return watch

        def show(result: FrameResult, frame: Frame) -> None:
            tracking = tracker.of(frame.index)
            watch(result, frame if tracking is None else replace(frame, T_WC=tracking.T_WC))

        return show
