"""What the command prints at its end: a short table and its basis."""

from collections.abc import Callable

from tabulate import tabulate

from stsem.document.schema import Comparison, Document, Run
from stsem.report.metrics import METRICS, comparisons, row_delta, shown
from stsem.report.wording import NOT_MEASURED

_PATHS = ("offline.miou", "streaming.miou", "offline.pixel_accuracy", "latency_ms.from_arrival.p50",
          "latency_ms.from_arrival.p95", "throughput.output_hz")  # fmt: skip


def closing_table(document: Document) -> str:
    """One column per mode as plain text, then the paired differences, and the basis of the numbers below."""
    compared = comparisons(document)
    headers = ["", *(run.mode for run in document.runs)]
    rows = [[METRICS[path].name, *(_shown(document, run, path) for run in document.runs)] for path in _PATHS]
    rows += [[name, *(str(get(run)) for run in document.runs)] for name, get in _COUNTS.items()]
    for comparison in compared:
        headers.append(_difference(comparison) if len(compared) > 1 else "difference [95 % interval]")
        deltas = {row.metric: row_delta(row) for row in comparison.rows}
        for path, row in zip(_PATHS, rows, strict=False):
            row.append(deltas.get(path, ""))
    align = ("left", *("right" for _ in headers[1:]))
    table = tabulate(rows, headers, tablefmt="simple", disable_numparse=True, colalign=align)
    return f"{table}\n\n{basis(document)}{_inputs(document)}"


def _inputs(document: Document) -> str:
    """What the network was given, and in what it computed if not in f32; nothing for the oracle."""
    who = document.identity
    how = f" It ran in {who.precision} by {who.backend}." if who.precision not in ("", "f32") else ""
    return f" Inputs of the network {who.model}: {', '.join(who.model_inputs)}.{how}" if who.model_inputs else ""


def basis(document: Document) -> str:
    """Coverage, classes averaged and the meaning of latency, in one or two sentences."""
    if document.accuracy_state != "measured" or not document.runs:
        accuracy = f"Accuracy was not measured: {document.accuracy_reason or 'nothing ran'}."
    else:
        cover = document.runs[0].coverage
        score = next((s for r in document.runs for s in (r.offline, r.delivered, r.streaming) if s), None)
        classes = f", {score.classes_averaged} classes averaged" if score else ""
        accuracy = (
            f"Accuracy over {cover.scored} of {cover.frames} frames ({cover.frames_with_truth} with truth){classes}."
        )
    if all(run.latency_ms is None for run in document.runs):
        return f"{accuracy} Offline: no clock, so no latency."
    return f"{accuracy} Latency from arrival, on the simulated clock."


def _difference(comparison: Comparison) -> str:
    """The head of one of several columns of differences, in lines."""
    return f"{comparison.other}\n− {comparison.base}\n[95 % interval]"


def _shown(document: Document, run: Run, path: str) -> str:
    judged = document.accuracy_state == "measured" or path.startswith(("latency_ms.", "throughput."))
    return shown(run, path) if judged else NOT_MEASURED


def _others(run: Run) -> int:
    outcomes = run.outcomes
    return outcomes.total - outcomes.segmented - outcomes.propagated - outcomes.dropped_busy


_COUNTS: dict[str, Callable[[Run], int]] = {
    "frames segmented": lambda run: run.outcomes.segmented,
    "frames propagated": lambda run: run.outcomes.propagated,
    "frames dropped": lambda run: run.outcomes.dropped_busy,
    "frames without answer otherwise": _others,
    "keyframes": lambda run: len(run.keyframes),
}
