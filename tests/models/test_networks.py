"""The networks: published sizes and counts, fusion by hand, pools, export."""

import hashlib
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
onnx = pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from stsem.errors import NetworkError, UsageError
from stsem.models.export import agreement, export_onnx
from stsem.models.pspnet import PSPNet, PyramidPooling, fits
from stsem.models.resnet import ResNet, ResNetSpec
from stsem.models.two_stream import Answer, OneStream, TwoStream, fuse
from stsem.models.zoo import ARCHITECTURES, build

pytestmark = pytest.mark.torch
TINY = ResNetSpec(18, 1 / 8)
SIZE = (89, 41)  # width, height: 48 k - 7 with k = 2 and 1


def _parameters(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def test_resnet_with_the_plain_stem_has_the_published_weights() -> None:
    """ResNet-18 and -50 without their classifier: 11,689,512 - 513,000 and 25,557,032 - 2,049,000 (torchvision)."""
    assert _parameters(ResNet(ResNetSpec(18, deep_stem=False))) == 11_176_512
    assert _parameters(ResNet(ResNetSpec(50, deep_stem=False))) == 23_508_032


def test_pspnet50_has_the_published_size() -> None:
    """19 classes: 49.1 M with the auxiliary head (hszhao/semseg)."""
    with torch.device("meta"):
        assert _parameters(PSPNet(ResNetSpec(50), 19)) / 1e6 == pytest.approx(49.1, abs=0.06)


def test_the_grid_is_an_eighth() -> None:
    """(48 k - 7 - 1) / 8 + 1 = 6 k cells a side, for both heads."""
    network = PSPNet(TINY, 5).eval()
    with torch.no_grad():
        head, auxiliary = network.forward_with_auxiliary(torch.zeros(1, 3, SIZE[1], SIZE[0]))
    assert head.shape == auxiliary.shape == (1, 5, 6, 12)
    assert [side for side in range(1, 620) if fits(side)][-4:] == [473, 521, 569, 617]


def test_fixed_and_adaptive_pools_agree() -> None:
    """Where the bins divide the grid, fixed kernels give the adaptive mean."""
    pooling = PyramidPooling(8).eval()
    x = torch.randn(1, 8, 6, 12, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        fixed = pooling(x)
        parts = [x]
        for bins, branch in zip((1, 2, 3, 6), pooling.branches, strict=True):
            mean = branch(torch.nn.functional.adaptive_avg_pool2d(x, bins))
            parts.append(torch.nn.functional.interpolate(mean, size=(6, 12), mode="bilinear", align_corners=True))
        assert torch.allclose(fixed, torch.cat(parts, 1), atol=1e-6)
        assert pooling(x[..., :5, :7]).shape == (1, 16, 5, 7)


def test_fusion_by_hand() -> None:
    """0.7 softmax(0, ln 3) + 0.3 softmax(ln 3, 0) = 0.7 (1/4, 3/4) + 0.3 (3/4, 1/4)."""
    third = float(np.log(3.0))
    colour, difference = (torch.tensor(x).reshape(1, 2, 1, 1) for x in ([0.0, third], [third, 0.0]))
    assert fuse(colour, difference).flatten().tolist() == pytest.approx([0.4, 0.6])


def test_the_answer_is_the_largest_enlarged_probability() -> None:
    """Labels and confidence at the input's size; the corners are grid cells themselves."""
    torch.manual_seed(0)
    network = TwoStream(TINY, TINY, 4).eval()
    image, difference = torch.randn(2, 1, 3, SIZE[1], SIZE[0])
    with torch.no_grad():
        labels, confidence = Answer(network)(image, difference)
        grid = network(image, difference)
    assert labels.shape == confidence.shape == (1, SIZE[1], SIZE[0])
    assert labels.dtype == torch.uint8
    assert labels[0, 0, 0] == grid[0, :, 0, 0].argmax()
    assert confidence[0, -1, -1].item() == pytest.approx(grid[0, :, -1, -1].max().item(), abs=1e-6)
    assert torch.allclose(grid.sum(1), torch.ones(1))


def test_names_build_what_they_say() -> None:
    """The table's rows; a wrong name lists them."""
    assert isinstance(build("pspnet-r18-w4", 13), TwoStream)
    with torch.device("meta"):
        assert isinstance(build("pspnet-r50-spatial", 13), OneStream)
        assert _parameters(build("pspnet-r50", 13)) / 1e6 == pytest.approx(98, abs=1)
    with pytest.raises(UsageError, match=r"'pspnet'; choose one of pspnet-r50"):
        build("pspnet", 13)
    assert "pspnet-r18-w4-w2" in ARCHITECTURES


@pytest.mark.parametrize("streams", [1, 2])
def test_the_exported_graph_is_the_network(streams: int, tmp_path: Path) -> None:
    """Same labels as torch, the shapes of DESIGN 11, fixed pools, no traces of this machine, same bytes again."""
    torch.manual_seed(1)
    network = OneStream(TINY, 13) if streams == 1 else TwoStream(TINY, ResNetSpec(18, 1 / 16), 13)
    path = tmp_path / "net.onnx"
    export_onnx(network, path, size=SIZE, metadata={"b": "2", "a": "1"})
    rng = np.random.default_rng(0)
    inputs = {name: rng.normal(size=(1, 3, SIZE[1], SIZE[0])).astype(np.float32)
              for name in ("image", "difference")[:streams]}  # fmt: skip
    assert agreement(network, path, inputs) == 1.0
    model = onnx.load(path)
    assert {prop.key: prop.value for prop in model.metadata_props} == {"a": "1", "b": "2"}
    kinds = {node.op_type for node in model.graph.node}
    assert "AveragePool" in kinds
    assert not kinds & {"If", "Loop", "Shape"}
    data = path.read_bytes()
    assert __file__.encode() not in data
    assert b"site-packages" not in data
    export_onnx(network, path, size=SIZE, metadata={"b": "2", "a": "1"})
    assert hashlib.sha256(path.read_bytes()).digest() == hashlib.sha256(data).digest()


def test_labels_do_not_depend_on_threads(tmp_path: Path) -> None:
    """ONNX Runtime f32, one and two threads: every bit of both outputs."""
    torch.manual_seed(2)
    path = tmp_path / "net.onnx"
    export_onnx(TwoStream(TINY, TINY, 13), path, size=(137, 89), metadata={})
    rng = np.random.default_rng(3)
    inputs = {name: rng.normal(size=(1, 3, 89, 137)).astype(np.float32) for name in ("image", "difference")}
    sums = set()
    for threads in (1, 2, 2):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        sums.add(b"".join(value.tobytes() for value in session.run(None, inputs)))
    assert len(sums) == 1


def test_a_size_that_does_not_fit_names_the_nearest() -> None:
    """270 is not 48 k - 7; 281 is."""
    with pytest.raises(NetworkError, match="270 is not 48 k - 7; use 281"):
        export_onnx(OneStream(TINY, 3), Path("never.onnx"), size=(473, 270), metadata={})
