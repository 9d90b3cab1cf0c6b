"""The top of the report: what a hurried reader must know."""

from stsem.document.accuracy import Score
from stsem.document.schema import Comparison, ComparisonRow, Document, Run
from stsem.report.metrics import METRICS, comparisons, row_delta, row_reading, shown
from stsem.report.outline import Tile
from stsem.report.wording import NONE, NOT_MEASURED, TOO_FEW, meaning, number, percent, plural

_DISTURBED = ("disturbed", "other work held a core")
_TILES = {
    "streaming.miou": ("Streaming mIoU", " %"),
    "offline.miou": ("Offline mIoU", " %"),
    "latency_ms.from_arrival.p50": ("Median latency", " ms"),
    "throughput.output_hz": ("Output rate", " Hz"),
}


def report_title(document: Document) -> str:
    """The log, the network and the clock."""
    logs = ", ".join(log.name for log in document.input.logs)
    clocks = "real-time" if any(run.clock == "real-time" for run in document.runs) else "offline"
    return f"{logs} with {document.identity.model or 'no network'}, {clocks}"


def lead(document: Document) -> tuple[str, ...]:
    """Verdict, each comparison in one sentence, and what the numbers rest on."""
    sentences = [document.verdict.text, *document.state_reasons]
    compared = [said for comparison in comparisons(document) if (said := _compared(document, comparison))]
    sentences += compared or [_alone(run) for run in document.runs]
    return (*sentences, basis(document))


def basis(document: Document) -> str:
    """Coverage, classes averaged, clock and costs: what every number below rests on."""
    said = []
    if document.accuracy_state != "measured":
        said.append(f"Accuracy was not measured: {document.accuracy_reason or 'no frame was scored'}.")
    else:
        said.append(_coverage(document))
    if any(run.latency_ms for run in document.runs):
        costs = f"the cost profile `{document.identity.costs}`" if document.identity.costs else "this host as it ran"
        said.append(f"Latencies and rates are on the simulated clock, with job durations from {costs}.")
    else:
        said.append("There was no clock (offline), so there are no latencies.")
    return " ".join(said)


def warnings(document: Document) -> tuple[str, ...]:
    """What must be known before a number is believed: the document's own warnings, and what its identity implies."""
    disturbed = document.identity.costs_disturbed and not any(
        word in text for text in document.warnings for word in _DISTURBED
    )
    implied = (
        f"The cost profile {document.identity.costs} is disturbed: it was measured while other work held a core.",
    )
    return (*document.warnings, *(implied if disturbed else ()))


def tiles(document: Document) -> tuple[Tile, ...]:
    """The headline numbers of the last mode against the first."""
    if not document.runs:
        return ()
    base, other = document.runs[0], document.runs[-1]
    pairs = (c.rows for c in comparisons(document) if (c.base, c.other) == (base.mode, other.mode))
    rows = {row.metric: row for row in next(pairs, ())}
    return tuple(
        _tile(path, base, other, rows.get(path))
        for path in _TILES
        if shown(other, path) not in (NONE, NOT_MEASURED, TOO_FEW)
    )


def _tile(path: str, base: Run, other: Run, row: ComparisonRow | None) -> Tile:
    name, unit = _TILES[path]
    value, means = shown(other, path) + unit, METRICS[path].meaning
    if base is other:
        return Tile(name, value, other.mode, meaning=means)
    against = shown(base, path)
    worded = f"{base.mode}: {against}{unit if against[0].isdigit() else ''}"
    if row is None or row.delta is None:
        return Tile(name, value, other.mode, worded, meaning=means)
    points = (" points" if row.ci95 else " points, no interval") if row.unit == "fraction" else unit
    return Tile(name, value, other.mode, worded, row_delta(row) + points, _good(row), means)


def _good(row: ComparisonRow) -> bool | None:
    unclear = row.unit == "fraction" if row.ci95 is None else row.ci95[0] <= 0 <= row.ci95[1]
    if not row.delta or unclear:
        return None
    return (row.delta > 0) == row.higher_is_better


def _compared(document: Document, comparison: Comparison) -> str:
    base, other = document.run(comparison.base), document.run(comparison.other)
    if base is None or other is None:
        return ""
    parts = []
    rows = {row.metric: row for row in comparison.rows}
    for path in ("streaming.miou", "offline.miou"):
        if (row := rows.get(path)) and row.delta is not None:
            reading = row_reading(row, base.mode, other.mode)
            name = METRICS[path].name.removesuffix(", %")
            parts.append(f"{name} {percent(row.other)} % against {percent(row.base)} % "
                         f"({row_delta(row)} points: {reading})")  # fmt: skip
    medians = [shown(run, "latency_ms.from_arrival.p50") for run in (other, base)]
    if all(median[0].isdigit() for median in medians):
        parts.append(f"median latency {medians[0]} ms against {medians[1]} ms")
    if base.clock == "real-time":
        dropped = [run.outcomes.dropped_busy for run in (other, base)]
        parts.append(f"{dropped[0]} of {plural(other.frames, 'frame')} dropped against {dropped[1]}")
    return f"`{other.mode}` against `{base.mode}`: {'; '.join(parts)}." if parts else ""


def _alone(run: Run) -> str:
    score = run.streaming or run.offline
    name = "streaming" if run.streaming else "offline"
    parts = [f"{name} mIoU {percent(score.miou)} %"] if score else []
    if run.latency_ms and run.latency_ms.from_arrival.mean is not None:
        parts.append(f"mean latency {number(run.latency_ms.from_arrival.mean)} ms")
    answered = run.outcomes.segmented + run.outcomes.propagated
    parts.append(f"{answered} of {plural(run.frames, 'frame')} answered")
    return f"`{run.mode}`: {'; '.join(parts)}."


def _coverage(document: Document) -> str:
    cover = document.runs[0].coverage
    scores: list[Score] = [s for run in document.runs for s in (run.offline, run.delivered, run.streaming) if s]
    classes = sorted({score.classes_averaged for score in scores})
    averaged = " to ".join(str(n) for n in dict.fromkeys((classes[0], classes[-1]))) if classes else "0"
    total = len(document.input.classes)
    frames = plural(cover.frames, "frame")
    return (
        f"Accuracy speaks for {cover.scored} of {frames} ({cover.frames_with_truth} have truth); "
        f"mIoU averages the {averaged} classes with truth pixels, of {total} in the log."
    )


def score_meanings() -> tuple[str, ...]:
    """The definitions that every accuracy table needs."""
    return (
        f"mIoU: {meaning(Score, 'miou')}",
        f"Offline: {meaning(Run, 'offline')} Delivered: {meaning(Run, 'delivered')} "
        f"Streaming: {meaning(Run, 'streaming')}",
    )
