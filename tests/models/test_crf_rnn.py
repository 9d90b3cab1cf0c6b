"""CRF-RNN: mean field against loops over every pair of cells, what it does to a noisy answer, published counts."""

import numpy as np
import numpy.typing as npt
import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.models.cost import cost_of
from stsem.models.crf_rnn import CRFRNN, MeanField, affinities
from stsem.models.fcn import FCN

pytestmark = pytest.mark.torch
Array = npt.NDArray[np.float64]
CELLS = (8, 15)
"""More columns than a window has, and fewer rows."""


def _cell_colours(image: Array) -> Array:
    """Means over the 5 x 5 pixels around every fourth one, as far as there are any: (3, H, W) -> (3, h, w)."""
    return np.array([
        [[channel[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3].mean() for x in range(0, image.shape[2], 4)]
         for y in range(0, image.shape[1], 4)] for channel in image
    ])  # fmt: skip


def _kernels(colours: Array) -> Array:
    """(2, h w, h w), rows sum to 1: equation 3 of Krähenbühl and Koltun, theta 160, 3 and 3, cut at 5 cells."""
    h, w = colours.shape[1:]
    kernels = np.zeros((2, h * w, h * w))
    for i, (y, x) in enumerate(np.ndindex(h, w)):
        for j, (v, u) in enumerate(np.ndindex(h, w)):
            if i == j or max(abs(y - v), abs(x - u)) > 5:
                continue
            pixels = 16.0 * ((y - v) ** 2 + (x - u) ** 2)
            levels = 57.4**2 * ((colours[:, y, x] - colours[:, v, u]) ** 2).sum()
            kernels[0, i, j] = np.exp(-pixels / (2 * 3.0**2))
            kernels[1, i, j] = np.exp(-pixels / (2 * 160.0**2) - levels / (2 * 3.0**2))
    return kernels / kernels.sum(2, keepdims=True)


def _softmax(logits: Array) -> Array:
    exponentials = np.exp(logits - logits.max(0))
    return np.asarray(exponentials / exponentials.sum(0))


def _mean_field(unary: Array, kernels: Array, weights: Array, compatibility: Array, iterations: int) -> Array:
    """Algorithm 1 of Zheng et al. for logits (C, N)."""
    believed = _softmax(unary)
    for _ in range(iterations):
        messages = np.stack([believed @ kernel.T for kernel in kernels])  # (2, C, N)
        weighted = (weights[..., None] * messages).sum(0)
        believed = _softmax(unary - compatibility @ weighted)
    return believed


@pytest.mark.parametrize("training", [True, False])
def test_mean_field_is_the_sum_over_all_pairs(training: bool) -> None:
    """Random logits, weights and compatibility; colours alike enough for the bilateral kernel to matter."""
    rng, classes = np.random.default_rng(0), 3
    image = 0.3 * rng.normal(size=(3, 4 * CELLS[0] - 3, 4 * CELLS[1] - 3))
    unary = rng.normal(size=(classes, *CELLS))
    layer = MeanField(classes).train(training)
    layer.weights.data += torch.from_numpy(rng.normal(size=(2, classes))).float()
    layer.compatibility.data += torch.from_numpy(0.3 * rng.normal(size=(classes, classes))).float()
    kernels = _kernels(_cell_colours(image))
    given, neighbours = torch.from_numpy(image[None]).float(), kernels > 0
    with torch.no_grad():
        got = layer(torch.from_numpy(unary[None]).float(), affinities(given))[0].numpy()
    weights, compatibility = (x.detach().double().numpy() for x in (layer.weights, layer.compatibility))
    flat, iterations = unary.reshape(classes, -1), 5 if training else 10
    expected = _mean_field(flat, kernels, weights, compatibility, iterations).reshape(got.shape)
    assert got == pytest.approx(expected, abs=1e-5)
    assert neighbours[0].sum(1).max() == 8 * 11 - 1
    assert kernels[1][neighbours[1]].std() > 0.5 * kernels[1][neighbours[1]].mean()
    assert (
        np.abs(expected - _mean_field(flat, kernels, weights, compatibility, iterations - 1).reshape(got.shape)).max()
        > 1e-4
    )


@pytest.mark.parametrize("size", [(1, 1), (4, 3), (30, 61)])
def test_affinities_at_any_size(size: tuple[int, int]) -> None:
    """A quarter of the sides, rounded up; each window sums to 1, even that of a cell alone."""
    found = affinities(torch.randn(2, 3, *size, generator=torch.Generator().manual_seed(0)))
    h, w = (-(-side // 4) for side in size)
    assert found.shape == (2, 2, 11, h, 11, w)
    assert torch.allclose(found.sum((2, 4)), torch.ones(()))
    if h * w > 1:
        assert not found[:, :, 5, :, 5].any()


def test_noise_goes_and_edges_stay() -> None:
    """Two surfaces of different colour, a fifth of the cells labelled wrong: the field finds the edge."""
    rng = np.random.default_rng(1)
    truth = np.arange(65)[None, :].repeat(49, 0) > 38
    image = torch.from_numpy(np.where(truth, 0.5, -0.5) + 0.02 * rng.normal(size=(1, 3, 49, 65))).float()
    cells = truth[::4, ::4]
    noisy = np.where(rng.random(cells.shape) < 0.2, ~cells, cells)
    logits = torch.from_numpy(np.stack([~noisy, noisy])[None]).float()
    with torch.no_grad():
        found = MeanField(2).eval()(logits, affinities(image)).argmax(1)[0].numpy()
    assert (noisy == cells).mean() < 0.85
    assert (found == cells).mean() > 0.99


def test_crf_rnn_is_fcn8s_and_few_weights() -> None:
    """21 classes: two kernels' weights for each class and the compatibility, beside FCN-8s."""
    with torch.device("meta"):
        both, fcn = cost_of(CRFRNN(21), 65), cost_of(FCN(21), 65)
    assert both.parameters - fcn.parameters == 2 * 21 + 21 * 21
