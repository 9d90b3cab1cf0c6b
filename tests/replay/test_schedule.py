"""When frames arrive: exact rationals, needed and optional channels, watermarks."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stsem.log.plan import FramePlan
from stsem.replay.schedule import horizon_ns, schedule, watermarks

from .conftest import MS, START_NS

BOTH = frozenset({"depth", "pose"})
NONE: frozenset[str] = frozenset()
RATES = st.fractions(Fraction(1, 1000), 1000, max_denominator=10**6)
LOGS = st.lists(st.tuples(st.integers(1, 10**9), st.integers(0, 10**9)), min_size=1, max_size=30)


def plans(steps: list[tuple[int, int]]) -> list[FramePlan]:
    """Frames with the given (step of the stamp, delay of the log time)."""
    found, stamp = [], START_NS
    for i, (step, delay) in enumerate(steps):
        stamp += step
        found.append(FramePlan(i, stamp, stamp + delay, None, None, None))
    return found


@given(steps=LOGS, rate=RATES)
def test_stamps_shrink_and_delays_do_not(steps: list[tuple[int, int]], rate: Fraction) -> None:
    """sim_stamp = floor((stamp - stamp_0) / r) exactly; sim_arrival - sim_stamp = arrival - stamp."""
    log = plans(steps)
    slots = schedule(log, rate, NONE, NONE)
    assert [s.index for s in slots] == [p.index for p in log]
    for plan, slot in zip(log, slots, strict=True):
        exact = Fraction(plan.stamp_ns - log[0].stamp_ns) / rate
        assert slot.stamp_ns <= exact < slot.stamp_ns + 1
        assert slot.arrival_ns - slot.stamp_ns == plan.color_log_ns - plan.stamp_ns
        assert slot.log_stamp_ns == plan.stamp_ns
    assert slots[0].stamp_ns == 0


@given(steps=LOGS, rate=RATES)
def test_watermarks(steps: list[tuple[int, int]], rate: Fraction) -> None:
    """The earliest arrival among the later frames; behind everything for the last."""
    slots = schedule(plans(steps), rate, NONE, NONE)
    arrivals = [slot.arrival_ns for slot in slots]
    assert list(watermarks(slots)) == [min(arrivals[i + 1 :], default=max(arrivals) + 1) for i in range(len(slots))]


def test_an_empty_log() -> None:
    """Nothing arrives."""
    assert schedule([], Fraction(1), NONE, BOTH)[:] == []
    assert list(watermarks([])) == []
    assert horizon_ns([], 100, Fraction(1)) == 100


@pytest.mark.parametrize(
    ("required", "optional", "arrivals_ms", "missing"),
    [
        (NONE, NONE, [5, 6, 7], [(), (), ()]),
        (NONE, BOTH, [40, 20, 7], [(), (), ()]),
        (frozenset({"depth"}), NONE, [5, 20, 7], [("depth",), (), ("depth",)]),
        (BOTH, NONE, [40, 20, 7], [("depth",), ("pose",), ("depth", "pose")]),
        (frozenset({"pose"}), frozenset({"depth"}), [40, 20, 7], [(), ("pose",), ("pose",)]),
    ],
)
def test_channels(
    required: frozenset[str], optional: frozenset[str], arrivals_ms: list[int], missing: list[tuple[str, ...]]
) -> None:
    """A frame arrives with the last of what is needed or waited for; only the needed can be missing.

    Frame 0 has a pose (40 ms), frame 1 depth (20 ms), frame 2 neither.
    """
    log = [
        FramePlan(0, START_NS, START_NS + 5 * MS, None, START_NS + 40 * MS, None),
        FramePlan(1, START_NS, START_NS + 6 * MS, START_NS + 20 * MS, None, None),
        FramePlan(2, START_NS, START_NS + 7 * MS, None, None, START_NS + 9 * MS),
    ]
    slots = schedule(log, Fraction(1), required, optional)
    assert [s.arrival_ns // MS for s in slots] == arrivals_ms
    assert [s.missing for s in slots] == missing
    assert [s.has_truth for s in slots] == [False, False, True]


def test_the_horizon() -> None:
    """One simulated median period after the last arrival, whichever frame that is."""
    slots = schedule(plans([(10, 900), (10, 0)]), Fraction(1), NONE, NONE)
    assert horizon_ns(slots, 100, Fraction(1)) == 1000
    assert horizon_ns(slots, 100, Fraction(3)) == 933
