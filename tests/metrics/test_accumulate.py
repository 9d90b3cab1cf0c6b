"""What is kept of every judged frame."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from stsem.metrics.accumulate import FrameTallies
from stsem.metrics.scores import tally

CLASSES = 4


@settings(max_examples=50, derandomize=True, deadline=None)
@given(
    matrices=hnp.arrays(
        np.int64, st.tuples(st.integers(0, 6), st.just(CLASSES), st.just(CLASSES + 1)),
        elements=st.sampled_from([0, 0, 0, 1, 2**22]),
    ),
    random=st.randoms(use_true_random=False),
)  # fmt: skip
def test_tallies_come_back_whatever_classes_a_frame_shows(matrices: np.ndarray, random: object) -> None:
    """Frames in any order come back by index, and can still be added behind."""
    order = list(range(len(matrices)))
    random.shuffle(order)  # type: ignore[attr-defined]
    kept = FrameTallies(CLASSES)
    for index in order:
        kept.update(3 * index, 100 * index, matrices[index])
    found = kept.compute()
    assert found.index.tolist() == [3 * index for index in range(len(matrices))]
    assert found.stamp_ns.tolist() == [100 * index for index in range(len(matrices))]
    assert np.array_equal(found.tallies, tally(matrices))
    assert found.class_set.tolist() == (matrices.sum(axis=(0, 2)) > 0).tolist()
    kept.update(3 * len(matrices), 0, np.ones((CLASSES, CLASSES + 1), np.int64))
    assert len(kept.compute()) == len(matrices) + 1
