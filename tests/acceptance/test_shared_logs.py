"""The recorded logs through the whole line, and its scores against a script that shares no line with it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from .conftest import Replay
from .independent_scores import INTERVAL, scores, truth_images

pytestmark = pytest.mark.shared_logs

CAMVID, REPLICA, KITCHEN = "camvid-0016E5-15hz.mcap", "replica-floor1.mcap", "7scenes-kitchen-a.mcap"
ORACLE = ("--model", "oracle", "--keyframes", f"every:{INTERVAL}", "--propagation", "hold", "--clock", "offline")
EXACT = 1e-12


@pytest.mark.parametrize(("name", "frames"), [(CAMVID, 101), (REPLICA, 275)])
def test_scores_equal_those_of_an_independent_script(shared_logs: Path, replay: Replay, name: str, frames: int) -> None:
    """mIoU, pixel accuracy and every row by distance, to 1e-12; the oracle itself scores only what 255 costs it: 1."""
    path = shared_logs / name
    code, report = replay(path, *ORACLE, "--map", "off")
    assert code == 0
    per_frame, keyframe = report["runs"]
    expected: dict[str, Any] = scores(str(path))
    assert per_frame["offline"]["miou"] == per_frame["offline"]["pixel_accuracy"] == 1.0
    assert keyframe["outcomes"]["segmented"] == -(-frames // INTERVAL)
    assert keyframe["offline"]["n"] == frames
    for metric in ("miou", "pixel_accuracy"):
        assert keyframe["offline"][metric] == pytest.approx(expected[metric], rel=0, abs=EXACT)
    rows = {str(row["frames"]): row for row in keyframe["by_distance"]}
    assert rows.keys() == expected["by_distance"].keys()
    for distance, row in expected["by_distance"].items():
        assert rows[distance]["n"] == row["n"]
        for metric in ("miou", "pixel_accuracy"):
            assert rows[distance][metric] == pytest.approx(row[metric], rel=0, abs=EXACT)
    kept = [row for row in expected["by_distance"].values() if row["n"] >= 10]
    summary = keyframe["by_distance_summary"]
    assert summary["miou_mean"] == pytest.approx(np.mean([row["miou"] for row in kept]), rel=0, abs=EXACT)
    assert summary["miou_min"] == pytest.approx(min(row["miou"] for row in kept), rel=0, abs=EXACT)


@pytest.mark.torch
def test_scores_equal_those_of_torchmetrics(shared_logs: Path, replay: Replay) -> None:
    """IoU of every class and pixel accuracy, "no label" being one more class that no truth has."""
    torch = pytest.importorskip("torch")
    classification = pytest.importorskip("torchmetrics.classification")
    code, report = replay(shared_logs / CAMVID, *ORACLE, "--mode", "keyframe")
    assert code == 0
    (run,) = report["runs"]
    classes = report["input"]["classes"]
    options: dict[str, Any] = {"num_classes": len(classes) + 1, "ignore_index": 255}
    iou = classification.MulticlassJaccardIndex(average="none", **options)
    accuracy = classification.MulticlassAccuracy(average="micro", **options)
    images = truth_images(str(shared_logs / CAMVID))
    for i, truth in enumerate(images):
        answer = images[i - i % INTERVAL].astype(np.int64)
        answer[answer == 255] = len(classes)
        for metric in (iou, accuracy):
            metric.update(torch.from_numpy(answer), torch.from_numpy(truth.astype(np.int64)))
    found = dict(zip(classes, iou.compute().double().tolist(), strict=False))
    shown = {name: value for name, value in run["offline"]["iou"].items() if run["offline"]["class_pixels"][name]}
    assert shown == pytest.approx({name: found[name] for name in shown}, rel=0, abs=1e-6)  # torchmetrics is float32
    assert run["offline"]["miou"] == pytest.approx(np.mean([found[name] for name in shown]), rel=0, abs=1e-6)
    assert run["offline"]["pixel_accuracy"] == pytest.approx(float(accuracy.compute()), rel=0, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "seconds", "frames", "channels", "measured"),
    [
        (CAMVID, 2, 30, {"color", "labels"}, False),  # streets: no class in common
        (REPLICA, 4, 20, {"color", "depth", "pose", "labels", "camera"}, True),
        (KITCHEN, 1, 30, {"color", "depth", "pose", "camera"}, False),
    ],
)
def test_the_shipped_network_without_flags(
    shared_logs: Path, replay: Replay, name: str, seconds: int, frames: int, channels: set[str], measured: bool
) -> None:
    """Channels are found, every frame is accounted for, timing is there, and accuracy where there is truth."""
    code, report = replay(shared_logs / name, "--end", seconds)
    assert code == 0
    assert report["state"] == "valid"
    (log,) = report["input"]["logs"]
    assert log["frames"] == frames
    assert set(log["channels"]) == channels
    assert (report["accuracy_state"] == "measured") == measured
    for run in report["runs"]:
        assert sum(run["outcomes"].values()) == frames
        assert run["throughput"]["output_hz"] > 0
        assert run["latency_ms"]["from_arrival"]["n"] == run["throughput"]["outputs"] > 0
        assert (run["streaming"] is not None) == measured
        assert (run["map"] is not None) == ({"depth", "pose", "camera"} <= channels)


@pytest.mark.parametrize(("name", "seconds", "frames"), [(CAMVID, 4, 60), (REPLICA, 10, 50)])
def test_the_oracle_in_real_time(shared_logs: Path, replay: Replay, name: str, seconds: int, frames: int) -> None:
    """A perfect network loses only by prediction and by time, and the parts of the loss sum to the whole."""
    code, report = replay(shared_logs / name, "--model", "oracle", "--end", seconds)
    assert code == 0
    for run in report["runs"]:
        assert sum(run["outcomes"].values()) == frames
        assert run["outcomes"]["no_source"] == 0
        assert run["loss"]["network"] == 0.0
        parts = [run["loss"][part] for part in ("network", "prediction", "scheduling", "staleness")]
        assert sum(parts) == pytest.approx(1 - run["streaming"]["miou"], abs=EXACT)
    assert report["runs"][0]["delivered"]["miou"] == 1.0
