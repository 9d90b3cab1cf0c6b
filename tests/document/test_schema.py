"""The schema is published, complete, and described."""

import json
from collections.abc import Iterator
from pathlib import Path

from stsem.document.accuracy import Score
from stsem.document.part import Part, definition
from stsem.document.schema import Document, json_schema

PUBLISHED = Path(__file__).parents[2] / "docs" / "report.schema.json"

PROMISED = {
    "Document": "schema_version state accuracy_state digest verdict identity input config config_hash runs comparison "
    "host",
    "Identity": "backend versions precision cpu_features model_sha256 costs_sha256",
    "LogInput": "name sha256 frames frames_with_truth duration_s damage",
    "Run": "mode clock outcomes keyframes offline delivered streaming loss strata by_distance "
    "latency_ms throughput trajectory map",
    "Outcomes": "segmented propagated no_source dropped_busy undecodable incomplete pending",
    "Score": "miou miou_union pixel_accuracy classes_averaged pixels iou misses",
    "Loss": "network prediction scheduling staleness",
    "DistanceRow": "frames miou pixel_accuracy n",
    "Latency": "from_arrival from_stamp waiting stages",
    "Distribution": "p50 p90 p95 p99 max mean n",
    "Throughput": "output_hz offered_hz processed_share utilisation deadline_misses sustainable_hz",
    "TrajectoryScore": "pose tracked_share ate_rmse_m",
    "MapScore": "miou_3d miou_3d_observed observed_share accuracy_3d f_score outlier_share voxels",
    "Comparison": "base other rows",
    "ComparisonRow": "metric base other delta ci95",
}
"""The keys that outside programs rely on (DESIGN 9)."""


def parts(root: type[Part] = Part) -> Iterator[type[Part]]:
    for part in root.__subclasses__():
        yield part
        yield from parts(part)


def test_published_schema_is_up_to_date() -> None:
    """docs/report.schema.json is what the code says; write it again with `json_schema` when this fails."""
    assert json.loads(PUBLISHED.read_text()) == json_schema()


def test_promised_keys_are_there() -> None:
    found = {part.__name__: set(part.model_fields) for part in parts() if part.__module__.startswith("stsem.document")}
    missing = {
        name: set(keys.split()) - found[name] for name, keys in PROMISED.items() if set(keys.split()) - found[name]
    }
    assert missing == {}


def test_every_field_is_described() -> None:
    """Every number says what it means."""
    bare = [
        f"{part.__name__}.{name}"
        for part in parts()
        if part.__module__.startswith("stsem.")
        for name, field in part.model_fields.items()
        if not (field.description or "").endswith((".", ")"))
    ]
    assert bare == []
    assert definition(Score, "miou").startswith("Mean of the IoU over the classes that have truth pixels")


def test_schema_names_its_version() -> None:
    assert json_schema()["properties"]["schema_version"]["const"] == 1  # type: ignore[index, call-overload]
    assert Document.model_config["extra"] == "forbid"
