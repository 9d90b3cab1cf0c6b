"""DeepLab v2: its count by hand, where its classifiers look, the largest of three scales, the CRF behind it."""

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from torch.nn import functional

from stsem.models.cost import cost_of
from stsem.models.deeplab import SCALES, AtrousPyramid, DeepLab, at_scale, largest

pytestmark = pytest.mark.torch
RESNET_101, ITS_CLASSIFIER = 44_549_160, 2048 * 1000 + 1000
"""torchvision's count."""


@pytest.mark.parametrize("crf", [False, True])
def test_deeplab_is_a_resnet101_and_four_classifiers(crf: bool) -> None:
    """44.0 M for 21 classes, by arithmetic: torchvision's count without its classifier, and 3x3 ones with biases."""
    with torch.device("meta"):
        found = cost_of(DeepLab(21, crf=crf), 65)
    classifiers = 4 * (2048 * 9 * 21 + 21)
    assert found.parameters == RESNET_101 - ITS_CLASSIFIER + classifiers + crf * (2 * 21 + 21 * 21)
    assert found.parameters / 1e6 == pytest.approx(44.0, abs=0.05)


def test_the_scales_of_the_paper() -> None:
    """321 gives 321, 241 and 161; every side is 8 k + 1, at any size, and the corners stay."""
    image = torch.randn(1, 3, 321, 99, generator=torch.Generator().manual_seed(0))
    scaled = [at_scale(image, scale) for scale in SCALES]
    assert [tuple(x.shape[-2:]) for x in scaled] == [(321, 97), (241, 73), (161, 49)]
    for x in scaled:
        assert torch.allclose(x[..., 0, 0], image[..., 0, 0], atol=1e-6)
        assert torch.allclose(x[..., -1, -1], image[..., -1, -1], atol=1e-5)
    assert at_scale(torch.zeros(1, 3, 1, 1), 0.5).shape[-2:] == (9, 9)


def test_classifiers_look_6_12_18_and_24_cells_away() -> None:
    """The answer to one bright cell, with all weights 1."""
    pyramid = AtrousPyramid(1, 1)
    for classifier in pyramid.classifiers:
        torch.nn.init.ones_(classifier.weight)
        torch.nn.init.zeros_(classifier.bias)
    x = torch.zeros(1, 1, 51, 51)
    x[0, 0, 25, 25] = 1
    expected = torch.zeros(51, 51)
    for rate in (6, 12, 18, 24):
        for dy in (-rate, 0, rate):
            for dx in (-rate, 0, rate):
                expected[25 + dy, 25 + dx] += 1
    assert torch.equal(pyramid(x)[0, 0], expected)


def test_the_largest_score_wins() -> None:
    """By hand: 3 points over 2, whose middle lies between them."""
    fine, coarse = torch.tensor([[[[1.0, 5.0, 1.0]]]]), torch.tensor([[[[2.0, 0.0]]]])
    assert largest([fine, coarse]).flatten().tolist() == [2.0, 5.0, 1.0]


def test_the_scores_are_those_of_three_passes() -> None:
    """The network against itself at each size; sides for the loss are the scores of each."""
    torch.manual_seed(0)
    network = DeepLab(4, 1 / 16, depth=18).eval()
    image = torch.randn(1, 3, 65, 97)
    with torch.no_grad():
        scores = [network.pyramid(network.backbone(at_scale(image, scale))[1]) for scale in (1, 0.75, 0.5)]
        wide = [functional.interpolate(x, (9, 13), mode="bilinear", align_corners=True) for x in scores]
        answers = network.answers(image)
        assert torch.allclose(answers.probabilities, torch.stack(wide).amax(0).softmax(1), atol=1e-6)
    for side, x in zip(answers.sides, scores, strict=True):
        assert torch.allclose(side.logits, x, atol=1e-6)


def test_a_field_of_classes_that_do_not_care_changes_nothing() -> None:
    """On ResNet-18, at an odd size: with no compatibility the answer is the scores', on a quarter of the sides."""
    torch.manual_seed(0)
    network, image = DeepLab(4, 1 / 16, crf=True, depth=18).eval(), torch.randn(1, 3, 67, 97)
    with torch.no_grad():
        logits, _ = network.features(image)
        plain = functional.interpolate(logits, (17, 25), mode="bilinear", align_corners=True).softmax(1)
        assert not torch.allclose(network(image), plain, atol=1e-4)
        network.crf.compatibility.data.zero_()
        assert torch.allclose(network(image), plain, atol=1e-6)
