"""FuseNet: its weights are SegNet's and a second encoder's; depth is added, and where."""

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from torch import nn

from stsem.models.cost import cost_of
from stsem.models.fusenet import BEFORE, FuseNet, fused
from stsem.models.network import dropouts
from stsem.models.segnet import SegNet

pytestmark = pytest.mark.torch
ODD = (67, 97)
VGG16_BN = 14_718_912


@pytest.mark.parametrize("classes", [11, 37])
def test_fusenet_is_segnet_with_a_second_encoder(classes: int) -> None:
    """44.2 M for the 37 classes of SUN RGB-D; the first layer of the second encoder sees one channel, not three."""
    with torch.device("meta"):
        both, one = cost_of(FuseNet(classes), 65), cost_of(SegNet(classes), 65)
    assert both.parameters == one.parameters + VGG16_BN - 2 * 64 * 9
    assert both.parameters / 1e6 == pytest.approx(44.2, abs=0.05)


def test_without_depth_features_it_is_segnet() -> None:
    """The last normalisation of each depth block at zero, and SegNet's weights for the rest: SegNet's answer."""
    torch.manual_seed(0)
    network, plain = FuseNet(4, 1 / 16).eval(), SegNet(4, 1 / 16).eval()
    colour = [p for block in network.colour for p in block.parameters()]
    decoders = [p for block in network.decoders for p in block.parameters()]
    mine = [*colour, *decoders, *network.classifier.parameters()]
    for p, given in zip(mine, plain.parameters(), strict=True):
        p.data.copy_(given)
    image, depth = torch.randn(1, 3, *ODD), torch.rand(1, 1, *ODD)
    with torch.no_grad():
        assert not torch.allclose(network(image, depth), plain(image), atol=1e-4)
        for layer in network.depth.modules():
            if isinstance(layer, nn.BatchNorm2d):
                layer.weight.zero_()
        assert torch.allclose(network(image, depth), plain(image), atol=1e-6)


def test_fusion_by_hand() -> None:
    """Depth is added behind the block and before the pool; its own pool does not know of colour."""
    colour, depth = torch.tensor([[[[1.0, 2.0]]]]), torch.tensor([[[[5.0, 3.0]]]])
    both, other, places = fused([nn.Identity()], [nn.Identity()], colour, depth)
    assert (both.item(), other.item(), places[0].item()) == (6.0, 5.0, 0)


def test_dropout_is_in_the_deepest_blocks_and_in_the_head() -> None:
    """Behind pools 3 and 4 of both encoders, behind the fused pool 5, and behind three decoders."""
    torch.manual_seed(0)
    network = FuseNet(4, 1 / 16).train()
    assert len(dropouts(network)) == 2 + 2 + 1 + BEFORE
    inputs = torch.randn(2, 3, *ODD), torch.rand(2, 1, *ODD)
    with torch.no_grad():
        features = network.features(*inputs)
        for once, again in zip(features, network.features(*inputs), strict=True):
            assert torch.equal(once, again)
        assert not torch.equal(network.head(*features), network.head(*features))
