"""What is called a difference: Student's paired t at 95 %, against scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.paper.statistics import T95, compare, spread

stats = pytest.importorskip("scipy.stats", reason="the oracle scipy is not installed")
SCORES = st.lists(st.tuples(*2 * [st.floats(0, 100).map(lambda x: round(x, 3))]), min_size=2, max_size=10)


def test_quantiles() -> None:
    """The table is Student's."""
    np.testing.assert_allclose(T95, stats.t.ppf(0.975, np.arange(1, len(T95) + 1)), atol=5e-4)


@settings(max_examples=200)
@given(SCORES)
def test_called_as_the_paired_t_test_calls_it(scores: list[tuple[float, float]]) -> None:
    """Below 5 % and only there, as far as the table's digits reach."""
    a, b = (dict(enumerate(column)) for column in zip(*scores, strict=True))
    found = compare(a, b)
    deltas = np.array([x - y for x, y in scores])
    assert found.spread.mean == pytest.approx(deltas.mean(), abs=1e-9)
    if deltas.std() < 1e-6:
        assert found.called == (abs(deltas.mean()) > (found.margin or 0.0))
        return
    p = stats.ttest_rel(*zip(*scores, strict=True)).pvalue
    if abs(p - 0.05) > 1e-3:
        assert found.called == (p < 0.05)


def test_one_seed_calls_nothing() -> None:
    """However far apart."""
    assert not compare({0: 99.0}, {0: 1.0}).called
    assert spread([3.0]).deviation is None


def test_only_shared_seeds_are_compared() -> None:
    """A seed that one of them lacks is left out; none in common is an error."""
    found = compare({0: 5.0, 1: 6.0, 7: 0.0}, {0: 4.0, 1: 4.0, 8: 0.0})
    assert (found.spread.n, found.spread.mean) == (2, 1.5)
    with pytest.raises(ValueError, match="0 came"):
        compare({0: 1.0}, {1: 1.0})


def test_three_seeds_by_hand() -> None:
    """2.48 standard deviations are the limit that docs/paper-tables.md states."""
    sd = 1.0  # of -1, 0, 1
    near, far = ({i: mean + d for i, d in enumerate((-1.0, 0.0, 1.0))} for mean in (2.47 * sd, 2.49 * sd))
    zero = dict.fromkeys(range(3), 0.0)
    assert not compare(near, zero).called
    assert compare(far, zero).called
    assert compare(zero, far).called
