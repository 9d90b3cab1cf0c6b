"""Whether the answers know when they are wrong: calibration of the confidence, and measures of uncertainty."""

from stsem.document.calibration import Calibration, ErrorDetection
from stsem.document.schema import Document, Run
from stsem.report.outline import Block, Column, Figure, Row, Section, Table, Text
from stsem.report.wording import MEASURES, NOT_MEASURED, count, meaning, number, percent
from stsem.uncertainty import DOUBT

_PARTS = {"segmented": "segmented", "propagated": "propagated", "delivered": "all"}


def calibration_section(document: Document) -> Section | None:
    """Two tables and their figures; None where no answer that could be judged states a confidence."""
    runs = [run for run in document.runs if run.calibration]
    if not runs:
        return None
    detections = [(run, run.error_detection) for run in runs if run.error_detection is not None]
    blocks: list[Block] = [
        Figure("calibration", "accuracy over confidence, and the share of pixels"),
        _calibration(runs),
    ]
    if detections:
        blocks.append(Text("**Which number finds the wrong pixels?** Area under the ROC curve, over segmented frames."))
        blocks.append(_detection(detections))
    return Section("Confidence", tuple(blocks))


def uncertainty_section(judged: bool) -> Section:
    """The picture of the frame that the network is least sure of; `judged`: whether there is truth to compare with."""
    text = (
        "The segmented frame with the largest mean uncertainty (mutual information where the network gives it). The "
        "colours of each map reach from the value that 1 % of its pixels stay below to the one that 1 % exceed."
    )
    if judged:
        text += (
            " Wrong pixels that stay dark in a map are those that it does not find. AUC: over all segmented frames, as "
            "in the section above."
        )
    return Section(
        "Uncertainty", (Figure("uncertainty", "image, truth, answer, errors and maps of a frame"), Text(text))
    )


def _calibration(runs: list[Run]) -> Table:
    columns = (
        Column("mode", number=False), Column("answers", number=False), Column("pass", number=False),
        Column("ECE, %", meaning(Calibration, "ece")), Column("MCE, %", meaning(Calibration, "mce")),
        Column("mean confidence, %", meaning(Calibration, "confidence")),
        Column("accuracy, %", meaning(Calibration, "accuracy")), Column("pixels"), Column("n", "frames"),
    )  # fmt: skip
    rows = tuple(
        Row((run.mode, words, found.judged, percent(found.ece), percent(found.mce), percent(found.confidence),
             percent(found.accuracy), count(found.pixels), count(found.n)))
        for run in runs
        for name, words in _PARTS.items()
        if (found := run.calibration.get(name))
    )  # fmt: skip
    notes = (
        f"ECE: {meaning(Calibration, 'ece')} MCE: {meaning(Calibration, 'mce')}",
        "A propagated pixel has the confidence that the network had in its keyframe: nothing is taken off for having "
        "been predicted.",
    )
    return Table(columns, rows, notes)


def _detection(found: list[tuple[Run, ErrorDetection]]) -> Table:
    columns = (Column("measure", number=False), *(Column(run.mode) for run, _ in found))
    shown = [name for name in MEASURES if any(name in detection.auc for _, detection in found)]
    rows = [Row((MEASURES[name], *(_area(detection, name) for _, detection in found))) for name in shown]
    wrong = Row(("wrong pixels, %", *(percent(detection.wrong_share) for _, detection in found)))
    frames = Row(("n, frames", *(count(detection.n) for _, detection in found)))
    judged = ", ".join(dict.fromkeys(detection.judged for _, detection in found))
    maps = ": propagated ones have no maps of their own" if set(shown) - {DOUBT} else ""
    notes = (meaning(ErrorDetection, "auc"), f"Pass: {judged}. Only frames that the network segmented{maps}.")
    return Table(columns, (*rows, wrong, frames), notes)


def _area(detection: ErrorDetection, measure: str) -> str:
    area = detection.auc.get(measure)
    return NOT_MEASURED if area is None else number(area, 3)
