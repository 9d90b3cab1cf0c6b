"""Some pixels as a small image: all of them are in it, in order, and nothing else."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from stsem.chance import generator
from stsem.geometry.packed import PACKED_WIDTH, packed


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 5 * PACKED_WIDTH))
@example(1)
@example(PACKED_WIDTH)
@example(PACKED_WIDTH + 1)
@example(2 * PACKED_WIDTH)
def test_the_rows_come_in_order_and_the_last_one_fills_the_end_up(count: int) -> None:
    rows = generator(count, "rows").integers(0, 1 << 40, count).astype(np.intp)
    before = rows.copy()
    found = packed(rows)
    assert found.dtype == np.intp
    assert found.shape == (-(-count // PACKED_WIDTH), min(count, PACKED_WIDTH))
    np.testing.assert_array_equal(found.reshape(-1)[:count], rows)
    assert (found.reshape(-1)[count:] == rows[-1]).all()
    np.testing.assert_array_equal(rows, before)
