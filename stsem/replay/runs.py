"""From what one mode did to its part of the report."""

from array import array
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from stsem.document.accuracy import Coverage, Loss, Score
from stsem.document.schema import MapScore, Run
from stsem.document.timing import Latency, Throughput
from stsem.log.log import Log
from stsem.log.plan import NEEDS
from stsem.metrics.latency import latency
from stsem.metrics.loss import split
from stsem.metrics.outcomes import count_outcomes
from stsem.metrics.scorecard import Accuracy
from stsem.metrics.throughput import throughput
from stsem.replay import accuracy, timing, trajectories
from stsem.replay.beside import background
from stsem.replay.build import Model
from stsem.replay.calibration import calibration, error_detection
from stsem.replay.config import RunConfig
from stsem.replay.costing import Costing
from stsem.replay.engine import Replayed
from stsem.replay.lanes import ModeRun
from stsem.replay.record import Record
from stsem.result import ANSWER_STAGES, Span

NO_CLOCK = "--clock offline"
NO_OFFLINE = "--no-offline"


@dataclass(frozen=True, eq=False)
class Context:
    """What every mode of one report shares.

    Args:
        log, config, model, costing, replayed: what was replayed, how, and what came of it.
        sustainable_hz: mode -> highest sustained rate, where it was searched for.
        notes: what a reader must know besides the log's own warnings.
    """

    log: Log
    config: RunConfig
    model: Model
    costing: Costing | None
    replayed: Replayed
    sustainable_hz: Mapping[str, float | None] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Found:
    """A mode with its scores computed."""

    run: ModeRun
    offline: Accuracy | None
    clocked: Accuracy | None


def scored(run: ModeRun) -> Found:
    """Compute the scores of both passes of a mode."""

    def of(record: Record | None) -> Accuracy | None:
        return None if record is None or record.scorecard is None else record.scorecard.compute()

    return Found(run, of(run.offline), of(run.real_time))


def without_scores(found: Found, reason: str) -> Found:
    """The same mode, but accuracy was not measured, and why."""

    def emptied(accuracy: Accuracy | None) -> Accuracy | None:
        return None if accuracy is None else Accuracy(None, None, None, {}, (), None, (), accuracy.reason or reason)

    return Found(found.run, emptied(found.offline), emptied(found.clocked))


def part(context: Context, found: Found, base: Found | None) -> Run:
    """One mode's part of the report.

    Args:
        context: of the report.
        found: the mode.
        base: `per-frame`, for the network's share of the loss; None if it did not run.
    """
    run, config = found.run, context.config
    record = run.record
    counts = count_outcomes((r.outcome for r in record.results), len(context.replayed.slots))
    late, fast, inside = _timing(context, run)
    posing = context.replayed.posing
    moved = trajectories.score(context.log, posing, run.tracker, _offline_by_poses(context, found))
    own = None if found.clocked is None else found.clocked.own
    streaming = None if found.clocked is None else found.clocked.streaming
    offline = None if found.offline is None else found.offline.own
    classes = context.model.classes
    measured = any(accuracies is not None and accuracies.measured for accuracies in (found.offline, found.clocked))
    return Run(
        mode=run.mode.name,
        clock=config.clock,
        frames=len(context.replayed.slots),
        outcomes=timing.outcomes({str(outcome): n for outcome, n in counts.items()}),
        keyframes=tuple(run.keyframes),
        keyframe_reasons=dict(sorted(Counter(run.keyframes.values()).items())),
        background=background(context.log, run, found.clocked),
        covered=_covered(record),
        remarks=dict(sorted(Counter(r.remark for r in record.results if r.remark).items())),
        keyframes_moved=0 if run.rule is None else run.rule.moved,
        stages_inside=inside,
        stages_disabled=_disabled(context, run),
        coverage=_coverage(context, found),
        offline=accuracy.score(offline, classes),
        delivered=accuracy.score(own, classes),
        streaming=accuracy.score(streaming, classes),
        loss=_loss(context, found, base),
        strata=accuracy.strata(found.offline, classes),
        by_distance=accuracy.distances(() if found.offline is None else found.offline.by_distance),
        consistency=accuracy.consistency(record.consistency),
        calibration=calibration(run) if measured else {},
        error_detection=error_detection(run) if measured else None,
        by_distance_summary=accuracy.distance_summary(
            None if found.offline is None else found.offline.distance_summary
        ),
        latency_ms=late,
        throughput=fast,
        trajectory=moved,
        map=None
        if run.cloud is None
        else MapScore(points=len(run.cloud), voxels=len(run.cloud), points_left_out=run.cloud.left_out),
        not_measured=_why_not(context, found) | trajectories.why_not(context.log, posing, moved),
    )


def _offline_by_poses(context: Context, found: Found) -> dict[str, Score | None]:
    """Source of poses -> the offline score with them; empty where predictions do not depend on poses."""
    record, offline = found.run.by_log, found.offline
    if record is None or record.scorecard is None or offline is None:
        return {}
    classes = context.model.classes
    return {
        "slam": accuracy.score(offline.own, classes), "log": accuracy.score(record.scorecard.compute().own, classes),
    }  # fmt: skip


def _covered(record: Record) -> float | None:
    """Mean share of the pixels of predicted answers that rest on evidence; None where nobody says."""
    shares = [r.covered_share for r in record.results if r.covered_share is not None]
    return sum(shares) / len(shares) if shares else None


