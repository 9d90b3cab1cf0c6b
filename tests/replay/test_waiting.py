"""A backlog keeps a few images, and gets the others back as they were."""

import numpy as np
import pytest

from stsem.frame import Frame
from stsem.log.log import Loaded
from stsem.replay.waiting import WaitingRoom


def loaded(index: int) -> Loaded:
    return Loaded(index, Frame(index, index, np.full((2, 2, 3), index, np.uint8)), None, None)


def test_only_a_few_wait_with_their_pixels() -> None:
    """Of 30 frames eight are kept; the rest are loaded again, each once, when their turn comes."""
    asked: list[int] = []

    def again(index: int) -> Loaded:
        asked.append(index)
        return loaded(index)

    room = WaitingRoom(again)
    for index in range(30):
        room.put(loaded(index))
    frames = [room.pop(index).frame for index in range(30)]
    assert [frame.index for frame in frames if frame is not None] == list(range(30))
    assert asked == list(range(8, 30))


def test_without_a_way_back_everybody_is_kept() -> None:
    """And nobody can be taken twice."""
    room = WaitingRoom(None)
    for index in range(30):
        room.put(loaded(index))
    assert [room.pop(index).index for index in range(30)] == list(range(30))
    with pytest.raises(KeyError):
        room.pop(3)
