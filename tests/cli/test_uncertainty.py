"""What a network says of its own answers, from its file to every view of the report."""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from stsem.document.difference import first_differences, repeatable_files
from stsem.log.log import open_log
from stsem.uncertainty import DOUBT, MEASURES

from .conftest import Cli, report, rows

pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from .unsure_network import write_network

TITLES = ("## Confidence\n", "## Uncertainty\n")


@pytest.fixture
def unsure(tmp_path: Path) -> Path:
    """A network with maps of uncertainty."""
    return write_network(tmp_path / "unsure.onnx", measures=True)


@pytest.fixture
def silent(tmp_path: Path) -> Path:
    """The same network without."""
    return write_network(tmp_path / "silent.onnx", measures=False)


def _images(folder: Path, mode: str) -> dict[str, dict[int, np.ndarray]]:
    """Topic below the mode -> stamp -> pixels, of every raw image in annotated.mcap."""
    found: dict[str, dict[int, np.ndarray]] = {}
    with (folder / "annotated.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        topics = [f"/stsem/{mode}/labels", *(f"/stsem/{mode}/uncertainty/{measure}" for measure in MEASURES)]
        for _, channel, message, image in reader.iter_decoded_messages(topics):
            pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, -1)
            assert image.encoding == {1: "mono8", 3: "rgb8"}[pixels.shape[2]]
            found.setdefault(channel.topic.removeprefix(f"/stsem/{mode}/"), {})[message.log_time] = pixels
    return found


def _metadata(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "annotated.mcap").open("rb") as file:
        return {record.name: record.metadata for record in make_reader(file).iter_metadata()}


def _topics(folder: Path) -> Counter[str]:
    with (folder / "annotated.mcap").open("rb") as file:
        return Counter(channel.topic for _, channel, _ in make_reader(file).iter_messages())


def _sorted_area(scores: np.ndarray, wrong: np.ndarray) -> float:
    """Share of (wrong, right) pairs in the right order, ties half: by ranks."""
    _, place, many = np.unique(scores, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(many) - (many - 1) / 2)[place]
    positive = int(wrong.sum())
    area = (ranks[wrong].sum() - positive * (positive + 1) / 2) / (positive * (~wrong).sum())
    return float(area)


def test_the_same_bytes_twice(cli: Cli, home: Path, tiny_log: Path, made_up_costs: Path, unsure: Path) -> None:
    """Cold and from the cache, the annotated log included; pictures are drawn the first time only."""
    for name, *plots in (("cold",), ("warm", "--no-plots")):
        ran = cli("replay", tiny_log, "--model", unsure, "--costs", made_up_costs, "--mode", "per-frame",
                  "--end", "0.4", "--annotate", "--out", name, *plots)  # fmt: skip
        assert ran.code == 0, ran.err
    cold, warm = repeatable_files(home / "cold"), repeatable_files(home / "warm")
    drawn = {name for name in cold if name.startswith("plots/")}
    assert {"plots/calibration.png", "plots/uncertainty.png"} < drawn
    assert first_differences({name: data for name, data in cold.items() if name not in drawn}, warm) == ()
    assert (home / "cold" / "annotated.mcap").read_bytes() == (home / "warm" / "annotated.mcap").read_bytes()
    text = (home / "cold" / "report.md").read_text()
    assert all(title in text for title in TITLES)
    assert "(plots/uncertainty.png)" in text


def test_maps_stand_at_the_stamps_of_segmented_frames(replay: Cli, home: Path, tiny_log: Path, unsure: Path) -> None:
    """One of each measure per segmented frame of each mode, at its capture stamp, and what a level means."""
    assert replay(tiny_log, "--model", unsure, "--annotate", "--out", "r").code == 0
    for mode in ("per-frame", "keyframe"):
        images = _images(home / "r", mode)
        stamps = {
            int(row["log_stamp_ns"]) for row in rows("r") if row["mode"] == mode and row["outcome"] == "segmented"
        }
        assert stamps
        for measure in MEASURES:
            found = images[f"uncertainty/{measure}"]
            assert set(found) == stamps
            assert all(pixels.shape == (64, 96, 1) for pixels in found.values())
    assert _metadata(home / "r")["stsem.uncertainty"] == {
        "variance": "value = 0.22222 (level / 255)^4", "entropy": "value = 1.0986 nats (level / 255)^4",
        "mutual_information": "value = 1.0986 nats (level / 255)^4",
    }  # fmt: skip


