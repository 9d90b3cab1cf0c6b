"""The networks: published sizes and counts, fusion by hand, pools, export."""

import hashlib
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
onnx = pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from stsem.errors import NetworkError
from stsem.models.cost import cost, cost_of
from stsem.models.export import Answer, exported
from stsem.models.folding import folded
from stsem.models.montecarlo import fix_masks, uncertainty
from stsem.models.network import SegmentationNetwork, softmax
from stsem.models.pspnet import PyramidPooling
from stsem.models.resnet import ResNet, ResNetSpec
from stsem.models.two_stream import (
    FeatureFusion,
    OneStream,
    PredictionFusion,
    copy_colour_to_difference,
    prediction_max,
    prediction_sum,
)
from stsem.models.zoo import build

pytestmark = pytest.mark.torch
TINY = ResNetSpec(18, 1 / 8)
SIZE = (89, 41)  # width, height: 48 k - 7 with k = 2 and 1


def _parameters(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def _two_streams(colour: ResNetSpec, difference: ResNetSpec | None = None, classes: int = 13) -> PredictionFusion:
    return PredictionFusion(colour, difference or colour, classes, fuse=prediction_sum)


@pytest.mark.parametrize(("depth", "published", "features"),
                         [(18, 11_689_512, 512), (50, 25_557_032, 2048), (101, 44_549_160, 2048)])  # fmt: skip
def test_resnet_has_the_published_weights(depth: int, published: int, features: int) -> None:
    """With the plain stem and a classifier of 1000 classes: torchvision's counts, wherever the stride is."""
    for stride, first in ((8, False), (16, True), (32, False)):
        with torch.device("meta"):
            network = ResNet(ResNetSpec(depth, deep_stem=False, output_stride=stride, stride_first=first))
        assert _parameters(network) + features * 1000 + 1000 == published
        assert network.channels == features


@pytest.mark.parametrize(("first", "published"), [(True, 3.86e9), (False, 4.09e9)])
def test_resnet50_does_the_published_work(first: bool, published: float) -> None:
    """Multiply-adds at 224 without the classifier's 2 M: 3.8e9 in He et al., table 1, with the stride on the 1x1
    convolution; 4.09e9 in torchvision, on the 3x3."""

    class Features(SegmentationNetwork):
        def __init__(self) -> None:
            super().__init__()
            self.backbone = ResNet(ResNetSpec(50, deep_stem=False, output_stride=32, stride_first=first))

        def features(self, *inputs: torch.Tensor) -> tuple[torch.Tensor, ...]:
            return self.backbone(*inputs)

        def head(self, *features: torch.Tensor) -> torch.Tensor:
            return features[1]

    with torch.device("meta"):
        assert cost_of(Features(), 224).multiply_adds == pytest.approx(published, rel=0.005)


@pytest.mark.parametrize(
    ("stride", "middle", "late"), [(8, (6, 12), (6, 12)), (16, (3, 6), (3, 6)), (32, (3, 6), (2, 3))]
)
def test_output_strides(stride: int, middle: tuple[int, int], late: tuple[int, int]) -> None:
    """Grids of 41 x 89 pixels; stages that do not shrink dilate, so that every stride sees as far."""
    network = ResNet(ResNetSpec(50, 1 / 16, output_stride=stride)).eval()
    with torch.no_grad():
        maps = network(torch.zeros(1, 3, SIZE[1], SIZE[0]))
    assert tuple(x.shape[-2:] for x in maps) == (middle, late)


def test_pspnet50_has_the_published_size() -> None:
    """19 classes: 46.7 M, 49.1 M with the auxiliary head (hszhao/semseg)."""
    found = cost("pspnet-r50-spatial", 19)
    assert found.parameters / 1e6 == pytest.approx(46.7, abs=0.05)
    assert (found.parameters + found.auxiliary) / 1e6 == pytest.approx(49.1, abs=0.06)
    assert cost("pspnet-r50", 19).parameters == 2 * found.parameters


def test_the_grid_is_an_eighth() -> None:
    """(48 k - 7 - 1) / 8 + 1 = 6 k cells a side, for both heads."""
    network = OneStream(TINY, 5).eval()
    with torch.no_grad():
        answers = network.answers(torch.zeros(1, 3, SIZE[1], SIZE[0]))
    assert answers.probabilities.shape == answers.sides[0].logits.shape == (1, 5, 6, 12)
    assert [side for side in range(1, 620) if network.fits(side)][-4:] == [473, 521, 569, 617]


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


def test_prediction_fusion_by_hand() -> None:
    """0.7 (1/4, 3/4) + 0.3 (3/4, 1/4); and max (3/4, 3/4), which is no probability until it is halved."""
    third = float(np.log(3.0))
    colour, difference = (softmax(torch.tensor(x).reshape(1, 2, 1, 1)) for x in ([0.0, third], [third, 0.0]))
    assert prediction_sum(colour, difference).flatten().tolist() == pytest.approx([0.4, 0.6])
    assert prediction_max(colour, difference).flatten().tolist() == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize("join", ["sum", "concat"])
def test_feature_fusion_by_hand(join: str) -> None:
    """One head on the two final feature maps, added or side by side; unequal streams are matched before they add."""
    torch.manual_seed(0)
    network = FeatureFusion(TINY, TINY, 4, join=join).eval()
    image, difference = torch.randn(2, 1, 3, SIZE[1], SIZE[0])
    with torch.no_grad():
        maps = [s.pyramid(s.backbone(x)[1]) for s, x in ((network.colour, image), (network.difference, difference))]
        joined = maps[0] + maps[1] if join == "sum" else torch.cat(maps, 1)
        assert torch.allclose(network(image, difference), network.fused(joined).softmax(1), atol=1e-6)
    assert len(network.match) == 0
    assert len(FeatureFusion(TINY, ResNetSpec(18, 1 / 16), 4, join=join).match) == (2 if join == "sum" else 0)


def test_the_difference_stream_starts_from_the_colour_stream() -> None:
    """An image through one and a difference that is std x scale times as large through the other: the same answer, but
    for the first normalisation, which forgets what it knew of images."""
    torch.manual_seed(0)
    network, std, scale = _two_streams(TINY), (0.2, 0.25, 0.3), 4.0
    for _ in range(2):
        network.train()(*torch.randn(2, 2, 3, SIZE[1], SIZE[0]))
    copy_colour_to_difference(network, std=std, scale=scale)
    colour, difference = (stream.backbone.stem.eval() for stream in (network.colour, network.difference))
    assert not difference[1].running_mean.any()
    difference[1].load_state_dict(colour[1].state_dict())
    image = torch.randn(1, 3, SIZE[1], SIZE[0])
    with torch.no_grad():
        again = difference(image * torch.tensor(std).reshape(1, 3, 1, 1) * scale)
        assert torch.allclose(again, colour(image), atol=1e-5)
    with pytest.raises(NetworkError, match="another one; build both of one width"):
        copy_colour_to_difference(_two_streams(TINY, ResNetSpec(18, 1 / 16)), std=std, scale=scale)


def test_the_answer_is_the_largest_enlarged_probability() -> None:
    """Labels and confidence at the input's size; the corners are grid cells themselves."""
    torch.manual_seed(0)
    network = _two_streams(TINY, classes=4).eval()
    image, difference = torch.randn(2, 1, 3, SIZE[1], SIZE[0])
    with torch.no_grad():
        labels, confidence = Answer(network)(image, difference)
        grid = network(image, difference)
    assert labels.shape == confidence.shape == (1, SIZE[1], SIZE[0])
    assert labels.dtype == torch.uint8
    assert labels[0, 0, 0] == grid[0, :, 0, 0].argmax()
    assert confidence[0, -1, -1].item() == pytest.approx(grid[0, :, -1, -1].max().item(), abs=1e-6)
    assert torch.allclose(grid.sum(1), torch.ones(1))


def test_uncertainty_by_hand() -> None:
    """Against dropout done by numpy with the same masks; certain where nothing was dropped; the same maps again."""
    torch.manual_seed(0)
    network, passes = OneStream(TINY, 4).eval(), 64
    classifier = network.colour.head[4]
    classifier.weight.data *= 1000  # random features are small
    image = torch.randn(1, 3, SIZE[1], SIZE[0])
    fixed = fix_masks(network, image, passes=passes)
    assert not dict(network.named_modules()).keys() ^ dict(fixed.named_modules()).keys()
    features = network.features(image)
    with torch.no_grad():
        maps = [x[0, 0].numpy() for x in uncertainty(fixed, *features, passes=passes)]
        kept = fixed.get_submodule("colour.head.3").kept
        assert kept.float().mean().item() == pytest.approx(0.9, abs=0.01)
        samples = np.stack([softmax(classifier(features[0] * mask / 0.9))[0].numpy() for mask in kept])
        assert torch.allclose(fixed(image), network(image))
    mean = samples.mean(0)
    entropy = -(mean * np.log(mean)).sum(0)
    information = entropy + (samples * np.log(samples)).sum(1).mean(0)
    for got, expected in zip(maps, (samples.var(0).mean(0), entropy, information), strict=True):
        assert got == pytest.approx(expected, abs=1e-5)
        assert expected.max() > 1e-4
    other = fix_masks(network, image, passes=passes, seed=1)
    assert not torch.equal(other.get_submodule("colour.head.3").kept, kept)
    assert torch.equal(fix_masks(network, image, passes=passes).get_submodule("colour.head.3").kept, kept)


def test_what_cannot_be_sampled() -> None:
    """No dropout, or one pass."""
    network, image = OneStream(TINY, 4), torch.zeros(1, 3, SIZE[1], SIZE[0])
    with pytest.raises(NetworkError, match=r"1 pass\(es\)"):
        fix_masks(network, image, passes=1)
    network.colour.head[3] = torch.nn.Identity()
    assert not network.stochastic
    with pytest.raises(NetworkError, match="no dropout"):
        fix_masks(network, image, passes=4)


def test_the_exported_graph_is_the_network(tmp_path: Path) -> None:
    """The shapes of DESIGN 11, fixed pools, no traces of this machine, the same bytes again; one and two threads give
    every bit of both outputs alike."""
    torch.manual_seed(1)
    network, path = OneStream(TINY, 13), tmp_path / "net.onnx"
    path.write_bytes(exported(network, size=SIZE, metadata={"b": "2", "a": "1"}))
    model = onnx.load(path)
    assert {prop.key: prop.value for prop in model.metadata_props} == {"a": "1", "b": "2"}
    kinds = {node.op_type for node in model.graph.node}
    assert "AveragePool" in kinds
    assert not kinds & {"If", "Loop", "Shape"}
    data = path.read_bytes()
    assert __file__.encode() not in data
    assert b"site-packages" not in data
    path.write_bytes(exported(network, size=SIZE, metadata={"b": "2", "a": "1"}))
    assert hashlib.sha256(path.read_bytes()).digest() == hashlib.sha256(data).digest()
    assert len({_answered(path, threads) for threads in (1, 2, 2)}) == 1


def _answered(path: Path, threads: int) -> bytes:
    rng = np.random.default_rng(3)
    inputs = {"image": rng.normal(size=(1, 3, SIZE[1], SIZE[0])).astype(np.float32)}
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    labels, confidence = session.run(["labels", "confidence"], inputs)
    assert labels.shape == confidence.shape == (1, SIZE[1], SIZE[0])
    assert labels.dtype == np.uint8
    return labels.tobytes() + confidence.tobytes()


def test_folding_changes_no_answer() -> None:
    """Normalisations that know something go into the convolutions before them, transposed ones too; what is left
    shares its weights, and the network itself stays as it was."""
    torch.manual_seed(0)
    network, image = build("adapnet-pp-w1", 4), torch.randn(2, 3, 41, 67)
    with torch.no_grad():
        for layer in (layer for layer in network.modules() if isinstance(layer, torch.nn.BatchNorm2d)):
            torch.nn.init.uniform_(layer.weight, 0.5, 2)
            torch.nn.init.uniform_(layer.bias, -1, 1)
        for _ in range(3):
            network.train()(image)
        expected = network.eval()(image)
        lighter = folded(network)
        assert torch.allclose(lighter(image), expected, atol=1e-5)
        assert torch.equal(network(image), expected)
    kinds = [[sum(isinstance(layer, kind) for layer in net.modules()) for net in (network, lighter)]
             for kind in (torch.nn.BatchNorm2d, torch.nn.ConvTranspose2d)]  # fmt: skip
    assert kinds[0][1] < kinds[0][0] / 2  # the rest stands before its convolution
    assert kinds[1] == [3, 3]
    assert lighter.decoder.score.weight is network.decoder.score.weight
    assert not any(isinstance(layer, torch.nn.BatchNorm2d) for layer in folded(OneStream(TINY, 4).eval()).modules())


def test_a_size_that_does_not_fit_names_the_nearest() -> None:
    """270 is not 48 k - 7; 281 is."""
    with pytest.raises(NetworkError, match="270 is not 48 k - 7; use 281"):
        exported(OneStream(TINY, 3), size=(473, 270), metadata={})


def test_checkpoints_made_so_far_load() -> None:
    """The names of the default network's weights are a promise to files on disk."""
    with torch.device("meta"):
        names = sorted(build("pspnet-r18-w4-w2", 13).state_dict())
    assert len(names) == 356
    assert hashlib.sha256("\n".join(names).encode()).hexdigest()[:16] == "68de419000f16fdc"
    assert names[0] == "colour.auxiliary.0.weight"
