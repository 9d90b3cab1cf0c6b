"""A network's int8 variant: where it lies, what is in it, when it is refused."""

import hashlib
from pathlib import Path

import numpy as np
import onnx
import pytest

from stsem.errors import ChannelError, NetworkError, OutputError, UsageError
from stsem.inference.inferencer import Inferencer
from stsem.inference.network import Network, load_network, shipped_networks
from stsem.inference.variant import MADE_FROM, at_precision, variant_path
from stsem.quantize.frames import calibration_frames
from stsem.quantize.static import behind_softmax, label_agreement, quantize
from tests.made_up_network import SIDECAR, write_network
from tests.made_up_walk import write_walk


@pytest.fixture
def network(tmp_path: Path) -> Network:
    return load_network(write_network(tmp_path / "my.v2.onnx"))


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_walk(tmp_path_factory.mktemp("walk") / "walk.mcap", frames=10, depth=lambda index: index != 4)


def test_the_variant_lies_beside_and_says_what_it_was_made_from(network: Network, log: Path) -> None:
    """Same network, frames and versions: the same bytes; the sidecar is shared, the sums differ."""
    frames = calibration_frames(network, [(log,)], 4)
    variant = quantize(network, frames)
    assert variant.path == network.path.with_name("my.v2.int8.onnx") == variant_path(network)
    first = variant.path.read_bytes()
    assert variant.model_sha256 == hashlib.sha256(first).hexdigest() != network.model_sha256
    assert (variant.name, variant.sidecar, variant.precision) == ("my.v2", network.sidecar, "int8")
    assert {MADE_FROM: network.sha256}.items() <= {
        prop.key: prop.value for prop in onnx.load(variant.path).metadata_props
    }.items()
    assert quantize(network, frames).path.read_bytes() == first
    assert sorted(path.name for path in network.path.parent.iterdir()) == [
        "my.v2.int8.onnx", "my.v2.onnx", "my.v2.toml",
    ]  # fmt: skip
    assert label_agreement(network, variant, frames) > 0.98


