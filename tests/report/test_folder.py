"""A report folder appears whole or not at all."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from made_up_run import example

from stsem.document.canonical import read_document
from stsem.document.difference import first_differences, repeatable_files
from stsem.errors import OutputError
from stsem.report import folder as folder_module
from stsem.report.folder import check_target, folder_name, write_folder
from stsem.report.inputs import ReportInputs


@pytest.fixture(scope="module")
def bare() -> ReportInputs:
    return replace(example(pictures=False), plots=False)


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_folder_holds_everything(written: Path) -> None:
    assert names(written) == [
        "frames.csv", "map.ply", "plots/calibration.png", "plots/classes.png", "plots/distance.png",
        "plots/latency.png", "plots/loss.png", "plots/overview.png", "plots/strip.png", "plots/timeline.png",
        "plots/uncertainty.png", "report.html", "report.json", "report.md", "trace.json", "trajectory.txt",
    ]  # fmt: skip
    document = read_document(written)
    assert document == example(pictures=False).document
    assert written.name == folder_name(document)
    text = (written / "report.md").read_text()
    assert all(f"(plots/{path.name})" in text for path in (written / "plots").iterdir())
    assert [path.name for path in written.parent.iterdir()] == [written.name]


def test_two_replays_give_the_same_bytes(written: Path, tmp_path: Path) -> None:
    """Pictures and views included: nothing in them tells when or where they were made."""
    cloud = tmp_path / "cloud.ply"
    cloud.write_bytes(b"ply\n")
    again = write_folder(replace(example(), point_cloud=cloud), tmp_path / "again")
    assert first_differences(repeatable_files(written), repeatable_files(again)) == ()
    assert len(repeatable_files(again)) == 14
    for name in names(written):
        assert (written / name).read_bytes() == (again / name).read_bytes()


def test_an_earlier_report_is_replaced(bare: ReportInputs, tmp_path: Path) -> None:
    folder = write_folder(bare, tmp_path / "out")
    (folder / "plots").mkdir()
    write_folder(bare, folder)
    assert names(folder) == ["frames.csv", "report.html", "report.json", "report.md", "trace.json", "trajectory.txt"]
    assert not (folder / "plots").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_foreign_files_are_left_alone(bare: ReportInputs, tmp_path: Path) -> None:
    out = tmp_path / "home"
    out.mkdir()
    (out / "thesis.tex").write_text("dear")
    with pytest.raises(OutputError, match="holds files that are no report"):
        write_folder(bare, out)
    assert names(out) == ["thesis.tex"]
    with pytest.raises(OutputError, match="is a file, a folder was expected"):
        check_target(out / "thesis.tex")


def test_unwritable_place_is_one_sentence(bare: ReportInputs, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match=r"cannot be written \(.+\); choose"):
        check_target(tmp_path / "file" / "out")
    with pytest.raises(OutputError, match=r"cannot be written"):
        write_folder(bare, tmp_path / "file" / "out")


def test_a_folder_that_cannot_be_listed_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Like one without permission to read it, which root would be shown all the same."""

    def refuse(_: Path) -> Iterator[Path]:
        raise PermissionError(13, "Permission denied")

    (tmp_path / "out").mkdir()
    monkeypatch.setattr(Path, "iterdir", refuse)
    with pytest.raises(OutputError, match=r"cannot be read \(Permission denied\); choose another place"):
        check_target(tmp_path / "out")


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError("disk full")])
def test_an_interrupted_report_leaves_nothing(
    bare: ReportInputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException | type[BaseException]
) -> None:
    """Ctrl-C in the middle of writing: the earlier report stays, no half-written one appears."""
    folder = write_folder(bare, tmp_path / "out")
    before = {name: (folder / name).read_bytes() for name in names(folder)}

    def interrupt(*_: object) -> str:
        raise error

    monkeypatch.setattr(folder_module, "markdown", interrupt)
    with pytest.raises((KeyboardInterrupt, OutputError)):
        write_folder(bare, folder)
    with pytest.raises((KeyboardInterrupt, OutputError)):
        write_folder(bare, tmp_path / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert {name: (folder / name).read_bytes() for name in names(folder)} == before


def test_check_leaves_no_trace(tmp_path: Path) -> None:
    check_target(tmp_path / "a" / "out")
    assert names(tmp_path) == []
