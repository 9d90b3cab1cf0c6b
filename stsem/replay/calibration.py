"""From what the records counted to the calibration part of a report."""

from stsem.document import calibration as doc
from stsem.metrics.calibration import Detection
from stsem.metrics.reliability import Reliability
from stsem.replay.lanes import ModeRun
from stsem.replay.record import Record


def calibration(run: ModeRun) -> dict[str, doc.Calibration]:
    """Segmented and predicted answers of the offline pass, and all answers of the real-time run, where measured."""
    offline = None if run.offline is None or run.offline.calibration is None else run.offline.calibration.compute()
    clocked = _clocked(run.real_time)
    found = {
        "segmented": None if offline is None else _part(offline.segmented, "offline"),
        "propagated": None if offline is None else _part(offline.propagated, "offline"),
        "delivered": clocked,
    }
    return {name: part for name, part in found.items() if part is not None}


def error_detection(run: ModeRun) -> doc.ErrorDetection | None:
    """Of the offline pass, or of the real-time run if there is no other; None where nothing states a confidence."""
    passes: tuple[tuple[doc.Judged, Record | None], ...] = (("offline", run.offline), ("delivered", run.real_time))
    for judged, record in passes:
        if record is not None and record.calibration is not None:
            found = record.calibration.compute().detection
            if found is not None:
                return _detection(found, judged)
    return None


def _clocked(record: Record | None) -> doc.Calibration | None:
    if record is None or record.calibration is None:
        return None
    return _part(record.calibration.compute().answered, "delivered")


def _part(found: Reliability | None, judged: doc.Judged) -> doc.Calibration | None:
    if found is None:
        return None
    return doc.Calibration(
        judged=judged, ece=found.ece, mce=found.mce, confidence=found.confidence, accuracy=found.accuracy,
        pixels=found.pixels, n=found.frames,
        bins=tuple(
            doc.ReliabilityBin(
                lower=b.lower, upper=b.upper, pixels=b.pixels, confidence=b.confidence, accuracy=b.accuracy
            )
            for b in found.bins
        ),
    )  # fmt: skip


def _detection(found: Detection, judged: doc.Judged) -> doc.ErrorDetection:
    return doc.ErrorDetection(
        judged=judged, auc=dict(found.auc), wrong_share=found.wrong, pixels=found.pixels, n=found.frames
    )
