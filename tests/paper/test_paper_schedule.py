"""Cells as processes: order, failure, a kill at any moment, and the time that is left."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bench.paper.plan import Cell, find_cell
from bench.paper.schedule import Board, run_cells
from stsem.errors import TrainingError

ROOT = Path(__file__).resolve().parents[2]
CELLS = [find_cell(key) for key in ("spatial-first/0", "spatial-first/1", "temporal-first/0", "spatial/0", "sum/0")]
CHILD = """
import sys, time
out, key = sys.argv[1:]
with open(out + "/log", "a") as log: log.write(key + " begins\\n")
print("1/2 loss 0.5", flush=True)
time.sleep(0.15)
open(out + "/" + key.replace("/", "-") + ".json", "w").write("{}")
with open(out + "/log", "a") as log: log.write(key + " ends\\n")
"""
PARENT = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
from tests.paper.test_paper_schedule import run_missing
from pathlib import Path
run_missing(Path(sys.argv[1]))
"""


def run_missing(out: Path, jobs: int = 1) -> None:
    """As `python -m bench.paper` does it, with children that write empty results."""
    missing = [cell for cell in CELLS if not (out / f"{cell.file}.json").exists()]
    board = Board(dict.fromkeys(missing, 1.0), lambda _: None)
    run_cells(missing, lambda cell: ["-c", CHILD, str(out), cell.key], jobs, board)


@pytest.mark.parametrize("jobs", [1, 2, 4])
def test_nothing_begins_before_what_it_starts_from_ends(tmp_path: Path, jobs: int) -> None:
    run_missing(tmp_path, jobs)
    log = (tmp_path / "log").read_text().splitlines()
    assert sorted(log) == sorted(f"{cell.key} {what}" for cell in CELLS for what in ("begins", "ends"))
    for cell in CELLS:
        for start in cell.starts.values():
            assert log.index(f"{start.key} ends") < log.index(f"{cell.key} begins")
    at_once = most = 0
    for line in log:
        at_once += 1 if line.endswith("begins") else -1
        most = max(most, at_once)
    assert most <= jobs


def test_killed_between_cells_it_goes_on(tmp_path: Path) -> None:
    """SIGKILL after two results: what is done is not done again, the rest is."""
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(tmp_path)], start_new_session=True, cwd=ROOT)
    for _ in range(600):
        if len(list(tmp_path.glob("*.json"))) >= 2 or parent.poll() is not None:
            break
        time.sleep(0.05)
    os.killpg(parent.pid, signal.SIGKILL)
    parent.wait()
    done = {path.stem for path in tmp_path.glob("*.json")}
    assert 2 <= len(done) < len(CELLS)
    (tmp_path / "log").unlink()
    run_missing(tmp_path)
    again = {line.split()[0].replace("/", "-") for line in (tmp_path / "log").read_text().splitlines()}
    assert again == {cell.file for cell in CELLS} - done


def test_a_cell_that_fails_is_named_with_its_last_words(tmp_path: Path) -> None:
    """What does not start from it is done all the same."""

    def command(cell: Cell) -> list[str]:
        if cell.key == "temporal-first/0":
            return ["-c", "print('no room'); raise SystemExit(1)"]
        return ["-c", CHILD, str(tmp_path), cell.key]

    with pytest.raises(TrainingError, match=r"temporal-first/0 failed \(no room\)"):
        run_cells(CELLS, command, 2, Board(dict.fromkeys(CELLS, 1.0), lambda _: None))
    assert {path.stem for path in tmp_path.glob("*.json")} == {"spatial-first-0", "spatial-first-1", "spatial-0"}


def test_time_left_counts_the_work_and_not_the_cells() -> None:
    """A third of the work in 60 s leaves 120 s, though one of two cells is finished."""
    said: list[str] = []
    clock = [0.0]
    short, long = CELLS[:2]
    board = Board({short: 100.0, long: 200.0}, said.append, lambda: clock[0])
    board.at(short, 0.0, "begun")
    clock[0] = 60.0
    board.at(short, 1.0, "done")
    assert said[-1] == "spatial-first/0: done; 1 of 2 cells, 0 h 02 min left"


def test_what_a_stopped_run_did_is_no_speed_of_this_one() -> None:
    """A cell that goes on at half is half done at no time at all; its second half took a minute."""
    said: list[str] = []
    clock = [0.0]
    one, two = CELLS[:2]
    board = Board({one: 100.0, two: 100.0}, said.append, lambda: clock[0])
    board.at(one, 0.5, "goes on")
    clock[0] = 60.0
    board.at(one, 1.0, "done")
    assert said[-1].endswith("0 h 02 min left")
