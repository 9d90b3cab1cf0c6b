"""The folder of a run: written aside, renamed when complete."""

import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from stsem.aside import aside as place_aside
from stsem.document.canonical import to_bytes
from stsem.document.schema import Document
from stsem.errors import OutputError
from stsem.report.contents import outline
from stsem.report.frames_csv import frames_csv
from stsem.report.html import html
from stsem.report.inputs import ReportInputs
from stsem.report.markdown import markdown
from stsem.report.plots.gallery import draw_all


def folder_name(document: Document) -> str:
    """`<config hash>-<digest prefix>`: the same run lands in the same folder."""
    return f"{document.config_hash[:8]}-{document.digest[:8]}"


def write_folder(inputs: ReportInputs, folder: Path) -> Path:
    """Write every file of the report to `folder`, which appears at once when all are complete.

    A folder that holds an earlier report is replaced; any other folder that is not empty is left alone.

    Returns:
        `folder`.

    Raises:
        OutputError: the folder cannot be written, or holds something that is no report.
    """
    check_target(folder)
    with _aside(folder) as aside:
        for name, make in _FILES.items():
            if (pieces := make(inputs)) is not None:
                with (aside / name).open("wb") as file:
                    file.writelines(pieces)
        if inputs.trace is not None:
            inputs.trace(aside / "trace.json")
        for name, made in (("map.ply", inputs.point_cloud), ("annotated.mcap", inputs.annotated)):
            if made is not None:
                shutil.copyfile(made, aside / name)
        _write_views(inputs, aside)
    return folder


_FILES: dict[str, Callable[[ReportInputs], Iterable[bytes] | None]] = {
    "report.json": lambda inputs: [to_bytes(inputs.document)],
    "frames.csv": frames_csv,
    "trajectory.txt": lambda inputs: inputs.trajectory,
}


def _write_views(inputs: ReportInputs, aside: Path) -> None:
    pictures = draw_all(inputs)
    report = outline(inputs.document, frozenset(pictures), inputs.strip_pass)
    (aside / "report.md").write_text(markdown(report), encoding="utf-8")
    (aside / "report.html").write_text(html(report, pictures), encoding="utf-8")
    if pictures:
        (aside / "plots").mkdir()
    for name, picture in pictures.items():
        (aside / "plots" / f"{name}.png").write_bytes(picture.png)


def check_target(folder: Path) -> None:
    """Whether a report may be written to `folder`: worth asking before a long run.

    Raises:
        OutputError: it is a file, holds something that is no report, or its parent cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"The output {folder} is a file, a folder was expected; choose another place with --out.")
    if folder.is_dir() and _holds_something_else(folder):
        raise OutputError(f"The folder {folder} holds files that are no report; choose another place with --out.")
    nearest = next(place for place in folder.absolute().parents if place.exists())
    with _aside(nearest / folder.name) as aside:  # tried where a folder is already: nothing is left if the run fails
        aside.rmdir()


def _holds_something_else(folder: Path) -> bool:
    try:
        return any(folder.iterdir()) and not (folder / "report.json").is_file()
    except OSError as err:
        raise OutputError(
            f"The folder {folder} cannot be read ({err.strerror or err}); choose another place with --out."
        ) from err


@contextmanager
def _aside(folder: Path) -> Iterator[Path]:
    """A new folder beside `folder` that takes its place at the end, or vanishes when anything goes wrong."""
    target = folder.absolute()
    aside = place_aside(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(aside, ignore_errors=True)
        aside.mkdir()
        yield aside
        if aside.is_dir():
            _swap(aside, target)
    except OSError as err:
        raise OutputError(
            f"The report folder {folder} cannot be written ({err.strerror or err}); choose --out."
        ) from err
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _swap(aside: Path, target: Path) -> None:
    old = aside.with_name(f"{aside.name}.old")
    if target.exists():
        target.replace(old)
    try:
        aside.replace(target)
    finally:
        if not target.exists():
            old.replace(target)
        shutil.rmtree(old, ignore_errors=True)
