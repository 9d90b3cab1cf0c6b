"""Small tables: queue rules, modes, and the memory of a segmenter."""

from collections import deque

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stsem.errors import UsageError
from stsem.frame import Frame, Segmentation
from stsem.replay.memo import Memo
from stsem.replay.modes import MODES, parse_modes
from stsem.replay.queues import Mailbox, parse_queue

from .conftest import NumberSegmenter


@given(rule=st.sampled_from(["latest", "fifo:1", "fifo:2", "fifo:5", "lossless"]), puts=st.lists(st.booleans()))
def test_nothing_is_lost(rule: str, puts: list[bool]) -> None:
    """Whatever is put in comes out once: taken, dropped, or still waiting; the waiting ones in order of arrival."""
    capacity, newest_wins = parse_queue(rule)
    box, came, gone = Mailbox(capacity, newest_wins), 0, []
    model: deque[int] = deque()
    for put in puts:
        if put:
            dropped = box.put(came)
            model.append(came)
            if dropped is not None:
                assert dropped == (model[0] if newest_wins else came)
                model.remove(dropped)
                gone.append(dropped)
            came += 1
        else:
            taken = box.take()
            assert taken == (model.popleft() if model else None)
            gone += [] if taken is None else [taken]
        assert len(box) == len(model) <= capacity
    assert sorted([*gone, *model]) == list(range(came))


def test_who_is_dropped() -> None:
    """`latest` drops the one that waits, `fifo` the one that comes, `lossless` nobody."""
    latest = Mailbox(*parse_queue("latest"))
    assert [latest.put(i) for i in range(3)] == [None, 0, 1]
    fifo = Mailbox(*parse_queue("fifo:2"))
    assert [fifo.put(i) for i in range(4)] == [None, None, 2, 3]
    lossless = Mailbox(*parse_queue("lossless"))
    assert [lossless.put(i) for i in range(1000)] == [None] * 1000
    assert [box.take() for box in (latest, fifo, lossless)] == [2, 0, 0]


@pytest.mark.parametrize(
    "text", ["", "latest:1", "lossless:2", "fifo", "fifo:", "fifo:0", "fifo:-1", "fifo:1.5", "lifo:1"]
)
def test_no_such_queue(text: str) -> None:
    """The valid spellings are named."""
    with pytest.raises(UsageError, match=r"latest, fifo:N .* or lossless"):
        parse_queue(text)


def test_modes() -> None:
    """In the table's order, each once; `both` is the default pair."""
    assert [m.name for m in parse_modes("keyframe,per-frame,keyframe")] == ["per-frame", "keyframe"]
    assert parse_modes("both") == parse_modes(" per-frame , keyframe ") == (MODES["per-frame"], MODES["keyframe"])
    assert parse_modes("keyframe-async,both") == tuple(MODES.values())
    assert [m.name for m in parse_modes("keyframe")] == ["keyframe"]
    assert [m.network_cores for m in MODES.values()] == [2, 2, 1]
    for text in ("", " , ", "perframe", "both,async"):
        with pytest.raises(UsageError, match="per-frame, keyframe, keyframe-async and both"):
            parse_modes(text)


class Counting(NumberSegmenter):
    """Counts how often it is asked."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def can_segment(self, index: int) -> bool:
        return index != 3

    def segment(self, frame: Frame) -> Segmentation:
        self.asked.append(frame.index)
        return super().segment(frame)


def test_memo() -> None:
    """Recent frames are computed once, far ones again; answers never change."""
    real = Counting()
    memo = Memo(real)
    assert [memo.can_segment(i) for i in (2, 3)] == [True, False]
    frames = [Frame(i, i, np.zeros((4, 4, 3), np.uint8)) for i in range(20)]
    for frame in frames:
        for _ in range(3):
            assert (memo.segment(frame).labels == frame.index).all()
    assert real.asked == list(range(20))
    assert (memo.segment(frames[0]).labels == 0).all()
    assert real.asked == [*range(20), 0]
