"""Scores against torchmetrics and torch, where definitions agree."""

import numpy as np
import pytest

from stsem.metrics.confusion import confusion, resized
from stsem.metrics.scores import scores

torch = pytest.importorskip("torch")
torchmetrics = pytest.importorskip("torchmetrics.functional.classification")
pytestmark = pytest.mark.torch


def test_agrees_with_torchmetrics_where_definitions_do() -> None:
    """Without unlabelled pixels and with every class present, torchmetrics agrees to 1e-6 (it computes in float32)."""
    rng = np.random.default_rng(1)
    truth = rng.integers(0, 7, (90, 120)).astype(np.uint8)
    answer = np.where(rng.random(truth.shape) < 0.6, truth, rng.integers(0, 7, truth.shape)).astype(np.uint8)
    truth[:10] = 255
    found = scores(matrix := confusion(truth, answer, 7))
    said, true = torch.from_numpy(answer.astype(np.int64)), torch.from_numpy(truth.astype(np.int64))
    theirs = torchmetrics.multiclass_confusion_matrix(said, true, 7, ignore_index=255).numpy()
    np.testing.assert_array_equal(matrix[:, :7], theirs)
    iou = torchmetrics.multiclass_jaccard_index(said, true, 7, average=None, ignore_index=255).numpy()
    np.testing.assert_allclose(found.iou, iou, atol=1e-6)
    assert found.miou == pytest.approx(
        float(torchmetrics.multiclass_jaccard_index(said, true, 7, ignore_index=255)), abs=1e-6
    )
    accuracy = torchmetrics.multiclass_accuracy(said, true, 7, average="micro", ignore_index=255)
    assert found.pixel_accuracy == pytest.approx(float(accuracy), abs=1e-6)


def test_an_answer_of_another_size_is_taken_by_nearest_pixel_centre() -> None:
    """Nearest neighbour by centres, as torch's nearest-exact; no new labels appear."""
    rng = np.random.default_rng(2)
    answer = rng.integers(0, 5, (13, 17)).astype(np.uint8)
    truth = rng.integers(0, 5, (30, 41)).astype(np.uint8)
    wanted = torch.nn.functional.interpolate(
        torch.from_numpy(answer)[None, None].float(), (30, 41), mode="nearest-exact"
    )
    bigger = resized(answer, 41, 30)
    np.testing.assert_array_equal(bigger, wanted[0, 0].numpy().astype(np.uint8))
    np.testing.assert_array_equal(confusion(truth, answer, 5), confusion(truth, bigger, 5))
