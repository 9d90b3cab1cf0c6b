"""Weights from elsewhere: same outputs as in the network they come from, names accounted for, wrong files refused."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.errors import NetworkError, UsageError
from stsem.models.checkpoint import begin_with, load_weights
from stsem.models.deeplab import DeepLab
from stsem.models.resnet import ResNetSpec
from stsem.models.two_stream import OneStream, PredictionFusion, adapt_to_difference, prediction_sum
from stsem.models.zoo import build

from .reference_resnet import Basic, Bottle, SemsegPSPNet, TorchvisionResNet, lively

pytestmark = pytest.mark.torch
CLASSES = 5
PLANES = (8, 16, 32, 64)
"""Of the zoo's width -w2."""
STD, SCALE = (0.2, 0.25, 0.3), 4.0
COUNTS = {50: (3, 4, 6, 3), 101: (3, 4, 23, 3)}


@pytest.fixture(autouse=True)
def seed() -> None:
    torch.manual_seed(0)


def image() -> torch.Tensor:
    return torch.randn(1, 3, 41, 89, generator=torch.Generator().manual_seed(1))


def semseg(classes: int = CLASSES, depth: int = 50) -> SemsegPSPNet:
    return lively(SemsegPSPNet(COUNTS[depth], PLANES, (8, 16), 64, 64, classes))


def saved(path: Path, network: torch.nn.Module, wrapper: str = "module.", **how: Any) -> Path:
    """As semseg's training writes it."""
    state = {f"{wrapper}{key}": value for key, value in network.state_dict().items()}
    torch.save(
        {"epoch": 3, "state_dict": state, "optimizer": {"state": {}, "param_groups": [{"lr": 0.01}]}}, path, **how
    )
    return path


@pytest.mark.parametrize("zipped", [True, False])
def test_a_pspnet_of_semseg(tmp_path: Path, zipped: bool) -> None:
    """Both heads give the same logits; every name is accounted for. Also in the format of older torch."""
    theirs = semseg()
    path = saved(tmp_path / "train_epoch_200.pth", theirs, _use_new_zipfile_serialization=zipped)
    network = build("pspnet-r50-spatial-w2", CLASSES).eval()
    loaded = load_weights(network, path)
    assert (loaded.missing, loaded.unfit, loaded.unmatched, loaded.complete) == ((), (), (), True)
    assert loaded.lines()[0].endswith("taken (PSPNet of hszhao/semseg)")
    with torch.no_grad():
        expected, auxiliary = theirs(image())
        answers = network.answers(image())
    assert torch.allclose(answers.probabilities, expected.softmax(1), atol=1e-6)
    assert torch.allclose(answers.sides[0].logits, auxiliary, atol=1e-5)
    assert expected.std() > 0.05


@pytest.mark.parametrize(("depth", "block", "counts"), [(18, Basic, (2, 2, 2, 2)), (50, Bottle, COUNTS[50])])
def test_a_resnet_as_torchvision_names_it(
    tmp_path: Path, depth: int, block: type[torch.nn.Module], counts: tuple[int, ...]
) -> None:
    """The backbone gives the same features at stride 32; heads stay as they were, the classifier has no place."""
    theirs = lively(TorchvisionResNet(block, counts, PLANES, 8))
    torch.save(theirs.state_dict(), tmp_path / "resnet.pth")
    network = OneStream(ResNetSpec(depth, 1 / 8, deep_stem=False, output_stride=32), CLASSES).eval()
    before = network.colour.head[0].weight.clone()
    loaded = load_weights(network, tmp_path / "resnet.pth")
    with torch.no_grad():
        for got, expected in zip(network.colour.backbone(image()), theirs(image()), strict=True):
            assert torch.allclose(got, expected, atol=1e-6)
            assert expected.std() > 0.05
    assert loaded.unmatched == ("fc.weight", "fc.bias")
    assert {name.split(".")[1] for name in loaded.missing} == {"pyramid", "head", "auxiliary"}
    assert not loaded.complete
    assert torch.equal(network.colour.head[0].weight, before)
    assert loaded.lines()[1].startswith(f"{len(loaded.missing)} not in the file, unchanged: colour.pyramid.branches.0")