def test_the_areas_are_those_of_the_written_maps(replay: Cli, home: Path, tiny_log: Path, unsure: Path) -> None:
    """report.json against ranks of all pixels in annotated.mcap, and the log's truth."""
    assert replay(tiny_log, "--model", unsure, "--clock", "offline", "--annotate", "--out", "r").code == 0
    with open_log([tiny_log]) as log:
        truth = {plan.stamp_ns: log.truth(plan.index) for plan in log.plans}
        assert log.classes is not None
        palette = log.classes.palette()
    for run in report("r")["runs"]:
        images = _images(home / "r", run["mode"])
        wrong, levels = [], {measure: [] for measure in MEASURES}
        for stamp in images["uncertainty/entropy"]:
            true = truth[stamp]
            assert true is not None
            judged = true < 3
            wrong.append((images["labels"][stamp] != palette[true]).any(axis=2)[judged])
            for measure, kept in levels.items():
                kept.append(images[f"uncertainty/{measure}"][stamp][..., 0][judged])
        found, everywhere = run["error_detection"], np.concatenate(wrong)
        assert (found["judged"], found["n"], found["pixels"]) == ("offline", len(run["keyframes"]), everywhere.size)
        assert found["wrong_share"] == pytest.approx(everywhere.mean())
        assert set(found["auc"]) == {DOUBT, *MEASURES}
        for measure, kept in levels.items():
            assert found["auc"][measure] == pytest.approx(_sorted_area(np.concatenate(kept), everywhere), abs=1e-9)


def test_calibration_covers_every_kind_of_answer(replay: Cli, home: Path, tiny_log: Path, silent: Path) -> None:
    """Each part's accuracy is that of the confusion matrix of the same frames; bins add up."""
    assert replay(tiny_log, "--model", silent, "--out", "r").code == 0
    per_frame, keyframe = report("r")["runs"]
    assert set(per_frame["calibration"]) == {"segmented", "delivered"}
    assert set(keyframe["calibration"]) == {"segmented", "propagated", "delivered"}
    for name, part in keyframe["calibration"].items():
        score: dict[str, Any] = keyframe["strata"].get(name) or keyframe[name]
        assert part["accuracy"] == pytest.approx(score["pixel_accuracy"])
        assert (part["n"], part["pixels"]) == (score["n"], score["pixels"])
        assert sum(bin_["pixels"] for bin_ in part["bins"]) == part["pixels"]
        assert part["ece"] == pytest.approx(sum(
            bin_["pixels"] / part["pixels"] * abs(bin_["accuracy"] - bin_["confidence"])
            for bin_ in part["bins"] if bin_["pixels"]
        ))  # fmt: skip
        assert 0 < part["ece"] <= part["mce"]


def test_without_an_offline_pass_the_delivered_answers_are_judged(
    replay: Cli, home: Path, tiny_log: Path, unsure: Path
) -> None:
    assert replay(tiny_log, "--model", unsure, "--no-offline", "--mode", "keyframe", "--out", "r").code == 0
    (run,) = report("r")["runs"]
    assert set(run["calibration"]) == {"delivered"}
    assert run["error_detection"]["judged"] == "delivered"
    assert run["error_detection"]["n"] == run["outcomes"]["segmented"]


def test_a_network_without_maps_says_nothing_of_them(replay: Cli, home: Path, tiny_log: Path, silent: Path) -> None:
    """Its confidence is judged; there is no map, no picture, no channel."""
    assert replay(tiny_log, "--model", silent, "--annotate", "--out", "r").code == 0
    assert all(set(run["error_detection"]["auc"]) == {DOUBT} for run in report("r")["runs"])
    assert not any("uncertainty" in topic for topic in _topics(home / "r"))
    assert "stsem.uncertainty" not in _metadata(home / "r")
    text = (home / "r" / "report.md").read_text()
    assert TITLES[0] in text
    assert TITLES[1] not in text
    assert "entropy" not in text


def test_the_oracle_states_no_confidence(replay: Cli, home: Path, tiny_log: Path) -> None:
    assert replay(tiny_log, "--model", "oracle", "--out", "r").code == 0
    assert all((run["calibration"], run["error_detection"]) == ({}, None) for run in report("r")["runs"])
    assert not any(title in (home / "r" / "report.md").read_text() for title in TITLES)
