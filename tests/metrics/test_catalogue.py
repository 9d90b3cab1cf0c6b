from pathlib import Path

import pytest

from stsem.document.accuracy import Consistency, Coverage, DistanceRow, DistanceSummary, Loss, Score
from stsem.document.calibration import Calibration, ErrorDetection, ReliabilityBin
from stsem.document.part import Part
from stsem.document.schema import MapScore
from stsem.document.timing import Distribution, Latency, Outcomes, Throughput
from stsem.document.trajectory import TrajectoryScore
from stsem.metrics.catalogue import CATALOGUE, facts

DOCUMENTATION = Path(__file__).parents[2] / "docs" / "metrics.md"


def test_every_number_has_unit_and_direction() -> None:
    """Paths of the report find their facts; an unknown one is an error that lists the patterns."""
    assert facts("offline.miou").higher_is_better
    assert facts("strata.propagated.iou.wall").unit == "fraction"
    assert facts("latency_ms.stages.segment.service.p95").unit == "ms"
    assert facts("outcomes.dropped_busy").higher_is_better is False
    assert facts("outcomes.propagated").higher_is_better is None
    assert facts("throughput.output_hz").unit == "Hz"
    assert facts("trajectory.ate_rmse_m").higher_is_better is False
    assert facts("calibration.segmented.ece").higher_is_better is False
    assert facts("calibration.delivered.confidence").higher_is_better is None
    assert facts("error_detection.auc.entropy").higher_is_better
    with pytest.raises(ValueError, match="no number of a run is called 'vibes'"):
        facts("vibes")
    assert len({pattern for pattern, _ in CATALOGUE}) == len(CATALOGUE)


@pytest.mark.parametrize(
    "part",
    [Score, Loss, DistanceRow, DistanceSummary, Coverage, Consistency, Distribution, Latency, Throughput, Outcomes,
     TrajectoryScore, MapScore, Calibration, ErrorDetection, ReliabilityBin],
)  # fmt: skip
def test_every_number_of_the_report_is_defined(part: type[Part]) -> None:
    """docs/metrics.md names every key of the report's numbers."""
    text = DOCUMENTATION.read_text(encoding="utf-8")
    basis = {"why", "frames", "n", "ms", "pose", "pairs", "score"}
    assert [name for name in part.model_fields if name not in basis and name not in text] == []


@pytest.mark.parametrize(
    ("prefix", "part"),
    [
        ("loss", Loss),
        ("throughput", Throughput),
        ("outcomes", Outcomes),
        ("trajectory", TrajectoryScore),
        ("map", MapScore),
    ],
)
def test_every_number_of_a_run_is_in_the_catalogue(prefix: str, part: type[Part]) -> None:
    """Whatever the schema calls a number of a run has a unit and a direction."""
    basis = {"why", "n", "pose", "outputs", "deadline_ms", "sides"}
    units = {facts(f"{prefix}.{name}").unit for name in part.model_fields if name not in basis}
    assert units <= {"fraction", "ms", "Hz", "frames", "m", "deg", "1", "points", "voxels"}
