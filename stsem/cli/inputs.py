"""From a finished replay to what the report's views are made from."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from operator import attrgetter
from pathlib import Path

import numpy as np
import numpy.typing as npt

from stsem.document.schema import Document
from stsem.log.log import Log
from stsem.mapping.ply import write_ply
from stsem.pose import Trajectory, to_quaternion
from stsem.replay.engine import Replayed
from stsem.replay.lanes import ModeRun
from stsem.replay.record import Record
from stsem.replay.runs import Context
from stsem.report.annotated import AnnotatedLog
from stsem.report.inputs import FrameRow, ReportInputs, StripFrame
from stsem.sim.trace import RunTrace, marks_of, write_trace

MAX_POSE_GAP_NS = 150_000_000
BLOCK_STAMPS = 10_000
_FRAME = attrgetter("frame")


def report_inputs(context: Context, document: Document, scratch: Path, *, plots: bool) -> ReportInputs:
    """What `write_folder` needs; the map is written to `scratch` first."""
    replayed = context.replayed
    clocked = any(run.real_time is not None for run in replayed.runs)
    return ReportInputs(
        document=document,
        frames=tuple(row for run in replayed.runs for row in _rows(run, replayed)),
        strip=_strip(replayed),
        strip_pass="offline" if any(run.offline is not None for run in replayed.runs) else "delivered",
        trace=(lambda path: write_trace(path, _traces(context))) if clocked else None,
        trajectory=_trajectory(context.log),
        point_cloud=_map(context, scratch),
        plots=plots,
    )


def annotate_map(annotated: AnnotatedLog, context: Context) -> None:
    """Add the finished map, shown from the last frame on: before it, it did not exist."""
    clouds = [run.cloud for run in context.replayed.runs if run.cloud is not None]
    if clouds:
        points = clouds[-1].points
        annotated.map(context.replayed.slots[-1].log_stamp_ns, points.xyz, points.labels)


def _rows(run: ModeRun, replayed: Replayed) -> list[FrameRow]:
    by_frame = sorted(run.spans, key=_FRAME)
    spans = {frame: tuple(jobs) for frame, jobs in groupby(by_frame, _FRAME)}
    offline, own, streaming = _accuracies(run.offline), _accuracies(run.real_time), {}
    if run.real_time is not None and run.real_time.scorecard is not None:
        streaming = run.real_time.scorecard.streaming_pixel_accuracy()
    sources = {} if run.offline is None else {r.index: r.keyframe for r in run.offline.results}
    first = replayed.slots[0].index if replayed.slots else 0
    return [
        FrameRow(
            mode=run.mode.name,
            result=replace(result, spans=spans[result.index]) if result.index in spans else result,
            log_stamp_ns=replayed.slots[result.index - first].log_stamp_ns,
            offline_keyframe=sources.get(result.index),
            offline=offline.get(result.index),
            delivered=own.get(result.index),
            streaming=streaming.get(result.index),
        )
        for result in run.record.results
    ]


def _accuracies(record: Record | None) -> dict[int, float]:
    return {} if record is None or record.scorecard is None else record.scorecard.pixel_accuracy()


def _strip(replayed: Replayed) -> tuple[StripFrame, ...]:
    strip = []
    for picture in replayed.pictures:
        answers, distance = {}, {}
        for run in replayed.runs:
            record = run.offline or run.real_time
            if record is None or picture.index not in record.answers:
                continue
            answers[run.mode.name] = record.answers[picture.index]
            source = next(r.keyframe for r in record.results if r.index == picture.index)
            if source is not None:
                distance[run.mode.name] = picture.index - source
        strip.append(StripFrame(picture.index, picture.image, picture.truth, answers, distance))
    return tuple(strip)


def _traces(context: Context) -> Iterator[RunTrace]:
    stamps = {slot.index: slot.log_stamp_ns for slot in context.replayed.slots}
    for run in context.replayed.runs:
        if run.real_time is not None:
            marks = marks_of(run.real_time.results)
            yield RunTrace(run.mode.name, context.config.cores, stamps, run.spans, marks)


def _trajectory(log: Log) -> bytes | None:
    """Camera poses at the colour stamps, TUM format: stamp in seconds, position, quaternion x y z w."""
    if log.trajectory is None:
        return None
    stamps = np.array([plan.stamp_ns for plan in log.plans], np.int64)
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for begin in range(0, len(stamps), BLOCK_STAMPS):
        lines += _trajectory_lines(log.trajectory, stamps[begin : begin + BLOCK_STAMPS])
    return ("\n".join(lines) + "\n").encode()


def _trajectory_lines(trajectory: Trajectory, stamps_ns: npt.NDArray[np.int64]) -> Iterator[str]:
    found = trajectory.brackets(stamps_ns, MAX_POSE_GAP_NS)
    known = stamps_ns[found.known]
    poses = trajectory.between(known, found.earlier[found.known], found.later[found.known])
    numbers = np.concatenate([poses[:, :3, 3], to_quaternion(poses)], axis=1)
    for stamp_ns, row in zip(known.tolist(), numbers.tolist(), strict=True):
        seconds, rest = divmod(stamp_ns, 10**9)
        yield f"{seconds}.{rest:09d} " + " ".join(f"{number:.9g}" for number in row)


def _map(context: Context, scratch: Path) -> Path | None:
    """map.ply of the last mode that built a map: `keyframe`, if it ran."""
    clouds = [run.cloud for run in context.replayed.runs if run.cloud is not None]
    if not clouds:
        return None
    path = scratch / "map.ply"
    write_ply(path, clouds[-1].points, context.model.classes)
    return path
