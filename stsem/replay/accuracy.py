"""From scorecards to the accuracy part of a report."""

from collections.abc import Mapping

from stsem.classes import ClassSet
from stsem.document import accuracy as doc
from stsem.metrics.accumulate import Judged
from stsem.metrics.by_distance import DistanceRow, DistanceSummary
from stsem.metrics.consistency import ConsistencyMeter
from stsem.metrics.loss import Part
from stsem.metrics.scorecard import Accuracy
from stsem.metrics.scores import tally


def score(judged: Judged | None, classes: ClassSet) -> doc.Score | None:
    """One judgement as the report has it; None when it was not measured."""
    if judged is None:
        return None
    found, counts = judged.scores, tally(judged.matrix)
    pixels = {name: int(counts[1, i]) for i, name in enumerate(classes.names)}
    unlabelled = int(judged.matrix[:, -1].sum())
    return doc.Score(
        miou=found.miou, miou_union=found.miou_union, pixel_accuracy=found.pixel_accuracy,
        classes_averaged=found.classes_averaged, pixels=found.pixels,
        iou=dict(zip(classes.names, found.iou.tolist(), strict=True)), misses=judged.misses, n=judged.frames,
        miou_common=judged.miou_common, classes_common=judged.classes_common or 0, class_pixels=pixels,
        unlabelled_share=unlabelled / found.pixels if found.pixels else None,
    )  # fmt: skip


def strata(found: Accuracy | None, classes: ClassSet) -> dict[str, doc.Score]:
    """Scores of the segmented and of the propagated frames, and of what the latter cover."""
    if found is None:
        return {}
    scores = {name: score(judged, classes) for name, judged in found.strata.items()}
    return {name: value for name, value in scores.items() if value is not None}


def distances(rows: tuple[DistanceRow, ...]) -> tuple[doc.DistanceRow, ...]:
    """Accuracy over the distance to the keyframe."""
    return tuple(
        doc.DistanceRow(
            frames=r.frames, ms=r.ms, miou=r.miou, pixel_accuracy=r.pixel_accuracy, n=r.n, covered=r.covered,
            covered_miou=r.covered_miou, covered_pixel_accuracy=r.covered_pixel_accuracy,
        )
        for r in rows
    )  # fmt: skip


def distance_summary(found: DistanceSummary | None) -> doc.DistanceSummary | None:
    """Mean and minimum over the distances."""
    if found is None:
        return None
    return doc.DistanceSummary(
        miou_mean=found.miou_mean, miou_min=found.miou_min, pixel_accuracy_mean=found.pixel_accuracy_mean,
        pixel_accuracy_min=found.pixel_accuracy_min, distances=found.distances, min_frames=found.min_frames,
    )  # fmt: skip


def loss(parts: Mapping[str, Part | None], why: Mapping[str, str]) -> doc.Loss:
    """The four parts of the loss, by name; None: not measured, for the reason in `why`."""
    values = {name: None if part is None else part.value for name, part in parts.items()}
    counts = {name: 0 if part is None else part.n for name, part in parts.items()}
    return doc.Loss(
        network=values["network"], prediction=values["prediction"], scheduling=values["scheduling"],
        staleness=values["staleness"], n=doc.LossParts.model_validate(counts), why=dict(why),
    )  # fmt: skip


def consistency(meter: ConsistencyMeter | None) -> doc.Consistency | None:
    """Agreement of consecutive answers; None without a pair of them."""
    if meter is None or (found := meter.compute()).pairs == 0:
        return None
    return doc.Consistency(score=found.miou, pairs=found.pairs, correspondence=found.correspondence)
