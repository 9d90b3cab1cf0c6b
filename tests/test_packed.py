"""Packed rows behave as lists of what was put in; integers by log index as a dict."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.errors import LogError
from stsem.log.plan import FramePlan
from stsem.log.plans import FramePlans
from stsem.packed import ABSENT, IntByIndex
from stsem.replay.schedule import Slot, Slots
from stsem.result import STAGES, FrameResult, Outcome, Results, Span, Spans

TIMES = st.integers(-(1 << 63) + 1, (1 << 63) - 1)
INDICES = st.integers(0, 2**31 - 1)
MAYBE = st.none() | TIMES
RESULTS = st.builds(
    FrameResult, INDICES, TIMES, MAYBE, MAYBE, MAYBE, st.sampled_from(Outcome), st.none() | INDICES,
    st.text(max_size=9), st.none() | st.floats(0, 1),
)  # fmt: skip
SPANS = st.builds(
    Span, INDICES, st.sampled_from(STAGES), st.sampled_from([(0,), (1,), (0, 1)]), TIMES, TIMES, TIMES
)  # fmt: skip
SLOTS = st.builds(
    Slot, INDICES, TIMES, TIMES, TIMES, st.sampled_from([(), ("depth",), ("depth", "pose")]), st.booleans()
)  # fmt: skip
few = settings(max_examples=50, derandomize=True, deadline=None)


@few
@given(items=st.lists(RESULTS, max_size=8), place=st.slices(8))
def test_results_come_back_as_they_were(items: list[FrameResult], place: slice) -> None:
    packed = Results(items)
    assert [astuple(result) for result in packed] == [astuple(result) for result in items]
    assert [astuple(result) for result in packed[place]] == [astuple(result) for result in items[place]]
    packed.sort(key=lambda result: result.index)
    in_order = sorted(items, key=lambda result: result.index)
    assert [astuple(result) for result in packed] == [astuple(result) for result in in_order]


@few
@given(spans=st.lists(SPANS, max_size=8), slots=st.lists(SLOTS, max_size=8))
def test_spans_and_slots_come_back_as_they_were(spans: list[Span], slots: list[Slot]) -> None:
    assert list(Spans(spans)) == spans
    packed = Slots()
    for slot in slots:
        packed.append(slot)
    assert list(packed) == slots
    if slots:
        assert (packed[0], packed[-1]) == (slots[0], slots[-1])
    with pytest.raises(IndexError):
        packed[len(slots)]


def test_results_leave_labels_and_spans_out() -> None:
    result = FrameResult(0, 0, 0, 0, 0, Outcome.SEGMENTED, 0, labels=np.zeros((1, 1), np.uint8))
    (kept,) = Results([replace(result, spans=(Span(0, "segment", (0,), 0, 0, 1),))])
    assert (kept.labels, kept.spans) == (None, ())


def test_a_time_beyond_64_bits_is_a_sentence() -> None:
    with pytest.raises(LogError, match="292 years"):
        Slots().append(Slot(0, 0, 0, 1 << 63, (), has_truth=False))


@few
@given(st.dictionaries(st.integers(0, 40), TIMES))
def test_integers_by_index_are_a_dict(values: dict[int, int]) -> None:
    kept = IntByIndex()
    for index, value in values.items():
        kept[index] = value
    assert (kept, len(kept), list(kept)) == (values, len(values), sorted(values))
    assert [kept.get(index) for index in range(-1, 42)] == [values.get(index) for index in range(-1, 42)]


@few
@given(rows=st.lists(st.tuples(TIMES, TIMES, MAYBE, MAYBE, MAYBE), max_size=9), place=st.slices(9))
def test_plans_come_back_as_they_were(
    rows: list[tuple[int, int, int | None, int | None, int | None]], place: slice
) -> None:
    plans = [FramePlan(index, *row) for index, row in enumerate(rows)]
    values = [[ABSENT if value is None else value for value in row] for row in rows]
    packed = FramePlans(*np.array(values, np.int64).reshape(-1, 5).T)
    assert (len(packed), list(packed), packed[place]) == (len(plans), plans, plans[place])
    assert [packed[index] for index in range(len(plans))] == plans
