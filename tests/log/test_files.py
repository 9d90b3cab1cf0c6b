"""Random access: a bounded cache, each chunk once when going in order, and a file that changes is noticed."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_logs import BASE_NS, ROS, Recorder
from mcap.writer import CompressionType

from stsem.errors import LogError
from stsem.log.container.files import find_files, left_out, listed_files, missing_files
from stsem.log.container.store import Store
from stsem.log.log import open_log
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


def test_a_file_that_is_written_to_is_noticed(room_log: Path) -> None:
    """Between two passes, even when its size stays."""
    (file,) = find_files([room_log])
    os.utime(room_log, ns=(1, 1))
    with pytest.raises(LogError, match="changed while it was being read"):
        file.source.open()


def test_what_of_a_folder_is_read(tmp_path: Path) -> None:
    """Recordings of any capitals and links to them, each once; not what only looks alike."""
    for name in ("run_0.mcap", "run_10.MCAP", "run_9.mcap", "._run_0.mcap", "metadata.yaml", "run_11.mcap.active"):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "run_8.mcap").symlink_to(tmp_path / "run_9.mcap")
    (tmp_path / "below.mcap").mkdir()
    found = [file.source.name for file in find_files([tmp_path])]
    assert found == ["run_0.mcap", "run_9.mcap", "run_10.MCAP"]
    (sentence,) = left_out([tmp_path, "memory://x"])
    assert sentence.startswith("run_11.mcap.active was left unfinished")


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["a/x.mcap", "b/y.mcap", "c/z.txt"], "give one of the recordings in it: a, b."),
        (["run_0.mcap.active"], "run_0.mcap.active; give an unfinished recording by its own path"),
        (["run_0.mcap.zstd"], "unpack a packed one first"),
        (["x.txt"], "holds no .mcap file; give"),
    ],
)
def test_a_folder_without_a_recording_says_what_it_has(tmp_path: Path, names: list[str], words: str) -> None:
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    with pytest.raises(LogError) as caught:
        find_files([tmp_path])
    assert words in str(caught.value)


def test_links_to_nothing_and_names_that_cannot_be(tmp_path: Path) -> None:
    """A part that was not fetched is not left out in silence."""
    (tmp_path / "run_0.mcap").touch()
    (tmp_path / "run_1.mcap").symlink_to(tmp_path / "annex")
    for path in (tmp_path, tmp_path / "run_1.mcap"):
        with pytest.raises(LogError, match="is a link to nothing"):
            find_files([path])
    (tmp_path / "loop.mcap").symlink_to(tmp_path / "loop.mcap")
    for name in ("loop.mcap", "x" * 300, "a\0b", "run_0.mcap/x"):
        with pytest.raises(LogError):
            find_files([str(tmp_path / name)])


LISTS = {
    "block": "a:\n  relative_file_paths:\n    - run_0.mcap\n    - run_1.mcap\n  duration: 1\n",
    "quoted": "relative_file_paths:\r\n- 'run_0.mcap'\r\n- \"run_1.mcap\"\r\n",
    "flow": "relative_file_paths: [run_0.mcap,\n 'run_1.mcap']",
    "folders": "relative_file_paths:\n - run/run_0.mcap\n - run/run_1.mcap",
    "packed": "relative_file_paths:\n - run_0.mcap.zstd\n - run_1.mcap.zstd",
}


@pytest.mark.parametrize("text", LISTS.values(), ids=LISTS.keys())
def test_files_that_a_recorder_listed(tmp_path: Path, text: str) -> None:
    """What is not there is missing, unless none is, because all were renamed."""
    assert listed_files(text) == ("run_0.mcap", "run_1.mcap")
    (tmp_path / "metadata.yaml").write_bytes(text.encode())
    (tmp_path / "other.mcap").touch()
    assert missing_files([tmp_path]) == []
    (tmp_path / "run_1.mcap").touch()
    assert missing_files([tmp_path]) == ["run_0.mcap"]
    assert missing_files([tmp_path / "run_1.mcap"]) == []
    (tmp_path / "run_0.mcap").touch()
    assert missing_files([tmp_path]) == []


@settings(derandomize=True, max_examples=100, deadline=None)
@given(st.text("relative_file_paths:[]-'\" \n\rx/.", max_size=200))
def test_a_list_of_files_is_whatever_it_is(text: str) -> None:
    assert all("/" not in name and name for name in listed_files(f"relative_file_paths:{text}"))
    assert listed_files("relative_file_paths:\n" + "- \n" * 100_000) == ()


def test_a_log_with_a_file_missing_is_lossy(recorder: Callable[..., Recorder], tmp_path: Path) -> None:
    images(recorder, 3)
    (tmp_path / "metadata.yaml").write_text("relative_file_paths:\n- 3.mcap\n- 4.mcap\n")
    with open_log([tmp_path]) as log:
        assert str(log.info.damage) == "missing_file 1 (4.mcap)"
        assert log.info.damage.lossy


def test_a_part_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "run_0.mcap").touch()
    (file,) = find_files([tmp_path])

    def refuse(self: Path, mode: str) -> BinaryIO:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(LogError, match=r"run_0\.mcap cannot be read \(Permission denied\)"):
        file.source.open()


def test_an_empty_part_is_damage(recorder: Callable[..., Recorder], tmp_path: Path) -> None:
    """What a crashed recorder leaves behind: the other parts are read, and the log is lossy; alone it is no log."""
    images(recorder, 3)
    (tmp_path / "4.mcap").touch()
    (tmp_path / "2.mcap").touch()
    result = scan(find_files([tmp_path]))
    assert result.damage.counts == {"truncated": {"2.mcap": 1, "4.mcap": 1}}
    rows = result.tracks["/cam", "cdr", IMAGE].references()
    with Store(result.files, result.chunks) as store:
        assert len(read_all(store, rows)) == 3
    (tmp_path / "3.mcap").unlink()
    with pytest.raises(LogError, match="is empty"):
        scan(find_files([tmp_path]))
