"""Sections about how right the answers are."""

from stsem.document.accuracy import Consistency, DistanceRow, DistanceSummary, Loss, Score
from stsem.document.schema import Comparison, Document, Run
from stsem.report.metrics import METRICS, no_intervals, row_delta, row_name, row_reading, row_value, shown
from stsem.report.outline import Block, Column, Figure, Folded, Row, Section, Table, Text
from stsem.report.plots.classes import best_pass, present_classes
from stsem.report.plots.distance import ENOUGH
from stsem.report.sections.headline import score_meanings
from stsem.report.wording import NONE, NOT_MEASURED, count, meaning, number, percent, plural, points

PASSES = ("offline", "delivered", "streaming")
_PARTS = ("network", "prediction", "scheduling", "staleness")


def comparison_section(document: Document) -> Section | None:
    """The modes against each other, with intervals; with one mode, its numbers alone."""
    tables: list[Block] = [_comparison(c) for c in (document.comparison, *document.more_comparisons) if c and c.rows]
    if not tables:
        if not document.runs:
            return None
        tables = [_alone(document)]
    title = "Comparison" if document.comparison else "Result"
    return Section(title, tuple(tables))


def _comparison(comparison: Comparison) -> Table:
    base, other = comparison.base, comparison.other
    columns = (
        Column("metric", number=False), Column(base), Column(other),
        Column("difference [95 %]", f"{other} - {base}, paired over the same frames; points for what is in %"),
        Column("reading", number=False), Column("n", "frames behind the difference"),
    )  # fmt: skip
    rows = tuple(
        Row(
            (row_name(row), row_value(row, row.base), row_value(row, row.other), row_delta(row),
             row_reading(row, base, other), count(row.n)),
            METRICS[row.metric].meaning if row.metric in METRICS else "",
        )
        for row in comparison.rows
    )  # fmt: skip
    notes = (
        "Differences are paired: the same frames in both modes; a frame that one mode dropped stays in, as all wrong "
        "(so the delivered scores are lower here than in the other tables, which hold the answers alone). "
        "Intervals: block bootstrap over stretches of the log; `no clear difference` where the interval holds 0.",
        *no_intervals(comparison.rows),
        *(score_meanings() if any(".miou" in row.metric for row in comparison.rows) else ()),
    )
    return Table(columns, rows, notes)


def _alone(document: Document) -> Table:
    columns = (Column("metric", number=False), *(Column(run.mode) for run in document.runs))
    rows = [Row((metric.name, *(shown(run, path) for run in document.runs)), metric.meaning)
            for path, metric in METRICS.items()]  # fmt: skip
    kept = tuple(row for row in rows if any(cell not in (NONE, NOT_MEASURED) for cell in row.cells[1:]))
    return Table(columns, kept, score_meanings() if document.accuracy_state == "measured" else ())


def loss_section(document: Document) -> Section | None:
    """The split of the loss, mode by mode."""
    runs = [run for run in document.runs if run.loss]
    if not runs:
        return None
    columns = [Column("part", number=False)]
    for run in runs:
        columns += [Column(f"{run.mode}, points"), Column("n", "scored frames behind it")]
    rows = [Row((name, *(cell for run in runs for cell in _part(run, name))), meaning(Loss, name)) for name in _PARTS]
    left = [cell for run in runs for cell in (percent(run.streaming.miou) if run.streaming else NONE, "")]
    rows.append(Row(("left: streaming mIoU, %", *left), total=True))
    notes = tuple(f"{name.capitalize()}: {meaning(Loss, name)}" for name in _PARTS)
    return Section("Where the mIoU is lost", (Figure("loss", "mIoU after each part of the loss, by mode"),
                                              Table(tuple(columns), tuple(rows), notes)))  # fmt: skip


def _part(run: Run, name: str) -> tuple[str, str]:
    value = getattr(run.loss, name)
    if run.loss is None or value is None:
        why = run.loss.why.get(name, "") if run.loss else ""
        return (f"{NOT_MEASURED}: {why}" if why else NOT_MEASURED, "")
    return points(-value), count(getattr(run.loss.n, name))


def distance_section(document: Document) -> Section | None:
    """Accuracy by distance to the keyframe."""
    runs = [run for run in document.runs if len(run.by_distance) > 1]
    rests = [Text(said) for run in document.runs if (said := _evidence(run))]
    ages = _ages(document)
    if not (runs or rests or ages):
        return None
    blocks: list[Block] = [Figure("distance", "mIoU over the distance to the keyframe")] if runs else []
    for run in runs:
        if run.by_distance_summary:
            blocks.append(Text(_summary(run, "distances", run.by_distance_summary)))
        note = "Offline pass. Distance 0 is the keyframe itself; ms: mean of capture time."
        blocks.append(Folded(f"By distance, {run.mode}", (_distances(run.by_distance, note),)))
    return Section("By distance to the keyframe", (*blocks, *rests, *ages))


def _ages(document: Document) -> list[Block]:
    """Accuracy by the age of the answer, of modes whose answers do not wait for the network."""
    blocks: list[Block] = []
    for run in document.runs:
        beside = run.background
        if beside is None or not beside.age_ms.n:
            continue
        oldest, mean = number(beside.age_ms.max, 0), number(beside.age_ms.mean, 0)
        said = f"`{run.mode}`: answers rest on keyframes {mean} ms old on average, at most {oldest} ms."
        if beside.by_age_summary:
            said += " " + _summary(run, "ages", beside.by_age_summary)
        blocks.append(Text(said))
        if beside.by_age:
            note = "Delivered. Age: from the keyframe that the labels come from to the frame; ms: mean of capture time."
            blocks.append(Folded(f"By age, {run.mode}", (_distances(beside.by_age, note),)))
    return blocks


