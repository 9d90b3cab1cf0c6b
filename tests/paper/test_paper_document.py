"""The tables say what the results say, in the document too."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.paper.document import COMMITTED, DOCUMENT, PARTS, filled, publish, write_tables
from bench.paper.results import collect, load
from stsem.errors import UsageError

CLASSES = ["wall", "floor", "lamp"]


def _result(network: str, seed: int, right: int, dose: str = "right", called_floor: int = 90) -> dict[str, Any]:
    """Each class has 100 pixels; `right` of them are right, the rest are the next class."""
    matrix = np.zeros((3, 4), int)
    for k in range(3):
        matrix[k, k], matrix[k, (k + 1) % 3] = right, 100 - right
    return {
        "network": network, "dose": dose, "seed": seed, "classes": CLASSES, "matrix": matrix.tolist(),
        "architecture": "a", "starts": {}, "recipe": {"iterations": 7}, "weights_sha256": f"{network}{dose}{seed}" * 9,
        "data_sha256": {"train": "aa"}, "pairs": {"train": 3}, "problem_image": "00000_00",
        "host": {"machine": "m", "torch": "t"},
        "neighbour": {"floor_pixels": 100, "called_floor": called_floor, "called_lamp": 100 - called_floor},
    }  # fmt: skip


def test_the_papers_figures_stand_as_it_prints_them() -> None:
    """Zeros at the end included: 96.30 and 70.0."""
    assert "| feature map concatenation | - | - | 89.21 | 96.30 |" in PARTS["table1"](collect(ALL))
    whole = PARTS["table2"](collect([_result("spatial-r50", 0, 80), _result("sum-r50", 0, 80)]))
    assert [line.split("|")[-2].strip() for line in whole.splitlines()[2:]] == ["70.0", "71.1"]


def _iou(right: int) -> float:
    return 100 * right / (200 - right)


ALL = [
    *(_result("spatial", seed, 80 + seed) for seed in range(3)),
    *(_result("sum", seed, 90 + seed) for seed in range(3)),
    *(_result("max", seed, 80 + (seed * 7) % 11) for seed in range(3)),
    *(_result("spatial", seed, 60 + seed, "one", 20) for seed in range(3)),
    *(_result("sum", seed, 88 + seed, "one") for seed in range(3)),
]


def test_table1_by_hand() -> None:
    """Mean, deviation and both answers of the rule."""
    text = PARTS["table1"](collect(ALL))
    ious = np.array([_iou(90 + seed) for seed in range(3)])
    assert f"| prediction SUM | {ious.mean():.2f} ± {ious.std(ddof=1):.2f} | 91.00 ± 1.00 | 90.68 | 96.74 | 3 |" in text
    row = next(line for line in text.splitlines() if "prediction SUM better than spatial" in line)
    assert row.endswith("| yes |")
    row = next(line for line in text.splitlines() if "prediction MAX better than spatial" in line)
    assert row.endswith("| not beyond the spread |")


def test_table3_by_hand() -> None:
    """The spatial stream loses 20 points of accuracy to one image here and calls the neighbour lamp."""
    text = PARTS["table3"](collect(ALL))
    lost = [[_iou(a + seed) - _iou(b + seed) for seed in range(3)] for a, b in ((80, 60), (90, 88))]
    expected = np.mean(lost[0]) - np.mean(lost[1])
    row = next(line for line in text.splitlines() if "one image wrong: fused loses less" in line)
    assert f"| {expected:+.2f} |" in row
    assert row.endswith("| yes |")
    assert "| spatial stream, trained on | 90.0 / 10.0 | 20.0 / 80.0 | - |" in text


def test_table2_has_one_seed_and_every_class() -> None:
    text = PARTS["table2"](collect(ALL))
    assert f"| spatio-temporal (ResNet-18) | {' | '.join(3 * [f'{_iou(90):.1f}'])} | **{_iou(90):.1f}** | - |" in text


def test_parts_between_markers_are_replaced_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "offices").mkdir()
    for k, result in enumerate(ALL):
        (tmp_path / "offices" / f"{k}.json").write_text(json.dumps(result))
    text = "before\n<!-- offices table2 -->\nold\n<!-- end -->\nbetween\n<!-- camvid table1 -->\n<!-- end -->\nafter\n"
    once = filled(text, tmp_path)
    assert filled(once, tmp_path) == once
    assert "old" not in once
    assert once.startswith("before\n<!-- offices table2 -->\n| network | wall | floor | lamp |")
    assert once.endswith("between\n<!-- camvid table1 -->\nNothing has been measured yet.\n<!-- end -->\nafter\n")
    with pytest.raises(UsageError, match="table4"):
        filled("<!-- offices table4 -->\n\n<!-- end -->", tmp_path)


def test_the_document_says_what_the_committed_results_say() -> None:
    """Every part of docs/paper-tables.md, made anew, is what stands there."""
    text = DOCUMENT.read_text(encoding="utf-8")
    assert all(f"<!-- offices {part} -->" in text for part in PARTS)
    assert filled(text, COMMITTED) == text


@pytest.mark.parametrize("path", sorted(COMMITTED.rglob("*.json")), ids=lambda path: path.stem)
def test_committed_results_are_whole(path: Path) -> None:
    """Names fit, and every test pixel was judged: rows of the matrix sum alike for all cells of a data set."""
    result = json.loads(path.read_text(encoding="utf-8"))
    assert result["cell"].replace("/", "-") == path.stem
    first = json.loads(min(path.parent.glob("*.json")).read_text(encoding="utf-8"))
    assert np.sum(result["matrix"], 1).tolist() == np.sum(first["matrix"], 1).tolist()
    assert result["data_sha256"] == first["data_sha256"]


def test_results_into_the_tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--publish` copies results and fills the document, which then fits them."""
    folder = tmp_path / "out" / "results" / "offices"
    folder.mkdir(parents=True)
    for k, result in enumerate(ALL):
        (folder / f"{k}.json").write_text(json.dumps(result))
    document = tmp_path / "tables.md"
    document.write_text("<!-- offices cells -->\n<!-- end -->\n")
    monkeypatch.setattr("bench.paper.document.DOCUMENT", document)
    monkeypatch.setattr("bench.paper.document.COMMITTED", tmp_path / "kept")
    assert publish(tmp_path / "out", "offices") == len(ALL)
    assert load(tmp_path / "kept" / "offices") == load(folder)
    assert "| `sum-one` | a | 7 |" in document.read_text()
    with pytest.raises(UsageError, match="no result of 'camvid'"):
        publish(tmp_path / "out", "camvid")
    assert [path.name for path in write_tables(tmp_path / "out", "offices", ["table1"])] == ["offices-table1.md"]


def test_results_of_several_data_sets_are_not_mixed() -> None:
    with pytest.raises(ValueError, match="one data set"):
        collect([ALL[0], ALL[1] | {"data_sha256": {"train": "bb"}}])
