"""Partners of a frame, its arrival, the clocks, the window: all told by integers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.errors import UsageError
from stsem.log.plan import FramePlan, median_period_ns, pair, pair_depth, pair_truth, window
from stsem.log.tracks import References

TIMES = st.lists(st.integers(0, 200), max_size=12).map(sorted)


def refs(stamps: list[int], logs: list[int] | None = None) -> References:
    zero = np.zeros(len(stamps), np.int64)
    return References(np.array(stamps, np.int64), np.array(logs or stamps, np.int64), zero, zero, zero)


def ms(*values: float) -> list[int]:
    return [round(value * 1e6) for value in values]


@settings(derandomize=True, max_examples=300, deadline=None)
@given(wanted=TIMES, offered=TIMES, limit=st.integers(0, 50))
def test_pairs_meet_closest_first_and_once(wanted: list[int], offered: list[int], limit: int) -> None:
    """Against the definition: go through all pairs by distance, and take those of which both are free."""
    expected = [-1] * len(wanted)
    every = sorted((abs(w - o), i, row) for i, w in enumerate(wanted) for row, o in enumerate(offered))
    for distance, i, row in every:
        if distance <= limit and expected[i] < 0 and row not in expected:
            expected[i] = row
    assert pair(np.array(wanted, np.int64), np.array(offered, np.int64), limit).tolist() == expected


def test_a_thousand_equal_stamps_cost_little() -> None:
    same = np.zeros(20_000, np.int64)
    assert (pair(same, same, 5) >= 0).sum() == 16


def test_depth_partner_is_the_nearest_within_half_a_period_or_20_ms() -> None:
    color = refs(ms(0, 33, 66, 100))
    assert pair_depth(color, refs(ms(11, 44, 77, 111))).tolist() == [0, 1, 2, 3]
    assert pair_depth(color, refs(ms(16, 49, 82, 116))).tolist() == [0, 1, 2, 3]
    assert pair_depth(color, refs(ms(17, 51, 85, 119))).tolist() == [
        -1,
        0,
        1,
        2,
    ]  # 17 ms is half a period; 16 is nearer
    assert pair_depth(refs(ms(0, 200)), refs(ms(20, 220.1))).tolist() == [0, -1]
    assert pair_depth(color, refs([])).tolist() == [-1] * 4
    assert pair_depth(color, refs(ms(20))).tolist() == [-1, 0, -1, -1]


def test_each_depth_image_is_used_once() -> None:
    """Two colour frames near one depth image: the nearer gets it."""
    assert pair_depth(refs(ms(0, 8)), refs(ms(5, 105))).tolist() == [-1, 0]


def test_truth_meets_by_equal_stamps_first() -> None:
    color = refs(ms(0, 100, 200, 300))
    assert [x.tolist() if hasattr(x, "tolist") else x for x in pair_truth(color, refs(ms(100, 300)))] == [
        [-1, 0, -1, 1],
        0,
    ]
    partners, inexact = pair_truth(color, refs(ms(100, 140, 251)))
    assert (partners.tolist(), inexact) == ([-1, 0, -1, 2], 1)  # 140 belongs to 100, which has its own
    partners, inexact = pair_truth(color, refs(ms(60)))
    assert (partners.tolist(), inexact) == ([-1, 0, -1, -1], 1)
    partners, inexact = pair_truth(color, refs(ms(-60, 360)))
    assert (partners.tolist(), inexact) == ([-1, -1, -1, -1], 0)


def test_a_plan_arrives_with_the_last_of_what_is_needed() -> None:
    plan = FramePlan(0, 100, color_log_ns=110, depth_log_ns=130, pose_log_ns=120, truth_log_ns=900)
    both = frozenset({"depth", "pose"})
    assert plan.arrival_ns(frozenset()) == 110
    assert plan.arrival_ns(frozenset({"pose"})) == 120
    assert plan.arrival_ns(both) == 130
    assert plan.missing(both) == ()
    assert plan.has_truth
    bare = FramePlan(0, 100, 110, None, None, None)
    assert bare.arrival_ns(both) == 110
    assert bare.missing(both) == ("depth", "pose")
    assert bare.missing(frozenset({"pose"})) == ("pose",)
    assert not bare.has_truth


def test_the_window_is_half_open_and_counts_from_the_first_stamp() -> None:
    stamps = np.array(ms(1000, 1100, 1200, 1300), np.int64)
    assert window(stamps, None, None) == slice(0, 4)
    assert window(stamps, 0.1, 0.3) == slice(1, 3)
    assert window(stamps, 0.05, None) == slice(1, 4)
    assert window(stamps, -1e300, 1e300) == slice(0, 4)
    with pytest.raises(UsageError, match=r"colour frames go from 0 to 0\.300 s"):
        window(stamps, 0.31, None)
    with pytest.raises(UsageError, match=r"No colour frame lies between --start 0\.2 and --end 0\.1"):
        window(stamps, 0.2, 0.1)


def test_the_period_is_the_median() -> None:
    assert median_period_ns(refs([0, 10, 20, 90, 100])) == 10
    assert median_period_ns(refs([5])) is None
