"""A cell is trained once, judged on the test set, and says what it is."""
# ruff: noqa: E402 - torch is asked for first, so that without it the file is skipped

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from bench.paper import cell as cells
from bench.paper.data import Data
from bench.paper.facts import facts_of
from bench.paper.plan import find_cell
from bench.paper.problem import Place
from stsem import hostclock
from stsem.classes import ClassSet
from stsem.errors import TrainingError
from stsem.metrics.scores import scores
from stsem.train.dataset import Pair, save_pair
from stsem.train.judge import judge
from stsem.train.publish import load_checkpoint
from stsem.train.stages import Progress, train_stage

pytestmark = pytest.mark.torch


def _pair(seed: int) -> Pair:
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 3, (2, 5, 5), np.uint8).repeat(9, 1).repeat(9, 2)
    images = np.array([[20, 20, 20], [220, 40, 40], [40, 220, 40]], np.uint8)[labels]
    return Pair(images, labels)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Data:
    """Ten pairs to learn from and four to be judged on, two iterations a training."""
    folder = tmp_path_factory.mktemp("pairs")
    for which, seeds in (("train", range(10)), ("test", range(90, 94))):
        (folder / which).mkdir()
        for seed in seeds:
            save_pair(folder / which / f"00000_{seed:02}.npz", _pair(seed))
    classes = ClassSet(("wall", "floor", "lamp"))
    return Data("offices", folder, None, classes, (41, 41), ("floor", "lamp"), Place(0, 0), (2, 2))


def _run(data: Data, out: Path, *keys: str) -> list[cells.Result]:
    facts, results = facts_of(data, out), []
    for key in keys:
        cell = find_cell(key)
        cells.run_cell(cell, data, facts, out, lambda _: None)
        results.append(json.loads(cells.result_path(out, data.name, cell).read_text()))
    return results


def test_streams_and_what_is_made_of_them(data: Data, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every kind of start; numbers of the result against the judge; what is done is not trained again."""
    keys = ("spatial-first/0", "temporal-first/0", "spatial/0", "sum/0", "spatial-first-one/0")
    first, *_, summed, wrong = _run(data, tmp_path, *keys)
    network = load_checkpoint(tmp_path / "cells" / "offices" / "sum-0" / "checkpoint.pt", 3)
    assert cells.weights_sha256(network) == summed["weights_sha256"]
    judged = judge(network, data.sidecar, data.pairs("test")).compute()
    assert scores(np.array(summed["matrix"], np.int64)).miou == judged.miou
    assert judged.pixels == 4 * 45 * 45
    assert summed["starts"] == {"colour": "spatial-first/0", "difference": "temporal-first/0"}
    assert first["weights_sha256"] != wrong["weights_sha256"]
    problem = facts_of(data, tmp_path).problem
    floor = int((data.pairs("train").pair(problem.pair).labels[1] == problem.floor).sum())
    assert first["neighbour"]["floor_pixels"] == floor

    def train_again(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(cells, "train_stage", train_again)
    assert _run(data, tmp_path, *keys)[-1] == wrong


def test_the_time_of_all_processes_is_summed(data: Data, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One is stopped at its first report after 5 s, the next takes 7 s: by a clock that only the test moves."""
    clock, cell = [100 * 10**9], find_cell("spatial-first/0")
    monkeypatch.setattr(hostclock, "process_cpu_ns", lambda: clock[0])

    def stopped(*arguments: Any) -> Path:
        clock[0] += 5 * 10**9
        arguments[4](Progress("colour", 1, 2, 0.0, 0.0, None))
        raise TrainingError("stopped")

    def trained(*arguments: Any) -> Path:
        clock[0] += 7 * 10**9
        return train_stage(*arguments)

    facts = facts_of(data, tmp_path)
    monkeypatch.setattr(cells, "train_stage", stopped)
    with pytest.raises(TrainingError, match="stopped"):
        cells.run_cell(cell, data, facts, tmp_path, lambda _: None)
    clock[0] = 3 * 10**9  # another process
    monkeypatch.setattr(cells, "train_stage", trained)
    cells.run_cell(cell, data, facts, tmp_path, lambda _: None)
    result = json.loads(cells.result_path(tmp_path, data.name, cell).read_text())
    assert result["host"]["training_cpu_s_all_processes"] == 12


def test_results_of_another_training_are_refused(data: Data, tmp_path: Path) -> None:
    """Other numbers under the same name; and a fused network before its streams."""
    _run(data, tmp_path, "spatial-first/0")
    other = replace(data, iterations=(3, 2))
    with pytest.raises(TrainingError, match="its recipe differ"):
        _run(other, tmp_path, "spatial-first/0")
    with pytest.raises(TrainingError, match="run that cell first"):
        _run(data, tmp_path, "sum/0")


def test_facts_follow_the_pixels(data: Data, tmp_path: Path) -> None:
    """Kept while the pairs stay; the hash is of every image, label and depth."""
    facts = facts_of(data, tmp_path)
    assert facts_of(data, tmp_path) == facts
    assert facts.pairs == {"train": 10, "test": 4}
    folder = tmp_path / "other"
    for which in ("train", "test"):
        (folder / which).mkdir(parents=True)
        for k, seed in enumerate(range(10)):
            pair = _pair(seed)
            pair.labels[0, 0, 0] ^= which == "test" and k == 7
            save_pair(folder / which / f"00000_{k:02}.npz", pair)
    other = facts_of(replace(data, folder=folder), tmp_path / "b")
    assert other.sha256["train"] == facts.sha256["train"]
    assert other.sha256["test"] != other.sha256["train"]
