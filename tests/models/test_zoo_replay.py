"""Every network of the zoo, narrow, from torch to a report: exported and replayed over five frames."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from stsem.cli.session import replay_all
from stsem.document.canonical import read_document
from stsem.inference.inferencer import Inferencer
from stsem.inference.preprocess import network_inputs
from stsem.log.log import open_log
from stsem.models.export import agreement
from stsem.models.zoo import ZOO
from stsem.replay.settings import validated
from stsem.sim.profile import CostProfile
from tests.made_up_walk import write_walk

from .conftest import CLASSES, Exported

pytestmark = pytest.mark.torch
FRAMES, SIZE = 5, (96, 64)
MS = 1_000_000


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five frames with depth, poses and truth; the second frame has no depth."""
    return write_walk(tmp_path_factory.mktemp("walk") / "walk.mcap", frames=FRAMES, size=SIZE, depth=lambda i: i != 1)


@pytest.fixture(scope="module")
def costs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The network takes 60 of the 100 ms between two frames."""
    path = tmp_path_factory.mktemp("costs") / "costs.json"
    CostProfile("made up", {"segment@2": (60 * MS,), "register@1": (MS,), "propagate@1": (MS,), "fuse@1": (MS,)}).save(
        path
    )
    return path


@pytest.mark.parametrize("name", ZOO)
def test_five_frames(
    name: str, exported: Callable[[str], Exported], log: Path, costs: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Every frame has its answer in both modes and is scored; what the network is given is what it has inputs for."""
    monkeypatch.setenv("STSEM_CACHE", str(tmp_path / "cache"))
    made = exported(name)
    settings = validated({
        "model": str(made.published.path), "keyframes": "every:2", "costs": str(costs), "out": tmp_path / "r",
        "plots": False,
    })  # fmt: skip
    assert replay_all([(str(log),)], settings) == 0
    document = read_document(tmp_path / "r")
    assert document.identity.model_inputs == made.published.sidecar.inputs
    assert any("1 of 5 frames have no depth" in said for said in document.warnings) == made.published.has_depth
    outcomes = {run.mode: (run.outcomes.segmented, run.outcomes.propagated) for run in document.runs}
    assert outcomes == {"per-frame": (5, 0), "keyframe": (3, 2)}
    for run in document.runs:
        assert run.coverage.scored == FRAMES
        assert run.offline is not None
        assert run.offline.pixels == FRAMES * SIZE[0] * (SIZE[1] - 3)  # the walk's first rows have no truth
        assert run.offline.classes_averaged == 3


@pytest.mark.parametrize("name", ZOO)
def test_the_exported_graph_answers_as_torch(name: str, exported: Callable[[str], Exported], log: Path) -> None:
    """Labels on 99.99 % of the pixels, confidence to 1e-4, maps to 1e-3, on a frame of the log with its depth; labels
    come back at the image's size. Probabilities are no constant."""
    made = exported(name)
    with open_log([log]) as opened:
        frame = opened.frame(2, depth=True, previous=True)
    inputs = network_inputs(frame.image, frame.previous, made.published.sidecar, frame.depth)
    assert set(made.network.inputs) <= inputs.keys()
    found = agreement(made.network, made.published.path, inputs, made.passes)
    assert found.holds, found
    session = onnxruntime.InferenceSession(str(made.published.path), providers=["CPUExecutionProvider"])
    (confidence,) = session.run(["confidence"], inputs)
    assert confidence.shape == (1, *made.published.size[::-1])
    assert np.unique(confidence).size > 100
    assert confidence.min() >= 1 / len(CLASSES) - 1e-6
    answer = Inferencer(made.published, threads=1).infer(frame)
    assert answer.labels.shape == SIZE[::-1]
    assert answer.labels.max() < len(CLASSES)
    assert np.isfinite(answer.confidence).all()
