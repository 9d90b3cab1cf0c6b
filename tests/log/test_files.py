"""Random access: a bounded cache, each chunk once when going in order, and a file that changes is noticed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made_up_logs import BASE_NS, ROS, Recorder
from mcap.writer import CompressionType

from stsem.errors import LogError
from stsem.log.container.files import find_files
from stsem.log.container.store import Store
from stsem.log.scan import scan
from stsem.log.tracks import References

IMAGE = "sensor_msgs/msg/Image"
SIZE = 64 * 48 * 3


def images(recorder: Callable[..., Recorder], n: int, **options: object) -> Path:
    log = recorder(f"{n}.mcap", **options)
    for i in range(n):
        pixels = np.random.Generator(np.random.PCG64(i)).integers(0, 255, (48, 64, 3), np.uint8)
        log.ros("/cam", IMAGE, ROS.image(BASE_NS + i, pixels, "rgb8"), BASE_NS + i)
    return log.close()


def read_all(store: Store, rows: References) -> list[bytes]:
    return [bytes(store.payload(*map(int, row))) for row in zip(rows.place, rows.offset, rows.length, strict=True)]


@pytest.mark.parametrize("options", [{}, {"compression": CompressionType.LZ4}, {"use_chunking": False}])
def test_memory_is_bounded_and_each_chunk_is_opened_once(
    recorder: Callable[..., Recorder], options: dict[str, object]
) -> None:  # fmt: skip
    """40 chunks through a cache of 4: never more than that is held, and a second pass in order opens each once more."""
    result = scan(find_files([images(recorder, 40, chunk_size=1, **options)]))
    rows = result.tracks["/cam", "cdr", IMAGE].references()
    with Store(result.files, result.chunks, cache_bytes=4 * (SIZE + 200)) as store:
        for row in zip(rows.place, rows.offset, rows.length, strict=True):
            store.payload(*map(int, row))
            store.payload(*map(int, row))
            assert store.held_bytes <= 4 * (SIZE + 200)
        assert store.decompressed == (0 if options.get("use_chunking") is False else 40)


def test_a_chunk_larger_than_the_cache_is_still_read(recorder: Callable[..., Recorder]) -> None:
    result = scan(find_files([images(recorder, 3)]))
    rows = result.tracks["/cam", "cdr", IMAGE].references()
    with Store(result.files, result.chunks, cache_bytes=1) as store:
        assert len({data[-100:] for data in read_all(store, rows)}) == 3


def test_what_the_scan_opened_is_not_opened_again(recorder: Callable[..., Recorder]) -> None:
    result = scan(find_files([images(recorder, 5, chunk_size=1)]))
    rows = result.tracks["/cam", "cdr", IMAGE].references()
    with Store(result.files, result.chunks) as cold, Store(result.files, result.chunks, result.opened) as warm:
        assert read_all(warm, rows) == read_all(cold, rows)
        assert (warm.decompressed, cold.decompressed) == (0, 5)


def test_a_file_that_changed_is_noticed(recorder: Callable[..., Recorder]) -> None:
    path = images(recorder, 3, chunk_size=1)
    result = scan(find_files([path]))
    rows = result.tracks["/cam", "cdr", IMAGE].references()
    path.write_bytes(path.read_bytes()[:2000])
    with Store(result.files, result.chunks) as store, pytest.raises(LogError, match="changed while it was being read"):
        read_all(store, rows)


def test_nothing_is_read_after_closing(recorder: Callable[..., Recorder]) -> None:
    result = scan(find_files([images(recorder, 1)]))
    rows = result.tracks["/cam", "cdr", IMAGE].references()
    with Store(result.files, result.chunks) as store:
        read_all(store, rows)
    with pytest.raises(LogError, match="was closed"):
        read_all(store, rows)
