"""Every backend in every precision: the same labels, the same bytes whatever the threads, and clear refusals."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from stsem.errors import MissingExtraError, NetworkError, UsageError
from stsem.frame import Frame
from stsem.inference.backends import BACKENDS, choose_backend, open_vino
from stsem.inference.inferencer import Inferencer, Output
from stsem.inference.network import Network, load_network
from stsem.log.log import open_log
from stsem.quantize.static import quantize
from tests.made_up_network import write_network

ROOT = Path(__file__).resolve().parents[2]
ROWS = [(backend, precision) for backend, row in BACKENDS.items() for precision in row.precisions]
needs_openvino = pytest.mark.skipif(
    importlib.util.find_spec("openvino") is None, reason="the extra 'openvino' is not installed"
)


def _available(backend: str, precision: str) -> None:
    """Skip what this installation or this processor cannot do."""
    if backend == "openvino" and importlib.util.find_spec("openvino") is None:
        pytest.skip("the extra 'openvino' is not installed")
    try:
        choose_backend(backend, precision)
    except UsageError as err:
        assert precision == "bf16"
        pytest.skip(str(err))


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    """Ten rendered frames with depth."""
    with open_log([ROOT / "logs" / "tiny-a.mcap"]) as log:
        found = log.frames(range(0, 30, 3), depth=True, previous=True, truth=False)
        return [loaded.frame for loaded in found if loaded.frame is not None]


@pytest.fixture(scope="module")
def network(frames: list[Frame], tmp_path_factory: pytest.TempPathFactory) -> Network:
    """A small network with depth, and its int8 variant beside it."""
    network = load_network(write_network(tmp_path_factory.mktemp("networks") / "net.onnx", depth=True))
    quantize(network, frames[:6])
    return network


def _answers(network: Network, frames: list[Frame], backend: str, precision: str, threads: int = 1) -> list[Output]:
    inferencer = Inferencer(network, backend=backend, precision=precision, threads=threads)
    return [inferencer.compute(frame) for frame in frames]


def _bytes(answers: list[Output]) -> bytes:
    return b"".join(answer.labels.tobytes() + answer.confidence.tobytes() for answer in answers)


@pytest.mark.parametrize(("backend", "precision"), ROWS)
def test_labels_are_those_of_the_reference(network: Network, frames: list[Frame], backend: str, precision: str) -> None:
    """On 99 % of the pixels of ten frames, three classes on each."""
    _available(backend, precision)
    reference = _answers(network, frames, "onnxruntime", "f32")
    assert all(len(np.unique(answer.labels)) == 3 for answer in reference)
    found = _answers(network, frames, backend, precision)
    assert np.mean([(a.labels == b.labels).mean() for a, b in zip(found, reference, strict=True)]) > 0.99
    assert (
        max(np.abs(a.confidence.astype(int) - b.confidence).mean() for a, b in zip(found, reference, strict=True)) < 1
    )


@pytest.mark.parametrize(("backend", "precision"), ROWS)
def test_the_same_bytes_for_every_session_and_any_threads(
    network: Network, frames: list[Frame], backend: str, precision: str
) -> None:
    _available(backend, precision)
    first = _bytes(_answers(network, frames, backend, precision, threads=1))
    assert _bytes(_answers(network, frames, backend, precision, threads=1)) == first
    assert _bytes(_answers(network, frames, backend, precision, threads=2)) == first


@pytest.mark.parametrize(("backend", "precision"), ROWS)
def test_an_identity_of_its_own(network: Network, backend: str, precision: str) -> None:
    """Version of the library that computed, precision, and the file that ran: nothing is shared by accident."""
    _available(backend, precision)
    identity = Inferencer(network, backend=backend, precision=precision).identity
    assert (identity.backend, identity.precision) == (backend, precision)
    assert set(identity.versions) == {BACKENDS[backend].distribution, "opencv", "numpy"}
    assert (identity.model_sha256 == network.sha256) == (precision != "int8")


@needs_openvino
def test_openvino_is_told_its_precision_and_its_threads(network: Network) -> None:
    """By itself it takes bf16 where the processor has it."""
    compiled = open_vino.OpenVinoSession(network.path, "f32", 1)._request.get_compiled_model()
    assert compiled.get_property("INFERENCE_PRECISION_HINT").to_string() == "f32"
    assert compiled.get_property("INFERENCE_NUM_THREADS") == 1
    assert compiled.get_property("NUM_STREAMS") == 1


@needs_openvino
def test_a_graph_that_openvino_cannot_run(tmp_path: Path) -> None:
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no network")
    with pytest.raises(NetworkError, match=r"broken\.onnx cannot be run by OpenVINO in f32: "):
        open_vino.OpenVinoSession(broken, "f32", 1)


@needs_openvino
def test_a_processor_without_bf16(monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenVINO would compute in f32 in silence."""

    class Old:
        def get_property(self, device: str, name: str) -> list[str]:
            return ["FP32", "INT8"]

    monkeypatch.setattr(open_vino, "_library", lambda: type("Library", (), {"Core": Old}))
    choose_backend("openvino", "f32")
    with pytest.raises(UsageError, match="does not compute in bf16; choose --precision f32 or int8"):
        choose_backend("openvino", "bf16")


def test_without_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "openvino", None)
    with pytest.raises(
        MissingExtraError, match=r"openvino needs the extra 'openvino': pip install 'stsem\[openvino\]'"
    ):
        choose_backend("openvino", "f32")


_USE = """
import sys
import stsem.cli.main, stsem.replay.build
from stsem.inference.inferencer import Inferencer
from stsem.inference.network import load_network
session = Inferencer(load_network(sys.argv[1]))
assert not {"openvino", "onnx", "torch"} & set(sys.modules), "loaded without need"
if len(sys.argv) > 2:
    Inferencer(load_network(sys.argv[1]), backend=sys.argv[2])
    assert "openvino" in sys.modules and "openvino_telemetry" not in sys.modules
"""


@pytest.mark.parametrize("backend", ["", pytest.param("openvino", marks=needs_openvino)])
def test_nothing_is_loaded_without_need_and_nothing_is_sent(network: Network, tmp_path: Path, backend: str) -> None:
    """OpenVINO's own import would write an id to the home folder and send it; nothing is left there here."""
    environment = {**os.environ, "HOME": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("XDG_CACHE_HOME", None)
    command = [sys.executable, "-c", _USE, str(network.path), *filter(None, [backend])]
    subprocess.run(command, check=True, env=environment, cwd=ROOT)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
