"""VGG16 and FCN: published counts, exact alignment, bilinear enlargement."""

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from torch import nn
from torch.nn import functional

from stsem.models.cost import cost_of
from stsem.models.fcn import FCN, bilinear
from stsem.models.vgg import vgg16

pytestmark = pytest.mark.torch


@pytest.mark.parametrize(("batch_norm", "published"), [(False, 14_714_688), (True, 14_723_136 - 4_224)])
def test_vgg16_has_the_published_weights(batch_norm: bool, published: int) -> None:
    """torchvision's features, without the biases that a batch normalisation makes idle."""
    with torch.device("meta"):
        blocks = vgg16(batch_norm=batch_norm)
    assert sum(p.numel() for p in blocks.parameters()) == published
    assert [sum(isinstance(layer, nn.Conv2d) for layer in block) for block in blocks] == [2, 2, 3, 3, 3]


@pytest.mark.parametrize(("stride", "caffe"), [(32, 136_152_917), (16, 134_815_994), (8, 134_489_759)])
def test_fcn_has_the_weights_of_the_caffe_models(stride: int, caffe: int) -> None:
    """21 classes; there the last enlargement, fixed and square in the classes, counts as weights."""
    with torch.device("meta"):
        found = cost_of(FCN(21, stride=stride), 65)
    assert found.parameters + 21 * 21 * (2 * stride) ** 2 == caffe


@pytest.mark.parametrize("factor", [2, 8])
def test_transposed_convolutions_start_as_bilinear_interpolation(factor: int) -> None:
    """Equal but for half a cell at the border, where a transposed convolution fades and interpolation goes on."""
    x = torch.randn(1, 3, 5, 7, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        got = bilinear(3, factor)(x)
    expected = functional.interpolate(x, scale_factor=factor, mode="bilinear", align_corners=False)
    assert got.shape == expected.shape
    inside = (..., slice(factor // 2, -(factor // 2)), slice(factor // 2, -(factor // 2)))
    assert torch.allclose(got[inside], expected[inside], atol=1e-6)
    assert (got[..., 0, :].abs() < expected[..., 0, :].abs()).all()


@pytest.mark.parametrize(("stride", "slopes", "ahead"), [(32, 1, 15.5), (16, 2, 15.5 + 7.5), (8, 3, 15.5 + 7.5 + 3.5)])
@pytest.mark.parametrize("side", [256, 251])
def test_scores_are_where_the_pixels_are(stride: int, slopes: int, ahead: float, side: int) -> None:
    """A ramp over the pixels, only pooled: the maximum of the s pixels of a cell is (s - 1) / 2 more than the value at
    its centre, so that every stride adds the ramp again and that much. Nothing is shifted, at odd sizes either."""
    network, scale = FCN(2, 1 / 16, stride=stride).eval(), 1e-2
    network.blocks = nn.ModuleList(nn.Identity() for _ in range(5))
    network.fc6, network.fc7, network.score = nn.Identity(), nn.Identity(), _red_alone()
    network.skip_scores = nn.ModuleList(_red_alone() for _ in network.skip_scores)
    ramp = scale * torch.arange(side, dtype=torch.float32)
    for image in (ramp.expand(1, 3, side, side), ramp[:, None].expand(1, 3, side, side)):
        with torch.no_grad():
            probabilities = network(image)
        assert probabilities.shape == (1, 2, side, side)
        logits = probabilities[0].log().diff(dim=0).neg()[0] / scale
        expected = slopes * image[0, 0] / scale + ahead
        assert torch.allclose(logits[64:-64, 64:-64], expected[64:-64, 64:-64], atol=0.1)


def _red_alone() -> nn.Conv2d:
    """Logits (R, 0)."""
    layer = nn.Conv2d(3, 2, 1)
    with torch.no_grad():
        layer.weight.zero_()[0, 0] = 1
        layer.bias.zero_()
    return layer