def test_old_files_have_no_counters(tmp_path: Path) -> None:
    """torch before 0.4.1 wrote none; nothing is missing for that. By name it goes into PSPNet and DeepLab."""
    state = lively(TorchvisionResNet(Basic, (2, 2, 2, 2), PLANES, 8)).state_dict()
    torch.save({k: v for k, v in state.items() if "num_batches" not in k}, tmp_path / "old.pth")
    for network in (build("pspnet-r18-spatial-7x7-w2", CLASSES), DeepLab(CLASSES, 1 / 8, depth=18)):
        loaded = load_weights(network, tmp_path / "old.pth")
        assert not [name for name in loaded.missing if "backbone" in name]


def test_the_stem_of_three_convolutions(tmp_path: Path) -> None:
    """semseg's ImageNet models: conv1 to conv3 where torchvision has conv1."""
    theirs = semseg()
    names = {f"layer0.{3 * i}.": f"conv{i + 1}." for i in range(3)} | {
        f"layer0.{3 * i + 1}.": f"bn{i + 1}." for i in range(3)
    }
    state = {}
    for key, value in theirs.state_dict().items():
        start = next((old for old in names if key.startswith(old)), "")
        if key.startswith("layer"):
            state[names[start] + key.removeprefix(start) if start else key] = value
    torch.save(state, tmp_path / "resnet50_v2.pth")
    network = build("pspnet-r50-spatial-w2", CLASSES).eval()
    assert load_weights(network, tmp_path / "resnet50_v2.pth").unmatched == ()
    with torch.no_grad():
        x = theirs.layer3(theirs.layer2(theirs.layer1(theirs.layer0(image()))))
        assert torch.allclose(network.colour.backbone(image())[0], x, atol=1e-6)


def test_other_classes_keep_their_classifiers(tmp_path: Path) -> None:
    """19 classes into 5: both classifiers stay, all else is taken."""
    network = build("pspnet-r50-spatial-w2", CLASSES)
    loaded = load_weights(network, saved(tmp_path / "city.pth", semseg(19)))
    assert loaded.missing == ()
    assert [text.split()[0] for text in loaded.unfit] == ["cls.4.weight", "cls.4.bias", "aux.4.weight", "aux.4.bias"]
    assert "cls.4.weight 19x64x1x1 for 5x64x1x1" in loaded.lines()[1]
    assert not loaded.complete


def test_the_difference_stream_starts_from_the_colour_stream(tmp_path: Path) -> None:
    """In a fused network as `copy_colour_to_difference` says; in a temporal one by the same rule; else it is left."""
    path = saved(tmp_path / "psp.pth", semseg())
    alone = build("pspnet-r50-spatial-w2", CLASSES)
    load_weights(alone, path)
    expected = alone.colour
    adapt_to_difference(expected, std=STD, scale=SCALE)
    wanted = expected.state_dict()
    for name in ("pspnet-r50-sum-w2", "pspnet-r50-temporal-w2"):
        network = build(name, CLASSES)
        loaded = begin_with(network, path, std=STD, scale=SCALE)
        assert loaded.missing == ()
        assert "train it before use" in loaded.lines()[-1]
        got = network.difference.state_dict()
        assert all(torch.equal(got[key], value) for key, value in wanted.items())
    uneven = build("pspnet-r50-sum-w2-w1", CLASSES)
    assert "has another width" in begin_with(uneven, path, std=STD, scale=SCALE).note
    left = begin_with(build("pspnet-r50-sum-w2", CLASSES), path, std=STD, scale=None)
    assert {name.split(".")[0] for name in left.missing} == {"difference"}
    others = begin_with(build("pspnet-r50-sum-w2", CLASSES), saved(path, semseg(19)), std=STD, scale=SCALE)
    assert [name for name in others.matched if "head.4" in name] == []  # copies of the colour stream's random ones
    assert "difference.head.4.weight" in others.missing