def _timing(context: Context, run: ModeRun) -> tuple[Latency | None, Throughput | None, tuple[str, ...]]:
    if run.real_time is None:
        return None, None, ()
    config, results = context.config, run.real_time.results
    path = _path(run)
    late = latency(results, run.spans, distinct_samples=_distinct_samples(context, run), answer_stages=path)
    deadline = timing.deadline_ns(config.deadline_ms, context.log.period_ns, config.exact_rate)
    fast = throughput(
        results, run.spans, cores=config.cores, deadline_ns=deadline, rate=float(config.exact_rate)
    )  # fmt: skip
    return (
        timing.latency(late),
        timing.throughput(fast, deadline, context.sustainable_hz.get(run.mode.name)),
        timing.stages_inside(late.inside),
    )


def _path(run: ModeRun) -> tuple[str, ...]:
    """The stages that an answer may wait for."""
    inside = ANSWER_STAGES if run.background is None else tuple(s for s in ANSWER_STAGES if s != "segment")
    return (*inside, "track") if run.pose_on_path else inside


def _distinct_samples(context: Context, run: ModeRun) -> int | None:
    """Of the slowest stage's profile: what bounds the percentiles (DESIGN 5)."""
    costing = context.costing
    if costing is None or costing.sha256 is None:
        return None
    profile = costing.profile
    if profile is None:
        return _distinct_durations(run.spans)
    return profile.distinct_samples_of_slowest({f"{span.stage}@{len(span.cores)}" for span in run.spans})


def _distinct_durations(spans: Iterable[Span]) -> int:
    """Of the stage with the largest median in a trace that is replayed: it may have been drawn from a small profile."""
    durations: dict[str, array[int]] = defaultdict(lambda: array("q"))
    for span in spans:
        durations[span.stage].append(span.end_ns - span.start_ns)
    slowest = max((sorted(found) for found in durations.values()), key=lambda found: found[len(found) // 2], default=[])
    return len(set(slowest))


def _disabled(context: Context, run: ModeRun) -> dict[str, int]:
    """Keyframes that `fuse` could not use, because an optional channel is missing for them."""
    if run.cloud is None:
        return {}
    lacking = sum(not fusable(context, run, index) for index in run.keyframes)
    return {"fuse": lacking} if lacking else {}


def fusable(context: Context, run: ModeRun, index: int) -> bool:
    """Whether the keyframe with a log index has depth and a pose."""
    missing = context.log.plans[index].missing(NEEDS)
    return not missing if run.tracker is None else "depth" not in missing and run.tracker.anchor(index) is not None


def _coverage(context: Context, found: Found) -> Coverage:
    judged = [a.own.frames for a in (found.offline, found.clocked) if a is not None and a.own is not None]
    slots = context.replayed.slots
    return Coverage(
        frames_with_truth=sum(slot.has_truth for slot in slots), scored=max(judged, default=0), frames=len(slots)
    )


def _loss(context: Context, found: Found, base: Found | None) -> Loss | None:
    offline = None if found.offline is None else found.offline.own
    clocked = found.clocked
    per_frame = None if base is None or base.offline is None else base.offline.own
    parts = split(
        per_frame, offline, None if clocked is None else clocked.own, None if clocked is None else clocked.streaming
    )
    named = {
        "network": parts.network, "prediction": parts.prediction, "scheduling": parts.scheduling,
        "staleness": parts.staleness,
    }  # fmt: skip
    if all(value is None for value in named.values()):
        return None
    why = {name: _why_no_part(context, name, base) for name, value in named.items() if value is None}
    return accuracy.loss(named, why)


def _why_no_part(context: Context, name: str, base: Found | None) -> str:
    if name in ("network", "prediction") and base is None:
        return "the mode per-frame did not run"
    if not context.config.offline and context.config.clock != "offline" and name != "staleness":
        return NO_OFFLINE
    if context.config.clock == "offline" and name in ("scheduling", "staleness"):
        return NO_CLOCK
    return "a score that it is made of was not measured"


def _why_not(context: Context, found: Found) -> dict[str, str]:
    config, why = context.config, {}
    for name, accuracies, absent in (
        ("offline", found.offline, NO_OFFLINE), ("delivered", found.clocked, NO_CLOCK),
        ("streaming", found.clocked, NO_CLOCK),
    ):  # fmt: skip
        if accuracies is None:
            why[name] = context.model.reason or absent
        elif not accuracies.measured:
            why[name] = accuracies.reason
        elif name != "streaming" and accuracies.own is None:
            why[name] = "no frame with truth was answered"
    if config.clock == "offline":
        why["latency_ms"] = why["throughput"] = NO_CLOCK
    elif not config.sustainable:
        why["throughput.sustainable_hz"] = "not searched for (--sustainable)"
    elif context.sustainable_hz.get(found.run.mode.name) is None:
        why["throughput.sustainable_hz"] = (
            "no rate down to 1/64 of the log's keeps p95 from arrival under the deadline with at most 1 % dropped"
        )
    if found.run.cloud is None:
        why["map"] = (
            "--map off"
            if not config.map
            else context.replayed.posing.off
            or "the log lacks depth, poses, or intrinsics of a camera without distortion"
        )
    return why
