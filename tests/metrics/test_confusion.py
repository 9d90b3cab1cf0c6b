import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.classes import Labels
from stsem.metrics.confusion import ConfusionMatrix, confusion
from stsem.metrics.scores import scores, scores_of_tally, tally


def counted_plainly(truth: Labels, answer: Labels | None, classes: int) -> npt.NDArray[np.int64]:
    matrix = np.zeros((classes, classes + 1), np.int64)
    said = np.full(truth.shape, 255, np.uint8) if answer is None else answer
    for t, a in zip(truth.ravel().tolist(), said.ravel().tolist(), strict=True):
        if t < classes:
            matrix[t, min(a, classes)] += 1
    return matrix


@st.composite
def label_pairs(draw: st.DrawFn) -> tuple[Labels, Labels, int]:
    classes = draw(st.integers(1, 255))
    height, width = draw(st.integers(0, 9)), draw(st.integers(0, 9))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    top = draw(st.sampled_from([classes, min(classes + 2, 256), 256]))
    truth, answer = (rng.integers(0, top, (height, width)).astype(np.uint8) for _ in range(2))
    truth[rng.random(truth.shape) < 0.1] = 255
    answer[rng.random(answer.shape) < 0.1] = 255
    return truth, answer, classes


@given(label_pairs())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_every_pixel_is_counted_once_and_in_its_place(pair: tuple[Labels, Labels, int]) -> None:
    """The histogram equals a plain loop for ids in and out of range, ignored and unlabelled pixels, empty images."""
    truth, answer, classes = pair
    for said in (answer, None):
        matrix = confusion(truth, said, classes)
        assert matrix.dtype == np.int64
        np.testing.assert_array_equal(matrix, counted_plainly(truth, said, classes))


@given(label_pairs())
@settings(max_examples=100, deadline=None, derandomize=True)
def test_scores_stay_inside_their_bounds(pair: tuple[Labels, Labels, int]) -> None:
    """Scores are NaN without pixels, else 0 <= miou_union <= miou <= 1, and the perfect answer has 1."""
    truth, answer, classes = pair
    found = scores(confusion(truth, answer, classes))
    assert found.pixels == (truth < classes).sum()
    if not found.pixels:
        assert np.isnan([found.miou, found.miou_union, found.pixel_accuracy]).all()
        assert (found.classes_averaged, found.classes_averaged_union) == (0, 0)
        return
    assert 0 <= found.miou_union <= found.miou <= 1
    assert found.classes_averaged <= found.classes_averaged_union <= classes
    assert np.isnan(found.iou).sum() == classes - found.classes_averaged
    perfect = scores(confusion(truth, truth, classes))
    assert (perfect.miou, perfect.pixel_accuracy) == (1, 1)


def test_scores_worked_by_hand() -> None:
    """Two classes of truth, a third one predicted but absent, one ignored and one unlabelled pixel."""
    truth = np.array([[0, 0, 0, 0], [1, 1, 1, 255]], np.uint8)
    answer = np.array([[0, 0, 1, 255], [1, 2, 0, 0]], np.uint8)
    matrix = confusion(truth, answer, 4)
    assert matrix.tolist() == [[2, 1, 0, 0, 1], [1, 1, 1, 0, 0], [0] * 5, [0] * 5]
    found = scores(matrix)
    assert found.iou[:2].tolist() == [2 / 5, 1 / 4]  # TP / (TP + FP + FN): 2 / (2 + 1 + 2), 1 / (1 + 1 + 2)
    assert np.isnan(found.iou[2:]).all()
    assert found.miou == (2 / 5 + 1 / 4) / 2
    assert found.miou_union == (2 / 5 + 1 / 4) / 3
    assert (found.classes_averaged, found.classes_averaged_union, found.pixels) == (2, 3, 7)
    assert found.pixel_accuracy == 3 / 7


def test_scores_of_a_sum_are_not_the_mean_of_scores() -> None:
    """The accumulator sums matrices over frames."""
    first, second = np.zeros((2, 2), np.uint8), np.array([[0, 1], [1, 1]], np.uint8)
    meter = ConfusionMatrix(2)
    meter.update(first, first)
    meter.update(second, first)
    assert meter.compute().miou == (5 / 8 + 0) / 2
    assert meter.matrix.tolist() == [[5, 0, 0], [3, 0, 0]]


def test_counts_stay_exact_beyond_the_integers_of_float32() -> None:
    """More than 2^24 equal pixels, an odd number: float32 has only the even ones there."""
    truth = np.zeros((4097, 4099), np.uint8)
    truth[-1] = 1
    answer = truth.copy()
    answer[0, 0] = 255
    matrix = confusion(truth, answer, 2)
    assert matrix.tolist() == [[4096 * 4099 - 1, 0, 1], [0, 4099, 0]]
    assert confusion(truth, None, 2)[:, 2].tolist() == [4096 * 4099, 4099]


def test_views_are_counted_like_their_copies() -> None:
    """Strided and flipped views are no trap."""
    rng = np.random.default_rng(3)
    wide = rng.integers(0, 4, (20, 30, 2)).astype(np.uint8)
    truth, answer = wide[::-1, ::2, 0], wide[:, 15:, 1]
    np.testing.assert_array_equal(confusion(truth, answer, 4), counted_plainly(truth, answer, 4))


def test_a_fixed_class_set_keeps_its_classes() -> None:
    """A class of the set without truth scores 0 if predicted, and drops out if not."""
    counts = np.array([[4, 0, 0], [4, 0, 0], [5, 1, 0]])
    assert scores_of_tally(counts).miou == 4 / 5
    assert scores_of_tally(counts, np.array([True, True, True])).miou == (4 / 5 + 0) / 2
    assert scores_of_tally(counts, np.array([True, False, False])).miou_union == (4 / 5) / 2


def test_tallies_add_up_like_matrices() -> None:
    """The tally of a sum is the sum of the tallies, over any leading axes."""
    rng = np.random.default_rng(4)
    matrices = rng.integers(0, 9, (5, 3, 4))
    np.testing.assert_array_equal(tally(matrices).sum(axis=0), tally(matrices.sum(axis=0)))
    summed = matrices.sum(axis=0)
    assert tally(summed).tolist() == [
        np.diag(summed[:, :3]).tolist(),
        summed.sum(1).tolist(),
        summed[:, :3].sum(0).tolist(),
    ]


@pytest.mark.parametrize(
    ("truth", "answer", "classes", "said"),
    [
        (np.zeros((2, 2), np.int64), None, 3, "truth must be"),
        (np.zeros((2, 2), np.uint8), np.zeros((2, 2, 3), np.uint8), 3, "answer must be"),
        (np.zeros((2, 2), np.uint8), None, 0, "1 to 255 classes"),
        (np.zeros((2, 2), np.uint8), None, 256, "1 to 255 classes"),
    ],
)
def test_refuses_what_is_no_label_image(truth: Labels, answer: Labels | None, classes: int, said: str) -> None:
    """A wrong array is named."""
    with pytest.raises(ValueError, match=said):
        confusion(truth, answer, classes)
