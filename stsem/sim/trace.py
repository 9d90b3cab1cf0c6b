"""The trace of events: what ran when on which core, for Perfetto, for later runs, and for eyes.

The file is Chrome's trace event format: one process per mode, one thread per core and per kind of instant. `ts` and
`dur` are microseconds, as the format wants; the exact nanoseconds are in `args`.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stsem.errors import CostError
from stsem.result import FrameResult, Outcome, Span
from stsem.sim.costs import Durations

SCHEMA = "stsem-trace/1"

Event = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Mark:
    """An instant that holds no core.

    Args:
        track: the row it is drawn in, e.g. "arrivals".
        name: what it says.
        frame: log index.
        time_ns: simulated time.
    """

    track: str
    name: str
    frame: int
    time_ns: int


@dataclass(frozen=True)
class RunTrace:
    """Everything the trace says about one mode.

    Args:
        mode: its name.
        cores: how many cores the simulated robot has.
        stamps_ns: log index -> capture stamp as in the log, for every frame with a span.
        spans: the jobs.
        marks: the instants; gone through twice.
    """

    mode: str
    cores: int
    stamps_ns: Mapping[int, int]
    spans: Sequence[Span]
    marks: Iterable[Mark] = ()


class Marks(Iterable[Mark]):
    """Arrivals, drops and answers of a run; a drop is drawn where the dropped frame arrived.

    Args:
        results: of the run; the marks are made from them whenever they are asked for.
    """

    def __init__(self, results: Iterable[FrameResult]) -> None:
        self._results = results

    def __iter__(self) -> Iterator[Mark]:
        for result in self._results:
            if result.arrival_ns is not None:
                yield Mark("arrivals", "arrived", result.index, result.arrival_ns)
                if result.outcome is Outcome.DROPPED_BUSY:
                    yield Mark("drops", str(result.outcome), result.index, result.arrival_ns)
            if result.answered_ns is not None:
                yield Mark("answers", str(result.outcome), result.index, result.answered_ns)


def write_trace(path: Path, runs: Iterable[RunTrace]) -> None:
    """Write the file `trace.json`: one event per line; equal runs give equal bytes. No more than one run is held."""
    with path.open("wb") as file:
        file.write(f'{{"displayTimeUnit":"ms","otherData":{{"schema":{_json(SCHEMA)}}},"traceEvents":['.encode())
        between = b"\n"
        for pid, run in enumerate(runs, start=1):
            for event in _events(pid, run):
                file.write(between + _json(event).encode())
                between = b",\n"
        file.write(b"\n]}\n")


def read_durations(path: Path) -> tuple[dict[str, Durations], str]:
    """The duration of every job in a trace, by mode, and the sha256 of its file.

    Raises:
        CostError: the file cannot be read, is not a trace of stsem, or contradicts itself.
    """
    try:
        data = path.read_bytes()
    except OSError as err:
        raise CostError(f"The trace {path} cannot be read: {err.strerror}; give a file that exists.") from err
    if not is_trace(data):
        raise CostError(f"{path} is not a trace of stsem; give the trace.json of an earlier run.")
    durations: dict[str, Durations] = {}
    try:
        for event in json.loads(data)["traceEvents"]:
            if event["ph"] == "X":
                args = event["args"]
                run = durations.setdefault(str(args["mode"]), {})
                job = (int(args["stamp_ns"]), str(args["stage"]), len(args["cores"]))
                if run.setdefault(job, int(args["duration_ns"])) != args["duration_ns"]:
                    raise CostError(f"The trace {path} gives two durations for one job: {job}.")
    except (LookupError, TypeError, ValueError) as err:
        raise CostError(f"The trace {path} is damaged ({err!r}); record it again.") from err
    return durations, hashlib.sha256(data).hexdigest()


def is_trace(data: bytes) -> bool:
    """Whether `data` is a `trace.json` (and not, say, a cost profile)."""
    try:
        document = json.loads(data)
        return bool(document["otherData"]["schema"] == SCHEMA)
    except (LookupError, TypeError, ValueError, RecursionError):
        return False


def schedule_text(spans: Iterable[Span]) -> str:
    """The spans as a table of fixed width, a job per line; times in milliseconds to the exact nanosecond."""
    lines = [f"{'start ms':>16} {'end ms':>16} {'waited ms':>16}  {'cores':<5} {'frame':>5} stage"]
    for span in spans:
        times = " ".join(f"{_ms(t):>16}" for t in (span.start_ns, span.end_ns, span.start_ns - span.ready_ns))
        lines.append(f"{times}  {'+'.join(map(str, span.cores)):<5} {span.frame:>5} {span.stage}")
    return "\n".join(lines) + "\n"


def _events(pid: int, run: RunTrace) -> Iterator[Event]:
    tracks = {track: run.cores + 1 + i for i, track in enumerate(sorted({mark.track for mark in run.marks}))}
    names = {**{core + 1: f"core {core}" for core in range(run.cores)}, **{tid: name for name, tid in tracks.items()}}
    yield {"ph": "M", "pid": pid, "name": "process_name", "args": {"name": run.mode}}
    for tid, name in names.items():
        yield {"ph": "M", "pid": pid, "tid": tid, "name": "thread_name", "args": {"name": name}}
        yield {"ph": "M", "pid": pid, "tid": tid, "name": "thread_sort_index", "args": {"sort_index": tid}}
    for span in run.spans:
        yield from _slices(pid, run, span)
    for mark in run.marks:
        args = {"frame": mark.frame, "mode": run.mode, "time_ns": mark.time_ns}
        yield {
            "ph": "i", "s": "t", "pid": pid, "tid": tracks[mark.track], "cat": "mark",
            "name": f"{mark.name} {mark.frame}", "ts": mark.time_ns / 1000, "args": args,
        }  # fmt: skip


def _slices(pid: int, run: RunTrace, span: Span) -> Iterator[Event]:
    args = {
        "mode": run.mode, "frame": span.frame, "stamp_ns": run.stamps_ns[span.frame], "stage": span.stage,
        "cores": span.cores, "ready_ns": span.ready_ns, "start_ns": span.start_ns, "end_ns": span.end_ns,
        "duration_ns": span.end_ns - span.start_ns,
    }  # fmt: skip
    for core in span.cores:
        yield {
            "ph": "X", "pid": pid, "tid": core + 1, "cat": "job", "name": f"{span.stage} {span.frame}",
            "ts": span.start_ns / 1000, "dur": (span.end_ns - span.start_ns) / 1000, "args": args,
        }  # fmt: skip


def _json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))


def _ms(time_ns: int) -> str:
    sign, rest = ("-", -time_ns) if time_ns < 0 else ("", time_ns)
    return f"{sign}{rest // 1_000_000}.{rest % 1_000_000:06d}"
