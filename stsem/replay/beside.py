"""From keyframes segmented beside the answers to their part of the report."""

from stsem.document import background as doc
from stsem.log.log import Log
from stsem.metrics.durations import summarise
from stsem.metrics.scorecard import Accuracy
from stsem.replay import accuracy, timing
from stsem.replay.lanes import ModeRun


def background(log: Log, run: ModeRun, clocked: Accuracy | None) -> doc.Background | None:
    """What became of the frames chosen, and accuracy by age; None where answers wait for the network.

    Args:
        log: that was replayed.
        run: one mode.
        clocked: scores of its real-time pass; None without any.
    """
    beside = run.background
    if beside is None:
        return None
    return doc.Background(
        chosen=len(beside.chosen), finished=len(beside.finished), replaced=len(beside.replaced),
        unfinished=len(beside.unfinished), age_ms=timing.distribution(summarise(_ages_ns(log, run))),
        by_age=accuracy.distances(() if clocked is None else clocked.by_distance),
        by_age_summary=accuracy.distance_summary(None if clocked is None else clocked.distance_summary),
    )  # fmt: skip


def _ages_ns(log: Log, run: ModeRun) -> list[int]:
    """Capture time between each answered frame and its keyframe."""
    plans = log.plans
    return [plans[r.index].stamp_ns - plans[r.keyframe].stamp_ns for r in run.record.results if r.keyframe is not None]