def test_our_own_checkpoints(tmp_path: Path) -> None:
    """The running mean of a training is taken, not its last state; one stream alone goes into its stream of two."""
    spatial, mean = build("pspnet-r18-spatial-w2", CLASSES), build("pspnet-r18-spatial-w2", CLASSES)
    state = {
        "architecture": "pspnet-r18-spatial-w2",
        "iteration": 7,
        "network": spatial.state_dict(),
        "mean": {"n_averaged": torch.tensor(3), **{f"module.{k}": v for k, v in mean.state_dict().items()}},
    }
    path = tmp_path / "checkpoint.pt"
    torch.save(state, path)
    loaded = load_weights(spatial, path)
    assert (loaded.complete, loaded.unmatched) == (True, ())
    assert all(torch.equal(value, mean.state_dict()[key]) for key, value in spatial.state_dict().items())
    two = build("pspnet-r18-sum-w2-w1", CLASSES)
    assert {name.split(".")[0] for name in load_weights(two, path).missing} == {"difference"}
    assert torch.equal(two.colour.head[0].weight, mean.colour.head[0].weight)
    twins = build("pspnet-r18-sum-w2", CLASSES)
    loaded = load_weights(twins, path, stream="difference")
    assert loaded.adapt
    assert torch.equal(twins.difference.head[0].weight, mean.colour.head[0].weight)
    torch.save(twins.state_dict(), path)
    loaded = begin_with(build("pspnet-r18-sum-w2", CLASSES), path, std=STD, scale=SCALE)
    assert (loaded.complete, loaded.note) == (True, "")


def test_any_network_of_the_zoo_takes_its_own(tmp_path: Path) -> None:
    """By its own names, also with another number of classes."""
    torch.save(build("segnet-basic-w2", CLASSES).state_dict(), tmp_path / "net.pt")
    assert load_weights(build("segnet-basic-w2", CLASSES), tmp_path / "net.pt").complete
    loaded = load_weights(build("segnet-basic-w2", CLASSES + 1), tmp_path / "net.pt")
    assert (len(loaded.unfit), loaded.missing) == (2, ())


MISFITS: dict[str, tuple[Callable[[], Any], str, str]] = {
    "deeper": (lambda: semseg(depth=101).state_dict(), "pspnet-r50-spatial-w2", "also hold layer3.6.conv1.weight"),
    "shallower": (lambda: semseg().state_dict(), "pspnet-r101-spatial-w2", "lack colour.backbone.middle.6"),
    "wider": (lambda: semseg().state_dict(), "pspnet-r50-spatial-w1", "of the same depth and width"),
    "7x7": (lambda: TorchvisionResNet(Bottle, COUNTS[50], PLANES, 8).state_dict(), "pspnet-r50-spatial-w2",
            "with -7x7"),
    "3x3": (lambda: semseg().state_dict(), "pspnet-r50-spatial-7x7-w2", "without -7x7"),
    "no ResNet": (lambda: semseg().state_dict(), "fcn-8s-w1", "which the network does not contain"),
    "unknown": (lambda: {"encoder.a": torch.zeros(2)}, "pspnet-r50-spatial-w2", r"not known (encoder.a); known are"),
    "of another of ours": (lambda: build("segnet-basic-w2", 5).state_dict(), "pspnet-r18-w2", "that are not known"),
    "narrower": (lambda: build("pspnet-r18-w1", 5).state_dict(), "pspnet-r18-w2", "do not fit"),
    "not finite": (lambda: {k: v * float("nan") if k == "cls.4.bias" else v for k, v in semseg().state_dict().items()},
                   "pspnet-r50-spatial-w2", "colour.head.4.bias that are no finite numbers"),
}  # fmt: skip


@pytest.mark.parametrize("case", MISFITS)
def test_weights_of_another_network(tmp_path: Path, case: str) -> None:
    """One sentence, and nothing has been taken."""
    make, name, sentence = MISFITS[case]
    torch.save(make(), tmp_path / "net.pth")
    network = build(name, CLASSES)
    before = {key: value.clone() for key, value in network.state_dict().items()}
    with pytest.raises(NetworkError) as caught:
        load_weights(network, tmp_path / "net.pth")
    assert sentence in str(caught.value)
    assert str(caught.value).count("\n") == 0
    assert all(torch.equal(value, before[key]) for key, value in network.state_dict().items())


def test_a_stream_that_is_not_there(tmp_path: Path) -> None:
    path = saved(tmp_path / "psp.pth", semseg())
    with pytest.raises(UsageError, match=r"no stream 'difference' .* it has colour"):
        load_weights(build("pspnet-r50-spatial-w2", CLASSES), path, stream="difference")
    network = PredictionFusion(*[ResNetSpec(50, 1 / 8)] * 2, CLASSES, fuse=prediction_sum)
    assert all(name.startswith("difference.") for name in load_weights(network, path, stream="difference").matched)
