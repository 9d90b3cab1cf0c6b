"""ParseNet: its count, normalisation by hand, and a context that every cell shares."""

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.models.cost import cost_of
from stsem.models.parsenet import L2Norm, ParseNet

pytestmark = pytest.mark.torch


def test_parsenet_is_deeplab_largefov_with_context() -> None:
    """20.5 M weights published for 21 classes; beside them two scales and the other half of the classifier."""
    with torch.device("meta"):
        found = cost_of(ParseNet(21), 65)
    assert found.parameters - 2 * 1024 - 21 * 1024 == 20_505_429


def test_normalisation_by_hand() -> None:
    """(3, 4) has length 5: ten times (0.6, 0.8); zeros stay zeros."""
    norm = L2Norm(2)
    with torch.no_grad():
        assert norm(torch.tensor([[3.0, 0.0], [4.0, 0.0]])[None, :, None]).flatten().tolist() == [6.0, 0.0, 8.0, 0.0]
        norm.scale[1] = 1
        assert norm(torch.tensor([3.0, 4.0])[None, :, None, None]).flatten().tolist() == pytest.approx([6.0, 0.8])


def test_every_cell_sees_the_mean_of_all() -> None:
    """With the local half of the classifier at zero all cells answer alike, from features that differ."""
    torch.manual_seed(0)
    network = ParseNet(4, 1 / 16).eval()
    half = network.classifier.in_channels // 2
    image = torch.randn(1, 3, 65, 97)
    with torch.no_grad():
        assert network(image).std((2, 3)).min() > 1e-4
        network.classifier.weight[:, :half] = 0
        probabilities = network(image)
        mean = network.fc7(*network.features(image)).mean((2, 3))
        context = 10 * mean / mean.norm()
        by_hand = network.classifier.weight[:, half:, 0, 0] @ context[0] + network.classifier.bias
    assert probabilities.shape == (1, 4, 9, 13)
    assert torch.allclose(probabilities[0].flatten(1), by_hand.softmax(0)[:, None], atol=1e-5)


def test_sides_whose_grid_has_the_corners_of_the_image() -> None:
    """Sides 8 k + 1 fit; other sides name the nearest."""
    network = ParseNet(4, 1 / 16)
    assert [side for side in range(1, 50) if network.fits(side)] == [9, 17, 25, 33, 41, 49]
    assert [network.nearest_side(side) for side in (1, 480, 640)] == [9, 481, 641]