def test_convolutions_are_in_8_bits_and_probabilities_in_f32(network: Network, log: Path) -> None:
    """Weights int8 of at most 7 bits, a scale per output channel; activations uint8; from the softmax on, nothing."""
    model = onnx.load(quantize(network, calibration_frames(network, [(log,)], 4)).path)
    initial = {tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    made_by = {output: node for node in model.graph.node for output in node.output}
    convolutions = [node for node in model.graph.node if node.op_type == "Conv"]
    assert len(convolutions) == 3
    for node in convolutions:
        activation, weight = (made_by[name] for name in node.input[:2])
        assert (activation.op_type, weight.op_type) == ("DequantizeLinear", "DequantizeLinear")
        assert initial[activation.input[2]].dtype == np.uint8
        values, scales = initial[weight.input[0]], initial[weight.input[1]]
        assert values.dtype == np.int8
        assert np.abs(values.astype(int)).max() <= 64
        assert scales.shape == (len(values),)
    kept = behind_softmax(model)
    assert {"Softmax", "Resize", "ArgMax", "ReduceMax"} <= {
        node.op_type for node in model.graph.node if node.name in kept
    }
    assert not [node for node in model.graph.node if node.name in kept and "Quantize" in node.op_type]


def test_a_variant_of_another_network_is_refused(network: Network, log: Path) -> None:
    """The weights changed, or the sidecar did; the sentence names the command."""
    quantize(network, calibration_frames(network, [(log,)], 4))
    at_precision(network, "int8")
    beside = network.path.with_suffix(".toml")
    beside.write_text(SIDECAR.replace("0.25, 0.25, 0.25", "0.25, 0.25, 0.2"))
    with pytest.raises(NetworkError, match=r"made from another network .*: stsem quantize .*my\.v2\.onnx --log LOG"):
        at_precision(load_network(network.path), "int8")
    beside.write_text(SIDECAR)
    write_network(network.path, variance=True)
    with pytest.raises(NetworkError, match="made from another network"):
        Inferencer(load_network(network.path), precision="int8")


def test_no_variant_or_one_by_its_own_name(network: Network, tmp_path: Path) -> None:
    with pytest.raises(
        NetworkError, match=r"no int8 variant my\.v2\.int8\.onnx beside it; make it with: stsem quantize"
    ):
        Inferencer(network, precision="int8")
    variant_path(network).write_bytes(network.path.read_bytes())
    with pytest.raises(NetworkError, match="made from another network"):  # it says nothing of where it comes from
        at_precision(network, "int8")
    with pytest.raises(
        NetworkError, match=r"the int8 variant of my\.v2\.onnx; give my\.v2\.onnx with --precision int8"
    ):
        load_network(variant_path(network))
    assert not [name for name in shipped_networks() if "int8" in name]


def test_a_variant_runs_in_int8_alone(network: Network, log: Path) -> None:
    variant = quantize(network, calibration_frames(network, [(log,)], 4))
    assert at_precision(variant, "int8") is variant
    with pytest.raises(UsageError, match="cannot run in f32"):
        Inferencer(variant)


def test_depth_and_maps_of_uncertainty(tmp_path: Path, log: Path) -> None:
    """Frames without depth are passed over, the map comes out of the variant too."""
    network = load_network(write_network(tmp_path / "net.onnx", depth=True, variance=True))
    frames = calibration_frames(network, [(log,)], 20)
    assert [frame.index for frame in frames] == [0, 1, 2, 3, 5, 6, 7, 8, 9]
    assert all(frame.depth is not None for frame in frames)
    variant = quantize(network, frames)
    assert label_agreement(network, variant, frames) > 0.98
    assert Inferencer(variant, precision="int8").compute(frames[0]).uncertainty is not None
    flat = write_walk(tmp_path / "flat.mcap", frames=4, depth=None)
    with pytest.raises(ChannelError, match=r"takes depth, but .*flat.* has no depth"):
        calibration_frames(network, [(flat,)], 4)


def test_frames_are_shared_by_the_logs_and_spread_over_each(network: Network, log: Path, tmp_path: Path) -> None:
    other = write_walk(tmp_path / "other.mcap", frames=4)
    assert [frame.index for frame in calibration_frames(network, [(log,)], 5)] == [1, 3, 5, 7, 9]
    assert [frame.index for frame in calibration_frames(network, [(log,), (other,)], 5)] == [2, 7, 0, 2, 3]
    assert len(calibration_frames(network, [(other,)], 100)) == 4


def test_an_old_opset_is_raised(tmp_path: Path, log: Path) -> None:
    """Before opset 13 a weight had one scale for all channels."""
    network = load_network(write_network(tmp_path / "old.onnx", opset=11))
    frames = calibration_frames(network, [(log,)], 4)
    variant = quantize(network, frames)
    assert label_agreement(network, variant, frames) > 0.95


def test_what_cannot_be_quantized(network: Network, log: Path, tmp_path: Path) -> None:
    """Each in a sentence; nothing is left behind."""
    frames = calibration_frames(network, [(log,)], 4)
    with pytest.raises(NetworkError, match=r"1 frame\(s\) do not show the ranges"):
        quantize(network, frames[:1])
    model = onnx.load(network.path)
    first_softmax = onnx.helper.make_node("Softmax", ["image"], ["soft"], axis=1, name="first")
    for node in model.graph.node:
        node.input[:] = ["soft" if name == "image" else name for name in node.input]
    model.graph.node.insert(0, first_softmax)
    onnx.save(model, network.path)
    with pytest.raises(NetworkError, match="nothing to quantize; run it in f32"):
        quantize(load_network(network.path), frames)
    assert not variant_path(network).exists()


def test_a_folder_that_cannot_be_written(network: Network, log: Path) -> None:
    variant_path(network).mkdir()
    with pytest.raises(OutputError, match=r"cannot be written .* copy the network and its sidecar"):
        quantize(network, calibration_frames(network, [(log,)], 4))


def test_undecodable_frames_are_passed_over(network: Network, tmp_path: Path) -> None:
    broken = write_walk(tmp_path / "broken.mcap", frames=4, broken=frozenset({1, 2}))
    assert [frame.index for frame in calibration_frames(network, [(broken,)], 4)] == [0, 3]
    with pytest.raises(NetworkError, match=r"have no frame that my\.v2 can be calibrated on"):
        calibration_frames(network, [(broken,)], 1)  # the middle one
