"""Sections about how late and how fast the answers are, and what became of the frames."""

from stsem.document.schema import Document, Run
from stsem.document.timing import Distribution, Latency, Outcomes, Throughput
from stsem.report.outline import Block, Column, Figure, Items, Row, Section, Table, Text
from stsem.report.wording import NONE, count, meaning, number, percent, percentile, plural
from stsem.result import ANSWER_STAGES, STAGES

_PERCENTILES = ("p50", "p90", "p95", "p99", "p999")
_KINDS = ("from_arrival", "from_stamp", "waiting")


def latency_section(document: Document) -> Section | None:
    """Latencies of every mode, split by stage, and the rates."""
    runs = [run for run in document.runs if run.latency_ms]
    if not runs:
        return None
    return Section(
        "Latency and throughput",
        (Figure("latency", "share of frames answered within a latency, by mode"), _latencies(runs),
         _stages(runs), _throughput(runs), Figure("timeline", "jobs on the two simulated cores")),
    )  # fmt: skip


def _latencies(runs: list[Run]) -> Table:
    columns = (Column("latency, ms", number=False), Column("mode", number=False), *_columns())
    rows = [
        Row((kind.replace("_", " "), run.mode, *_cells(getattr(run.latency_ms, kind))), meaning(Latency, kind))
        for kind in _KINDS
        for run in runs
    ]
    notes = (
        *(f"The latency of `{run.mode}` contains {', '.join(run.stages_inside) or 'no stage'}." for run in runs),
        *(f"{kind.replace('_', ' ').capitalize()}: {meaning(Latency, kind)}" for kind in _KINDS),
        "Percentile p = sorted[ceil(p n) - 1], not interpolated; given from 11, 64, 130, 662 and 6636 samples on "
        "(the smaller of frames and distinct samples of the slowest stage's profile), otherwise `n too small`.",
    )
    return Table(columns, tuple(rows), notes)


def _columns() -> tuple[Column, ...]:
    names = {name: "p99.9" if name == "p999" else name for name in _PERCENTILES}
    return (
        *(Column(shown, meaning(Distribution, name)) for name, shown in names.items()),
        Column("max", meaning(Distribution, "max")), Column("mean", meaning(Distribution, "mean")),
        Column("n", "samples; in brackets the distinct ones of the slowest stage's profile"),
    )  # fmt: skip


def _cells(samples: Distribution) -> tuple[str, ...]:
    distinct = "" if samples.n_distinct is None else f" ({count(samples.n_distinct)})"
    return (
        *(percentile(samples, name) for name in _PERCENTILES), number(samples.max), number(samples.mean),
        count(samples.n) + distinct,
    )  # fmt: skip


def _stages(runs: list[Run]) -> Table:
    columns = (
        Column("stage", number=False), Column("mode", number=False), Column("service p50, ms"),
        Column("service max, ms"), Column("service mean, ms"), Column("waiting mean, ms"), Column("waiting max, ms"),
        Column("jobs"),
    )  # fmt: skip
    rows = []
    for stage in dict.fromkeys(
        (*STAGES, *(stage for run in runs if run.latency_ms for stage in run.latency_ms.stages))
    ):
        for run in runs:
            part = run.latency_ms.stages.get(stage) if run.latency_ms else None
            if part and part.service.n:
                rows.append(Row((
                    stage + _beside(run, stage), run.mode, percentile(part.service, "p50"), number(part.service.max),
                    number(part.service.mean), number(part.waiting.mean), number(part.waiting.max),
                    count(part.service.n),
                )))  # fmt: skip
    return Table(columns, tuple(rows), ("Waiting: from ready to start, for cores. Service: time on the cores.",))


def _beside(run: Run, stage: str) -> str:
    """Said of a stage that no answer waits for."""
    waited_for = ANSWER_STAGES if run.background is None else [s for s in ANSWER_STAGES if s != "segment"]
    return "" if stage in waited_for or stage in run.stages_inside else " (beside the path)"


