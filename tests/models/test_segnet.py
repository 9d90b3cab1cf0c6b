"""SegNet, SegNet-Basic and Bayesian SegNet: published counts, unpooling to the pixel, dropout where it belongs."""

from pathlib import Path

import numpy as np
import onnxruntime
import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from torch import nn

from stsem.models.bayesian_segnet import BayesianSegNet
from stsem.models.cost import cost_of
from stsem.models.export import OPSET
from stsem.models.fcn import FCN
from stsem.models.montecarlo import fix_masks, uncertainty
from stsem.models.network import SegmentationNetwork, dropouts
from stsem.models.parsenet import ParseNet
from stsem.models.segnet import SegNet, SegNetBasic, decoded, encoded

pytestmark = pytest.mark.torch
ODD = (67, 97)
"""Height and width; no pool divides either."""


@pytest.mark.parametrize(("make", "published", "biases"), [
    (SegNet, 29.45e6, 2 * 4_224 - 512), (BayesianSegNet, 29.45e6, 2 * 4_224 - 512), (SegNetBasic, 1.417e6, 512),
])  # fmt: skip
def test_segnet_has_the_published_size(make: type[SegmentationNetwork], published: float, biases: int) -> None:
    """11 classes; the authors' models also have biases before batch normalisations. SegNet-Basic's published 1.425 M is
    not what its layers add up to."""
    with torch.device("meta"):
        found = cost_of(make(11), 65)
    assert found.parameters + biases == pytest.approx(published, abs=0.5e3 if make is SegNetBasic else 5e3)


class _PoolAndUnpool(nn.Module):
    """Three pools and back, nothing between."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        nothing = nn.ModuleList(nn.Identity() for _ in range(3))
        pooled, places = encoded(nothing, x)
        return decoded(nothing, pooled, places, x)


def _reference(x: torch.Tensor, levels: int = 3) -> torch.Tensor:
    """The same by torch's own layers."""
    if levels == 0:
        return x
    pooled, where = nn.MaxPool2d(2, ceil_mode=True, return_indices=True)(x)
    return nn.MaxUnpool2d(2)(_reference(pooled, levels - 1), where, output_size=x.shape[-2:])


def test_unpooling_puts_maxima_back() -> None:
    """By hand: the first of two equal values; the rest of an odd border alone."""
    x = torch.tensor([[1.0, 1.0, 4.0], [0.0, 1.0, 5.0], [-3.0, -2.0, -6.0]])[None, None]
    pooled, places = encoded([nn.Identity()], x)
    assert pooled[0, 0].tolist() == [[1.0, 5.0], [-2.0, -6.0]]
    back = decoded([nn.Identity()], pooled, places, x)[0, 0].tolist()
    assert back == [[1.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.0, -2.0, -6.0]]


@pytest.mark.filterwarnings("ignore")
def test_unpooling_in_the_exported_graph_is_torchs(tmp_path: Path) -> None:
    """Every bit, at odd sizes, for a batch, and where most values of a window are equal, as after a ReLU."""
    x = torch.randint(0, 3, (2, 5, *ODD), generator=torch.Generator().manual_seed(0)).float()
    path = tmp_path / "unpool.onnx"
    torch.onnx.export(_PoolAndUnpool().eval(), (x,), path, dynamo=True, external_data=False, opset_version=OPSET,
                      verbose=False, input_names=["x"])  # fmt: skip
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    (got,) = session.run(None, {"x": x.numpy()})
    expected = _reference(x)
    assert torch.equal(_PoolAndUnpool()(x), expected)
    assert np.array_equal(got, expected.numpy())
    assert 0 < (got != 0).mean() < 1 / 50


@pytest.mark.parametrize("make", [SegNet, SegNetBasic, BayesianSegNet])
def test_the_answer_has_the_images_size(make: type[SegmentationNetwork]) -> None:
    """Whatever it is, down to one pixel."""
    network = make(3, 1 / 16).eval()
    with torch.no_grad():
        for size in (ODD, (32, 64), (1, 5)):
            assert network(torch.zeros(1, 3, *size)).shape == (1, 3, *size)


@pytest.mark.parametrize(("make", "layers"), [(BayesianSegNet, 6), (FCN, 2), (ParseNet, 2)])
def test_dropout_is_in_the_head_alone(make: type[SegmentationNetwork], layers: int) -> None:
    """Features are the same again in training; answers are not, and Monte Carlo samples differ, all layers masked."""
    torch.manual_seed(0)
    network, image = make(3, 1 / 16), torch.randn(1, 3, *ODD)
    assert len(dropouts(network)) == layers
    with torch.no_grad():
        once, again = network.train().features(image), network.features(image)
        assert all(map(torch.equal, once, again))
        assert not torch.equal(network.head(*once), network.head(*once))
        fixed = fix_masks(network.eval(), image, passes=4)
        assert not dropouts(fixed)
        maps = uncertainty(fixed, *fixed.features(image), passes=4)
        assert torch.equal(fixed(image), network(image))
    assert min(x.max() for x in maps) > 1e-5
