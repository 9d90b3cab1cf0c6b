"""AdapNet: a count by hand, grids, units that look at two distances."""

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.models.adapnet import AdapNet, MultiscaleConvolution, Unit

pytestmark = pytest.mark.torch
RESNET_50, ITS_CLASSIFIER = 25_557_032, 2048 * 1000 + 1000
"""torchvision's count."""


def _parameters(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


@pytest.mark.parametrize("classes", [2, 12])
def test_adapnet_is_a_resnet50_and_little_more(classes: int) -> None:
    """Two distances cost no weights; the front convolution, two scores and two transposed convolutions do."""
    with torch.device("meta"):
        network = AdapNet(classes)
    front = 3 * 3 * 9 + 2 * 3
    skip, score = (512 + 2) * 2 * classes, (2048 + 2) * classes
    first, second = 16 * classes * 2 * classes + 2 * 2 * classes, 256 * 2 * classes * classes + 2 * classes
    assert _parameters(network) == RESNET_50 - ITS_CLASSIFIER + front + skip + score + first + second


def test_a_unit_looks_at_two_distances() -> None:
    """The answer to one bright pixel, with all weights 1: half of the channels see it 2 away, the others 5 away."""
    layer = MultiscaleConvolution(2, 1, (2, 5))
    for scale in layer:
        torch.nn.init.ones_(scale.weight)
    x = torch.zeros(1, 2, 15, 15)
    x[0, 0, 7, 7] = 1
    with torch.no_grad():
        near, far = layer(x)[0]
    for seen, rate in ((near, 2), (far, 5)):
        expected = torch.zeros(15, 15)
        expected[7 - rate : 8 + rate : rate, 7 - rate : 8 + rate : rate] = 1
        assert torch.equal(seen, expected)


def test_two_distances_cost_no_weights() -> None:
    """An odd channel goes to the first."""
    assert _parameters(Unit(32, 8, 1, (2, 16))) == _parameters(Unit(32, 8, 1, (1,)))
    layer = MultiscaleConvolution(9, 1, (2, 16))
    assert [(scale.out_channels, scale.dilation) for scale in layer] == [(5, (2, 2)), (4, (16, 16))]


@pytest.mark.parametrize("size", [(67, 97), (64, 96), (1, 1)])
def test_grids(size: tuple[int, int]) -> None:
    """A sixteenth and an eighth of the sides, rounded up; the answer has the image's own."""
    network = AdapNet(3, 1 / 16).eval()
    image = torch.zeros(1, 3, *size)
    with torch.no_grad():
        coarse, skip, canvas = network.features(image)
        answer = network(image)
    assert tuple(coarse.shape[-2:]) == tuple(-(-side // 16) for side in size)
    assert tuple(skip.shape[-2:]) == tuple(-(-side // 8) for side in size)
    assert canvas.shape[-2:] == answer.shape[-2:] == size
    assert network.stochastic