_RATES: dict[str, str] = {
    "output_hz": "output rate, Hz", "offered_hz": "offered rate, Hz", "processed_share": "frames answered, %",
    "real_time_factor": "real-time factor", "jitter_ms": "jitter, ms", "deadline_ms": "deadline, ms",
    "deadline_misses": "deadline misses", "sustainable_hz": "sustainable rate, Hz",
}  # fmt: skip


def _throughput(runs: list[Run]) -> Table:
    columns = (Column("throughput", number=False), *(Column(run.mode) for run in runs))
    rows = [
        Row((name, *(_rate(run, field) for run in runs)), meaning(Throughput, field)) for field, name in _RATES.items()
    ]
    cores = max((len(run.throughput.utilisation) for run in runs if run.throughput), default=0)
    rows += [
        Row((f"core {core} busy, %", *(_utilisation(run, core) for run in runs)), meaning(Throughput, "utilisation"))
        for core in range(cores)
    ]
    notes = tuple(f"{name.split(',')[0].capitalize()}: {meaning(Throughput, field)}" for field, name in _RATES.items())
    return Table(columns, tuple(rows), notes)


def _rate(run: Run, field: str) -> str:
    value = getattr(run.throughput, field) if run.throughput else None
    if value is None:
        why = run.not_measured.get(f"throughput.{field}") or run.not_measured.get(field)
        return f"not measured: {why}" if why else "not searched for" if field == "sustainable_hz" else "not measured"
    if field == "processed_share":
        return percent(value)
    if field == "deadline_misses":
        return f"{count(value)} of {count(run.frames)}"
    return number(value, 2 if field in ("output_hz", "offered_hz", "real_time_factor", "sustainable_hz") else 1)


def _utilisation(run: Run, core: int) -> str:
    busy = run.throughput.utilisation if run.throughput else ()
    return percent(busy[core]) if core < len(busy) else NONE


def outcomes_section(document: Document) -> Section | None:
    """What became of every frame, with the sum, and why frames became keyframes."""
    runs = document.runs
    if not runs:
        return None
    columns = (Column("outcome", number=False), *(Column(run.mode) for run in runs))
    rows = [
        Row((name.replace("_", " "), *(count(getattr(run.outcomes, name)) for run in runs)), meaning(Outcomes, name))
        for name in Outcomes.model_fields
    ]
    rows.append(Row(("sum", *(count(run.outcomes.total) for run in runs)), total=True))
    rows.append(Row(("frames of the log", *(count(run.frames) for run in runs)), total=True))
    notes = ("Every frame ends in exactly one outcome, named by how its answer was made; the sum is checked.",)
    blocks: list[Block] = [
        Figure("overview", "pixel accuracy of each frame over the log"),
        Table(columns, tuple(rows), notes),
    ]
    blocks += [Text(_keyframes(run)) for run in runs if run.keyframes or run.background]
    disabled = tuple(f"`{run.mode}`: {stage} was off for {count(n)} frames, an optional channel or a pose was missing."
                     for run in runs for stage, n in run.stages_disabled.items())  # fmt: skip
    return Section("What became of the frames", (*blocks, Items(disabled)) if disabled else tuple(blocks))


def _keyframes(run: Run) -> str:
    reasons = ", ".join(f"{reason} {count(n)}" for reason, n in run.keyframe_reasons.items())
    share = percent(len(run.keyframes) / run.frames) if run.frames else NONE
    moved = f"; {count(run.keyframes_moved)} moved to the next frame with truth" if run.keyframes_moved else ""
    keyframes = f"{plural(len(run.keyframes), 'keyframe')} ({share} % of the frames)"
    return f"`{run.mode}`: {keyframes}; why: {reasons or 'not stated'}{moved}.{_choices(run)}"


def _choices(run: Run) -> str:
    """What became of the frames chosen, where answers do not wait for the network; "" elsewhere."""
    beside = run.background
    if beside is None:
        return ""
    return (
        f" Of {plural(beside.chosen, 'frame')} chosen, {count(beside.finished)} became keyframes beside the answers, "
        f"{count(beside.replaced)} lost their place before the network to a newer choice, {count(beside.unfinished)} "
        "were unfinished at the end."
    )
