"""The list of cells: complete, in an order that works, and every one reachable by its key."""

from pathlib import Path

import pytest

from bench.paper.__main__ import main
from bench.paper.plan import NETWORKS, Cell, find_cell, with_starts
from bench.paper.tables import TABLE2, TABLES, cells_of
from stsem.errors import UsageError

CELLS = with_starts(cell for table in TABLES for cell in cells_of(table, 3))


def test_every_cell_comes_once_and_after_its_starts() -> None:
    """21 of Table 1, 24 more of Table 3, the rest of Table 2."""
    assert len(CELLS) == len(set(CELLS))
    for place, cell in enumerate(CELLS):
        assert set(cell.starts.values()) <= set(CELLS[:place])
    assert len(with_starts(cells_of("table1", 3))) == 21
    assert len(with_starts(cells_of("table3", 3))) == 36
    assert {cell.seed for cell in cells_of("table2", 3)} == {0}


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: cell.key)
def test_keys_lead_back(cell: Cell) -> None:
    assert find_cell(cell.key) == cell


@pytest.mark.parametrize("key", ["sum", "sum/x", "none/0", "sum-two/0", ""])
def test_a_cell_that_is_not_there_is_refused(key: str) -> None:
    with pytest.raises(UsageError, match="--list"):
        find_cell(key)


def test_doses_start_from_their_own_dose() -> None:
    """The fused network on wrong labels joins streams that learned the same wrong labels."""
    assert {start.key for start in find_cell("sum-tenth/2").starts.values()} == {
        "spatial-first-tenth/2", "temporal-first-tenth/2",
    }  # fmt: skip


def test_second_trainings_see_views_of_their_own() -> None:
    seeds = {first: find_cell(f"{first}/1").training_seed for first in ("spatial-first", "spatial", "sum")}
    assert seeds["spatial"] == seeds["sum"] != seeds["spatial-first"] == 1


@pytest.mark.torch
def test_every_network_is_of_the_zoo_and_every_one_of_the_zoo_has_a_row() -> None:
    """But the largest ResNet, stems of others, and fusions, which Table 1 has."""
    zoo = pytest.importorskip("stsem.models.zoo", reason="the extra 'train' is not installed")
    for network in NETWORKS.values():
        zoo.find(network.architecture)
    shown = {NETWORKS[row.network].architecture.removesuffix("-w2") for row in TABLE2}
    left = {name for name in zoo.ZOO if not name.startswith("pspnet")}
    assert left <= shown
    assert {f"pspnet-r{depth}-{kind}" for depth in (18, 50) for kind in ("spatial", "sum")} <= shown


def test_rgbd_networks_need_depth() -> None:
    """Two lines of Table 2 are left out where there is none."""
    with_depth, without = (set(cells_of("table2", 1, depth=depth)) for depth in (True, False))
    assert {cell.network for cell in with_depth - without} == {"fusenet", "adapnet-pp-ssma"}


@pytest.mark.parametrize(
    ("arguments", "keys"),
    [
        (["--cell", "sum/1"], ["spatial-first/1", "temporal-first/1", "sum/1"]),
        (["table3", "--seeds", "1"], [cell.key for cell in with_starts(cells_of("table3", 1))]),
    ],
)
def test_the_command_lists_its_cells(arguments: list[str], keys: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*arguments, "--list"]) == 0
    assert capsys.readouterr().out.split() == keys


@pytest.mark.parametrize(
    ("arguments", "words"), [([], "name a table"), (["table4"], "no table 'table4'"), (["--seeds", "x"], "seeds")]
)
def test_wrong_usage(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert words in capsys.readouterr().err


@pytest.mark.torch
def test_bad_input_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A data set that is not at hand, and one whose log is not there."""
    pytest.importorskip("torch", reason="the extra 'train' is not installed")
    assert main(["table1", "--data", "kitti"]) == 1
    assert main(["table1", "--data", f"camvid={tmp_path / 'no.mcap'}", "--out", str(tmp_path)]) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert "no data set 'kitti'" in first
    assert "no.mcap" in second
