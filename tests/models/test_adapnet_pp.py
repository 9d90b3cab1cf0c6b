"""AdapNet++ and SSMA: counts beside the published ones, grids, units, gates."""

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.models.adapnet_pp import SSMA, AdapNetPP, EfficientPyramid, Encoder, Refine, Unit

pytestmark = pytest.mark.torch
BOTH = ("image", "depth")
ODD = (67, 97)


def _parameters(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def _variables(module: torch.nn.Module) -> int:
    """Weights and the running statistics of normalisation: what TensorFlow keeps of a network."""
    return _parameters(module) + sum(x.numel() for name, x in module.named_buffers() if "running" in name)


def test_adapnet_pp_has_the_published_size() -> None:
    """12 classes: 30.20 M in the paper and in the authors' README, which counts running statistics, too."""
    with torch.device("meta"):
        network = AdapNetPP(12)
    assert _variables(network) == pytest.approx(30.20e6, abs=0.005e6)
    assert _variables(network) - _parameters(network) == 52_448


def test_ssma_costs_a_second_encoder_and_its_gates() -> None:
    """56.44 M in the authors' README, 56.28 M here, of which the depth's one channel instead of three is 6 k."""
    with torch.device("meta"):
        one, two = AdapNetPP(12), AdapNetPP(12, inputs=BOTH)
    encoder, fusion = _parameters(one.encoders), _parameters(two.fusions)
    correlation = 2 * (256 + 1) * 24
    assert _parameters(two) - _parameters(one) == encoder - 2 * 64 * 49 + fusion + correlation
    assert _variables(two) == pytest.approx(56.44e6, rel=0.003)


def test_the_pyramid_has_the_published_size() -> None:
    """eASPP by hand. A pyramid with as many distances, but without bottlenecks, has more than ten times as many weights
    (abstract): five branches of 3x3 on 2048 channels."""
    cascade = 2048 * 64 + 2 * 64 * 64 * 9 + 64 * 256 + 2 * (3 * 64 + 256)
    point, mean, join = 2048 * 256 + 512, 2048 * 256 + 256, 5 * 256 * 256 + 512
    assert _parameters(EfficientPyramid(2048, 256, 64)) == point + 3 * cascade + mean + join
    assert (point + 3 * cascade + mean + join) * 10 < 5 * 2048 * 256 * 9


def test_two_dilations_cost_no_weights() -> None:
    """Halves of the channels look at either distance; an odd channel goes to the first."""
    assert _parameters(Unit(32, 8, 1, (2, 16))) == _parameters(Unit(32, 8, 1, (1,)))
    unit = Unit(36, 9, 1, (2, 16))
    assert [(scale.out_channels, scale.dilation) for scale in unit.scales] == [(5, (2, 2)), (4, (16, 16))]
    assert unit.shortcut is None
    assert unit(torch.zeros(1, 36, 5, 7)).shape == (1, 36, 5, 7)


@pytest.mark.parametrize("size", [ODD, (64, 96), (1, 1)])
def test_grids(size: tuple[int, int]) -> None:
    """A sixteenth, an eighth and a quarter of the sides, rounded up; the answer has the image's own."""
    network = AdapNetPP(3, 1 / 16, inputs=BOTH).eval()
    image, depth = torch.zeros(1, 3, *size), torch.zeros(1, 1, *size)
    with torch.no_grad():
        levels = network.encoders["depth"](depth)
        answers = network.answers(image, depth)
    assert [tuple(x.shape[-2:]) for x in levels] == [tuple(-(-side // s) for side in size) for s in (16, 8, 4)]
    assert [tuple(x.logits.shape[-2:]) for x in answers.sides] == [
        tuple(-(-side // s) for side in size) for s in (8, 4)
    ]
    assert [side.weight for side in answers.sides] == [0.6, 0.5]
    assert answers.probabilities.shape == (1, 3, *size)


def test_a_gate_chooses_between_modalities() -> None:
    """Half of either where it knows nothing; wide open for one and shut for the other, the other does not matter."""
    torch.manual_seed(0)
    fusion = SSMA(8, 2).eval()
    last = fusion.gate[-1]
    last.weight.data.zero_()
    last.bias.data.zero_()
    colour, depth, other = torch.randn(3, 1, 8, 5, 7)
    with torch.no_grad():
        assert torch.allclose(fusion(colour, depth), fusion.join(torch.cat([colour, depth], 1) / 2), atol=1e-6)
        assert not torch.allclose(fusion(colour, depth), fusion(colour, other), atol=1e-3)
        last.bias[:8], last.bias[8:] = 100, -100
        assert torch.allclose(fusion(colour, depth), fusion(colour, other), atol=1e-6)
        assert not torch.allclose(fusion(colour, depth), fusion(other, depth), atol=1e-3)


def test_skips_are_weighed_by_what_the_decoder_knows() -> None:
    """Only behind SSMA: where the mean of the features says nothing, the skip is left out."""
    torch.manual_seed(0)
    x, skips = torch.randn(1, 8, 3, 4), torch.randn(2, 1, 4, 6, 8)
    for correlate in (False, True):
        stage = Refine(8, 4, correlate=correlate).eval()
        if stage.correlate is not None:
            torch.nn.init.zeros_(stage.correlate[0].weight)
            torch.nn.init.zeros_(stage.correlate[0].bias)
        with torch.no_grad():
            (large, one), (_, two) = (stage(x, skip) for skip in skips)
        assert large.shape == (1, 8, 6, 8)
        assert torch.equal(one, two) == correlate


def test_depth_has_one_channel() -> None:
    """Metres, not a coloured image."""
    assert next(Encoder(1, 1 / 16).parameters()).shape[1] == 1
