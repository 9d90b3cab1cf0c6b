"""Names aside: this process's own, and what dead processes left behind for the same target is gone."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from stsem.aside import aside, write_aside


def dead_process() -> int:
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        process.wait()
    return process.pid


def test_what_dead_processes_left_is_removed(tmp_path: Path) -> None:
    """Files and folders of exactly this form; not those of a living process, nor what only looks alike."""
    dead, alive = dead_process(), os.getppid()
    gone = [f".log.mcap.{dead}", f".log.mcap.{dead}.db3", f".log.mcap.{dead}.db3-wal"]
    kept = [
        f".log.mcap.{alive}", f".other.mcap.{dead}", f"log.mcap.{dead}", f".log.mcap.{dead}.old", ".log.mcap.",
        ".log.mcap.0",
        f".log.mcap.{dead}x", f".logxmcap.{dead}",
    ]  # fmt: skip
    for name in gone + kept:
        (tmp_path / name).write_bytes(b"")
    (tmp_path / f".report.{dead}").mkdir()
    (tmp_path / f".report.{dead}" / "report.json").write_bytes(b"")
    assert aside(tmp_path / "log.mcap") == tmp_path / f".log.mcap.{os.getpid()}"
    assert aside(tmp_path / "report", ".x") == tmp_path / f".report.{os.getpid()}.x"
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(kept)


def test_a_link_is_removed_and_not_what_it_leads_to(tmp_path: Path) -> None:
    """Somebody may have put it there."""
    (tmp_path / "dear").mkdir()
    (tmp_path / "dear/file").write_bytes(b"")
    (tmp_path / f".log.{dead_process()}").symlink_to(tmp_path / "dear")
    aside(tmp_path / "log")
    assert [path.name for path in tmp_path.iterdir()] == ["dear"]
    assert (tmp_path / "dear/file").exists()


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    """Nothing to remove."""
    assert aside(tmp_path / "none/log").parent == tmp_path / "none"


def test_a_file_that_cannot_be_written_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole or not at all: a full disk costs neither the file that was there nor leaves a piece of the new one."""
    path = tmp_path / "network.onnx"
    write_aside(path, b"old")

    def full(self: Path, data: bytes) -> int:
        with self.open("wb") as file:
            file.write(data[:1])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space"):
        write_aside(path, b"new")
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [("network.onnx", b"old")]
