"""The runs of one mode, with a clock and without, fed with the same frames."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from stsem.log.log import Loaded
from stsem.mapping.cloud import LabelledCloud
from stsem.replay.answer import AnswerRule
from stsem.replay.build import Model, build_rule
from stsem.replay.config import RunConfig
from stsem.replay.hosttimes import StageTimes, TimedFuse
from stsem.replay.modes import Mode
from stsem.replay.offline import OfflineRun
from stsem.replay.queues import Mailbox, parse_queue
from stsem.replay.realtime import Machine, RealTimeRun
from stsem.replay.record import Record, Watch, scorecard_for
from stsem.replay.schedule import Slot
from stsem.result import Span
from stsem.sim.costs import CostSource
from stsem.stages.fuse import Fuse, Fuser
from stsem.stages.segment import Segmenter

CostsOf = Callable[[Mode], CostSource]
"""Cost source of a mode."""


@dataclass(eq=False)
class ModeRun:
    """One mode over one log: with a clock, without, or both.

    Args:
        mode: which.
        cloud: the labelled points; None without a map.
        real_time, offline: what was kept of the two passes; None if one did not run.
        rule: of the real-time pass, or of the offline one if there is no other.
        spans: jobs of the real-time run.
    """

    mode: Mode
    cloud: LabelledCloud | None = None
    real_time: Record | None = None
    offline: Record | None = None
    rule: AnswerRule | None = None
    spans: Sequence[Span] = ()

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
        self._run = ModeRun(mode, cloud=LabelledCloud() if setup.fused else None)
        self._clocked = None if setup.costs_of is None else self._with_clock(setup.costs_of(mode), watch)
        without = config.clock == "offline" or (config.offline and not setup.model.reason)
        self._plain = self._without_clock(watch) if without else None

    def push(self, loaded: Loaded) -> None:
        """The next frame of the log."""
        if self._clocked is not None:
            self._clocked.push(loaded)
        if self._plain is not None:
            self._plain.push(loaded)

    def finish(self, horizon_ns: int) -> ModeRun:
        """End the clock at `horizon_ns`; returns what came of it, results by log index."""
        run = self._run
        if self._clocked is not None:
            self._clocked.finish(horizon_ns)
            run.spans = self._clocked.spans
        for record in (run.real_time, run.offline):
            if record is not None:
                record.results.sort(key=lambda result: result.index)
        return run

    def _with_clock(self, costs: CostSource, watch: Watch | None) -> RealTimeRun:
        setup, run, config = self._setup, self._run, self._setup.config
        run.rule, run.real_time = self._rule(), self._record(primary=True, watch=watch)
        capacity, newest_wins = parse_queue(config.queue)
        machine = Machine(
            cores=config.cores, network_cores=min(run.mode.network_cores, config.cores), costs=costs,
            mailbox=Mailbox(capacity, newest_wins), fuse=self._fuse(), count_decode=config.count_decode,
            reload=setup.reload,
        )  # fmt: skip
        return RealTimeRun(setup.slots, run.rule, machine, run.real_time)

    def _without_clock(self, watch: Watch | None) -> OfflineRun:
        setup, run = self._setup, self._run
        primary, rule = run.real_time is None, self._rule()
        run.offline, run.rule = self._record(primary=primary, watch=watch), run.rule or rule
        only_truth = run.mode.segments_every_frame and not primary
        fuse = self._fuse() if primary else None
        return OfflineRun(setup.slots, rule, run.offline, fuse=fuse, only_truth=only_truth)

    def _rule(self) -> AnswerRule:
        setup = self._setup
        return build_rule(self._run.mode, setup.segmenter, setup.config, setup.times)

    def _fuse(self) -> Fuser | None:
        return None if self._run.cloud is None else TimedFuse(Fuse(self._run.cloud), self._setup.times)

    def _record(self, *, primary: bool, watch: Watch | None) -> Record:
        setup, model = self._setup, self._setup.model
        scores = None if model.reason else scorecard_for(model.classes, model.translation)
        classes = model.classes if primary else None
        return Record(setup.slots, scores, setup.pictured, classes, watch if primary else None)
