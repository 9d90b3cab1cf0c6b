"""Work ahead: in order, bounded, and gone when the consumer is."""

import threading
from collections.abc import Iterator

import pytest

from stsem.log.prefetch import Recent, prefetched


def workers() -> int:
    return sum(thread.name.startswith("stsem-prefetch") for thread in threading.enumerate())


def test_results_come_in_order_and_not_too_far_ahead() -> None:
    asked: list[int] = []

    def keys() -> Iterator[int]:
        for key in range(20):
            asked.append(key)
            yield key

    for position, value in enumerate(prefetched(lambda key: key * key, keys(), ahead=3)):
        assert value == position**2
        assert len(asked) <= position + 4
    assert workers() == 0


def test_an_exception_comes_where_its_result_would_have() -> None:
    def make(key: int) -> int:
        if key == 2:
            raise RuntimeError("two")
        return key

    results = prefetched(make, range(10))
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(RuntimeError, match="two"):
        next(results)
    assert workers() == 0


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_consumer_that_stops_leaves_no_thread(error: type[BaseException]) -> None:
    results = prefetched(lambda key: key, range(1000))

    def consume() -> None:
        for value in results:
            if value == 3:
                raise error

    with pytest.raises(error):
        consume()
    results.close()
    assert workers() == 0


def test_work_overlaps() -> None:
    """Two results that can only be made while the other is being made."""
    meeting = threading.Barrier(2, timeout=20)
    assert list(prefetched(lambda key: (meeting.wait(), key)[1], range(4))) == [0, 1, 2, 3]


def test_a_recent_value_is_made_once_for_all_threads() -> None:
    made: list[int] = []
    started, go = threading.Event(), threading.Event()

    def make(key: int) -> str:
        made.append(key)
        started.set()
        assert go.wait(20)
        return str(key)

    recent, got = Recent(make, 2), []
    threads = [threading.Thread(target=lambda: got.append(recent.get(7))) for _ in range(4)]
    for thread in threads:
        thread.start()
    assert started.wait(20)
    go.set()
    for thread in threads:
        thread.join(20)
    assert (made, got) == ([7], ["7"] * 4)
    assert [recent.get(key) for key in (7, 8, 7, 9, 7, 8)] == ["7", "8", "7", "9", "7", "8"]
    assert made == [7, 8, 9, 8]


def test_a_recent_error_is_kept() -> None:
    made: list[int] = []

    def make(key: int) -> int:
        made.append(key)
        raise ValueError("no")

    recent = Recent(make, 2)
    for _ in range(3):
        with pytest.raises(ValueError, match="no"):
            recent.get(1)
    assert made == [1]
