"""Work done ahead of its consumer, in order, on a few threads; and values made once for several threads."""

import threading
from collections import OrderedDict, deque
from collections.abc import Callable, Generator, Hashable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
T = TypeVar("T")

WORKERS = 2
AHEAD = 4


def prefetched(
    make: Callable[[K], T], keys: Iterable[K], workers: int = WORKERS, ahead: int = AHEAD
) -> Generator[T, None, None]:
    """`make(key)` for each of `keys`, in order, with at most `ahead` results waiting.

    An exception of `make` is raised where its result would have come. However the iteration ends (exhausted, closed,
    an exception in its consumer, Ctrl-C) no thread is left behind.
    """
    pool = ThreadPoolExecutor(workers, "stsem-prefetch")
    pending: deque[Future[T]] = deque()
    try:
        for key in keys:
            pending.append(pool.submit(make, key))
            if len(pending) > ahead:
                yield pending.popleft().result()
        while pending:
            yield pending.popleft().result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


class Recent(Generic[K, T]):
    """The last `size` values, each made once however many threads ask for it at the same time; errors are kept too."""

    def __init__(self, make: Callable[[K], T], size: int) -> None:
        self._make, self._size = make, size
        self._values: OrderedDict[K, Future[T]] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: K) -> T:
        """The value of `key`, or the exception that making it raised."""
        with self._lock:
            future, mine = self._values.get(key), False
            if future is None:
                future, mine = Future(), True
                self._values[key] = future
                while len(self._values) > self._size:
                    self._values.popitem(last=False)
            self._values.move_to_end(key)
        if mine:
            try:
                future.set_result(self._make(key))
            except BaseException as err:  # noqa: BLE001  it is raised again, here and to everyone who waits
                future.set_exception(err)
        return future.result()
