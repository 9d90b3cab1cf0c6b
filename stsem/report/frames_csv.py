"""frames.csv: a row per frame and mode, times as exact integers."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from typing import Any

import pandas as pd

from stsem.packed import IntByIndex
from stsem.report.inputs import FrameRow, ReportInputs
from stsem.result import STAGES

BLOCK_ROWS = 1_000
_INTEGERS = (
    "frame", "log_stamp_ns", "stamp_ns", "arrival_ns", "taken_ns", "answered_ns", "keyframe", "distance_frames",
    "distance_ns", "latency_from_arrival_ns", "latency_from_stamp_ns", "waiting_ns", "offline_keyframe",
)  # fmt: skip


def frames_csv(inputs: ReportInputs) -> Iterator[bytes]:
    """frames.csv, piece by piece; floats in the shortest form that reads back equal."""
    stages = stages_of(chain.from_iterable(inputs.frames.values()))
    yield (",".join(_record_columns(stages)) + "\n").encode()
    for run in inputs.document.runs:
        rows, stamps = inputs.rows(run.mode), IntByIndex()
        for begin in range(0, len(rows), BLOCK_ROWS):
            block = rows[begin : begin + BLOCK_ROWS]
            for row in block:
                stamps[row.result.index] = row.log_stamp_ns
            table = _table([_record(row, stamps, run.stages_inside, stages) for row in block], stages)
            yield table.to_csv(header=False, index=False, lineterminator="\n").encode()


def _table(records: list[dict[str, Any]], stages: tuple[str, ...]) -> pd.DataFrame:
    """One row per record; integers are nullable Int64, so that an absent time stays exact and blank."""
    table = pd.DataFrame.from_records(records, columns=list(_record_columns(stages)))
    whole = [*_INTEGERS, *(f"{stage}_{kind}_ns" for stage in stages for kind in ("waiting", "service"))]
    return table.astype(dict.fromkeys(whole, "Int64"))


def stages_of(rows: Iterable[FrameRow]) -> tuple[str, ...]:
    """The stages that worked, in pipeline order; unknown ones behind, by name."""
    found = {span.stage for row in rows for span in row.result.spans}
    return (*(stage for stage in STAGES if stage in found), *sorted(found.difference(STAGES)))


def _record(
    row: FrameRow, stamps: Mapping[int, int], inside: tuple[str, ...], stages: tuple[str, ...]
) -> dict[str, Any]:
    result, latency = row.result, row.latency_ns
    source = result.keyframe
    record = {
        "mode": row.mode, "frame": result.index, "outcome": str(result.outcome), "reason": result.reason,
        "remark": result.remark, "keyframe": source,
        "distance_frames": None if source is None else result.index - source,
        "distance_ns": None if source is None else row.log_stamp_ns - stamps[source],
        "log_stamp_ns": row.log_stamp_ns, "stamp_ns": result.stamp_ns, "arrival_ns": result.arrival_ns,
        "taken_ns": result.taken_ns, "answered_ns": result.answered_ns, "latency_from_arrival_ns": latency,
        "latency_from_stamp_ns": None if result.answered_ns is None else result.answered_ns - result.stamp_ns,
        "waiting_ns": None if latency is None else latency - sum(row.service_ns(stage) or 0 for stage in inside),
        "labelled_share": result.coverage, "covered_share": result.covered_share,
        "offline_keyframe": row.offline_keyframe, "offline_pixel_accuracy": row.offline,
        "delivered_pixel_accuracy": row.delivered,
        "streaming_pixel_accuracy": row.streaming,
    }  # fmt: skip
    for stage in stages:
        record[f"{stage}_waiting_ns"] = row.waiting_ns(stage)
        record[f"{stage}_service_ns"] = row.service_ns(stage)
    return record


def _record_columns(stages: tuple[str, ...]) -> tuple[str, ...]:
    return (
        "mode", "frame", "outcome", "reason", "remark", "keyframe", "distance_frames", "distance_ns", "log_stamp_ns",
        "stamp_ns", "arrival_ns", "taken_ns", "answered_ns", "latency_from_arrival_ns", "latency_from_stamp_ns",
        "waiting_ns", "labelled_share", "covered_share", "offline_keyframe", "offline_pixel_accuracy",
        "delivered_pixel_accuracy", "streaming_pixel_accuracy",
        *(f"{stage}_{kind}_ns" for stage in stages for kind in ("waiting", "service")),
    )  # fmt: skip
