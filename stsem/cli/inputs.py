"""From a finished replay to what the report's views are made from."""

from bisect import bisect_left
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path

from stsem.cli.rows import RunRows
from stsem.document.schema import Document
from stsem.mapping.ply import write_ply
from stsem.metrics.tum import HEADER, lines
from stsem.packed import IntByIndex
from stsem.pose import Trajectory
from stsem.replay.engine import Replayed
from stsem.replay.runs import Context
from stsem.replay.trajectories import side_by_side, trajectories
from stsem.report.annotated import AnnotatedLog
from stsem.report.inputs import ReportInputs, StripFrame, UnsureFrame
from stsem.sim.trace import Marks, RunTrace, write_trace

BLOCK_STAMPS = 1_000
_INDEX = attrgetter("index")


def report_inputs(context: Context, document: Document, scratch: Path, *, plots: bool) -> ReportInputs:
    """What `write_folder` needs; the map is written to `scratch` first."""
    replayed = context.replayed
    clocked = any(run.real_time is not None for run in replayed.runs)
    poses = trajectories(context.log, replayed.posing, replayed.runs[-1].tracker)
    return ReportInputs(
        document=document,
        frames={run.mode.name: RunRows(run, replayed) for run in replayed.runs},
        strip=_strip(replayed),
        strip_pass="offline" if any(run.offline is not None for run in replayed.runs) else "delivered",
        unsure=_unsure(replayed),
        trace=(lambda path: write_trace(path, _traces(context))) if clocked else None,
        trajectory=None if poses.used is None else _text(poses.used),
        paths=side_by_side(poses),
        point_cloud=_map(context, scratch),
        plots=plots,
    )


def annotate_map(annotated: AnnotatedLog, context: Context) -> None:
    """Add the finished map, shown from the last frame on: before it, it did not exist."""
    clouds = [run.cloud for run in context.replayed.runs if run.cloud is not None]
    if clouds:
        points = clouds[-1].points
        annotated.map(context.replayed.slots[-1].log_stamp_ns, points.xyz, points.labels)


def _strip(replayed: Replayed) -> tuple[StripFrame, ...]:
    strip = []
    for picture in replayed.pictures:
        answers, distance = {}, {}
        for run in replayed.runs:
            record = run.offline or run.real_time
            if record is None or picture.index not in record.answers:
                continue
            answers[run.mode.name] = record.answers[picture.index]
            source = record.results[bisect_left(record.results, picture.index, key=_INDEX)].keyframe
            if source is not None:
                distance[run.mode.name] = picture.index - source
        strip.append(StripFrame(picture.index, picture.image, picture.truth, answers, distance))
    return tuple(strip)


def _unsure(replayed: Replayed) -> UnsureFrame | None:
    """Of the first mode that has one: the network is the same in all."""
    for run in replayed.runs:
        if run.record.unsurest is not None and (kept := run.record.unsurest.frame) is not None:
            return UnsureFrame(
                run.mode.name, kept.index, kept.image, kept.truth, kept.labels, kept.confidence, kept.uncertainty
            )
    return None


def _traces(context: Context) -> Iterator[RunTrace]:
    stamps = IntByIndex()
    for slot in context.replayed.slots:
        stamps[slot.index] = slot.log_stamp_ns
    for run in context.replayed.runs:
        if run.real_time is not None:
            marks = Marks(run.real_time.results)
            yield RunTrace(run.mode.name, context.config.cores, stamps, run.spans, marks)


def _text(trajectory: Trajectory) -> Iterator[bytes]:
    """Camera poses at the colour stamps, TUM format."""
    yield HEADER.encode()
    for begin in range(0, len(trajectory), BLOCK_STAMPS):
        block = slice(begin, begin + BLOCK_STAMPS)
        yield "".join(lines(trajectory.stamps_ns[block], trajectory.poses[block])).encode()


def _map(context: Context, scratch: Path) -> Path | None:
    """map.ply of the last mode that built a map: `keyframe`, if it ran."""
    clouds = [run.cloud for run in context.replayed.runs if run.cloud is not None]
    if not clouds:
        return None
    path = scratch / "map.ply"
    write_ply(path, clouds[-1].points, context.model.classes)
    return path
