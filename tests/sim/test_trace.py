"""The trace file: what Perfetto needs, exact nanoseconds, equal bytes."""

import json
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from stsem.errors import CostError
from stsem.result import FrameResult, Outcome, Span
from stsem.sim.trace import Mark, Marks, RunTrace, is_trace, read_durations, schedule_text, write_trace

STAMPS = {0: 100, 1: 200}
SPANS = [Span(0, "segment", (0, 1), 0, 3, 1_000_000_000_000_001), Span(1, "propagate", (1,), 0, 5, 6)]
MARKS = [Mark("arrivals", "arrived", 0, 3), Mark("answers", "segmented", 0, 1_000_000_000_000_001)]
RUN = RunTrace("keyframe", 2, STAMPS, SPANS, MARKS)


def trace_bytes(runs: Iterable[RunTrace]) -> bytes:
    with TemporaryDirectory() as folder:
        write_trace(Path(folder) / "trace.json", runs)
        return (Path(folder) / "trace.json").read_bytes()


def events(runs: list[RunTrace]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(trace_bytes(runs))["traceEvents"]
    return found


def test_a_two_core_job_lies_on_both_cores_with_exact_nanoseconds() -> None:
    slices = [event for event in events([RUN]) if event["ph"] == "X"]
    assert [(s["name"], s["tid"]) for s in slices] == [("segment 0", 1), ("segment 0", 2), ("propagate 1", 2)]
    assert slices[0]["args"] == {
        "mode": "keyframe",
        "frame": 0,
        "stamp_ns": 100,
        "stage": "segment",
        "cores": [0, 1],
        "ready_ns": 0,
        "start_ns": 3,
        "end_ns": 1_000_000_000_000_001,
        "duration_ns": 999_999_999_999_998,
    }
    assert (slices[2]["ts"], slices[2]["dur"]) == (0.005, 0.001)


def test_every_mode_is_a_process_and_every_core_and_mark_a_named_track() -> None:
    named = events([RUN, RunTrace("per-frame", 1, STAMPS, [])])
    processes = {e["pid"]: e["args"]["name"] for e in named if e["name"] == "process_name"}
    threads = {(e["pid"], e["tid"]): e["args"]["name"] for e in named if e["name"] == "thread_name"}
    assert processes == {1: "keyframe", 2: "per-frame"}
    assert threads == {
        (1, 1): "core 0",
        (1, 2): "core 1",
        (1, 3): "answers",
        (1, 4): "arrivals",
        (2, 1): "core 0",
    }
    instants = [(e["tid"], e["name"], e["args"]["time_ns"]) for e in named if e["ph"] == "i"]
    assert instants == [(4, "arrived 0", 3), (3, "segmented 0", 1_000_000_000_000_001)]


def test_marks_tell_arrivals_drops_and_answers() -> None:
    results = [
        FrameResult(0, 0, 3, 3, 9, Outcome.SEGMENTED, keyframe=0),
        FrameResult(1, 1, 4, None, None, Outcome.DROPPED_BUSY),
        FrameResult(2, 2, None, None, None, Outcome.UNDECODABLE),
    ]
    assert list(Marks(results)) == [
        Mark("arrivals", "arrived", 0, 3),
        Mark("answers", "segmented", 0, 9),
        Mark("arrivals", "arrived", 1, 4),
        Mark("drops", "dropped_busy", 1, 4),
    ]


def test_what_is_no_trace_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "trace.json"
    for data in (
        b"",
        b"{",
        b"[]",
        b'{"schema": "stsem-costs/1"}',
        b'{"otherData": {"schema": "x"}, "traceEvents": []}',
    ):
        path.write_bytes(data)
        assert not is_trace(data)
        with pytest.raises(CostError, match="is not a trace of stsem"):
            read_durations(path)
    with pytest.raises(CostError, match="cannot be read: No such file"):
        read_durations(tmp_path / "none.json")


def test_a_damaged_trace_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "trace.json"
    path.write_bytes(trace_bytes([RUN]).replace(b'"duration_ns":1', b'"duration_ns":null'))
    with pytest.raises(CostError, match="is damaged"):
        read_durations(path)
    path.write_bytes(trace_bytes([RUN]).replace(b'"duration_ns":999999999999998', b'"duration_ns":5', 1))
    with pytest.raises(CostError, match="two durations for one job"):
        read_durations(path)


def test_a_schedule_reads_to_the_nanosecond() -> None:
    assert schedule_text(SPANS).splitlines()[1].split() == [
        "0.000003",
        "1000000000.000001",
        "0.000003",
        "0+1",
        "0",
        "segment",
    ]
    assert "-0.000002" in schedule_text([Span(0, "a", (0,), -3, -2, -1)])