def _summary(run: Run, what: str, summary: DistanceSummary) -> str:
    return (
        f"`{run.mode}`, over the {summary.distances} {what} with at least {summary.min_frames} frames: mIoU mean "
        f"{percent(summary.miou_mean)} %, minimum {percent(summary.miou_min)} %; pixel accuracy mean "
        f"{percent(summary.pixel_accuracy_mean)} %, minimum {percent(summary.pixel_accuracy_min)} %."
    )


def _evidence(run: Run) -> str:
    """What predicted answers rest on, and what they had to do without; "" where nobody says."""
    said = [] if run.covered is None else [f"{percent(run.covered)} % of the pixels of predicted answers are covered"]
    said += [f"{plural(frames, 'frame')} predicted with {what}" for what, frames in run.remarks.items()]
    answers = "offline" if run.clock == "offline" else "as delivered"
    return f"`{run.mode}`, {answers}: {'; '.join(said)}." if said else ""


def _distances(found: tuple[DistanceRow, ...], note: str) -> Table:
    told = any(row.covered is not None for row in found)
    columns = (
        Column("frames"), Column("ms"), Column("mIoU, %"), Column("pixel accuracy, %"),
        *((Column("covered, %"), Column("there: mIoU, %"), Column("there: pixel accuracy, %")) if told else ()),
        Column("n"),
    )  # fmt: skip
    rows = tuple(Row(_distance_cells(row, told)) for row in found)
    return Table(columns, rows, (note, f"Covered: {meaning(DistanceRow, 'covered')}") if told else (note,))


def _distance_cells(row: DistanceRow, told: bool) -> tuple[str, ...]:
    covered = (percent(row.covered), percent(row.covered_miou), percent(row.covered_pixel_accuracy))
    return (
        str(row.frames), number(row.ms, 0), percent(row.miou), percent(row.pixel_accuracy),
        *(covered if told else ()), count(row.n) + ("" if row.n >= ENOUGH else " (few)"),
    )  # fmt: skip


def classes_section(document: Document) -> Section | None:
    """IoU of every class, and the strata."""
    chosen = best_pass(document.runs)
    if chosen is None:
        return None
    first: Score = getattr(document.runs[0], chosen)
    classes = present_classes(first, document.input.classes)
    blocks: list[Block] = [Figure("classes", f"IoU of each class, {chosen}")]
    if document.input.classes_unknown_to_network:
        unknown = ", ".join(document.input.classes_unknown_to_network)
        blocks.append(Text(f"The network does not know: {unknown}. All their pixels are wrong; mIoU over the common "
                           f"classes is {_common(document, chosen)}."))  # fmt: skip
    absent = [name for name in document.input.classes if name not in classes]
    notes = (
        "IoU = TP / (TP + FP + FN), in %; one confusion matrix over all scored pixels.",
        *([f"Without truth pixels, and so not averaged: {', '.join(absent)}."] if absent else []),
    )
    blocks.append(Folded("IoU of each class", (_classes(document, first, classes, notes),)))
    if strata := _strata(document):
        blocks.append(strata)
    blocks += _consistency(document)
    return Section("Classes", tuple(blocks))


def _common(document: Document, chosen: str) -> str:
    found = []
    for run in document.runs:
        score: Score = getattr(run, chosen)
        found.append(f"{percent(score.miou_common)} % ({run.mode}, {score.classes_common} classes)")
    return ", ".join(found)


def _classes(document: Document, first: Score, classes: list[str], notes: tuple[str, ...]) -> Table:
    present = [(run, name, score) for run in document.runs for name in PASSES if (score := getattr(run, name))]
    columns = (Column("class", number=False), Column("share of truth, %"),
               *(Column(f"{run.mode}, {name}") for run, name, _ in present))  # fmt: skip
    total = sum(first.class_pixels.values())
    rows = [
        Row((name, number(100 * first.class_pixels.get(name, 0) / total) if total else NONE,
             *(percent(score.iou.get(name)) for _, _, score in present)))
        for name in classes
    ]  # fmt: skip
    rows.append(Row((f"mean of {len(classes)}", "", *(percent(score.miou) for _, _, score in present)), total=True))
    union = ("mean incl. predicted but absent (0)", "", *(percent(score.miou_union) for _, _, score in present))
    return Table(columns, (*rows, Row(union)), notes)


def _strata(document: Document) -> Table | None:
    runs = [run for run in document.runs if run.strata]
    if not runs:
        return None
    columns = (Column("mode", number=False), Column("frames answered by", number=False), Column("mIoU, %"),
               Column("pixel accuracy, %"), Column("classes averaged"), Column("n"))  # fmt: skip
    rows = tuple(
        Row(
            (
                run.mode,
                name,
                percent(score.miou),
                percent(score.pixel_accuracy),
                str(score.classes_averaged),
                count(score.n),
            )
        )
        for run in runs
        for name, score in run.strata.items()
    )  # fmt: skip
    return Table(columns, rows, (meaning(Run, "strata"),))


def _consistency(document: Document) -> list[Block]:
    return [
        Text(f"`{run.mode}`: temporal consistency {percent(found.score)} % over {plural(found.pairs, 'pair')} of "
             f"answers, carried by {found.correspondence}. {meaning(Consistency, 'score')}")
        for run in document.runs
        if (found := run.consistency) and found.score is not None
    ]  # fmt: skip
