"""`stsem convert`: a data set or a foreign recording becomes an MCAP log."""

import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stsem.cli.launch import verb
from stsem.plain import MAX_SENTENCE, plain

if TYPE_CHECKING:
    from stsem.convert.formats import Format
    from stsem.convert.recording import Summary

HELP = """Convert a data set or a ROS bag to a log. The format is found by looking.

    stsem convert drive.bag
    stsem convert rgbd_dataset_freiburg1_desk desk.mcap
    stsem convert folder-of-images --rate 15 --classes classes.json

Formats: rosbag1, rosbag2, tum, icl-nuim, nice-slam, scannet, camvid, cityscapes, kitti-step, images (docs/convert.md).
"""


@verb
def convert(
    source: Annotated[Path, typer.Argument(metavar="SOURCE", help="Folder or file.")],
    out: Annotated[Path | None, typer.Argument(metavar="OUT.mcap", help="Default: here, named like SOURCE.")] = None,
    format_: Annotated[str | None, typer.Option("--from", metavar="FORMAT", help="Do not look, it is this.")] = None,
    rate: Annotated[float | None, typer.Option("--rate", metavar="HZ", help="Of images without stamps.")] = None,
    depth_scale: Annotated[
        float | None, typer.Option("--depth-scale", metavar="S", help="Units of 16-bit depth per metre.")
    ] = None,
    classes: Annotated[Path | None, typer.Option("--classes", help="Class table of the labels.")] = None,
    sequence: Annotated[str | None, typer.Option("--sequence", metavar="NAME", help="Of several in SOURCE.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace OUT if it is there.")] = False,
) -> int:
    """Only files inside SOURCE are read, only OUT is written."""
    from stsem.cli.console import note, progress
    from stsem.convert.detect import find_format
    from stsem.convert.recording import Options
    from stsem.errors import EXIT_FINE, EXIT_LOSSY

    _check_positive(rate, "--rate")
    _check_positive(depth_scale, "--depth-scale")
    found = find_format(source, format_)
    _check_sequence(sequence, found)
    target = out or _default_target(source)
    _check_free(source, target, force)
    with progress(f"Converting {source.name}") as step:
        summary = found.convert(source, target, Options(rate, depth_scale, classes, sequence), step)
    for text in summary.notes:
        note(text)
    for what, count in summary.losses.items():
        note(f"Left out: {count} {what}.")
    _print(target, summary)
    return EXIT_LOSSY if summary.losses else EXIT_FINE


def _default_target(source: Path) -> Path:
    """Here, named like the folder, or like the file without its suffixes."""
    name = source.resolve().name
    stem = name if source.is_dir() else name.partition(".")[0]
    return Path(f"{stem or 'log'}.mcap")


def _check_positive(value: float | None, flag: str) -> None:
    from stsem.errors import UsageError

    if value is not None and not (math.isfinite(value) and value > 0):
        raise UsageError(f"{flag} is {value:g}, but it must be above 0.")


def _check_sequence(sequence: str | None, found: "Format") -> None:
    from stsem.errors import UsageError

    if sequence is not None and not found.several:
        raise UsageError(
            f"--sequence is {sequence!r}, but a source of this format ({found.summary}) holds one recording; "
            "leave it out."
        )


def _check_free(source: Path, target: Path, force: bool) -> None:
    from stsem.errors import OutputError

    if not target.exists():
        return
    if target.resolve() == source.resolve():
        raise OutputError(f"{target} is what is to be converted; give another name for the log.")
    if not force:
        raise OutputError(f"{target} is there already; give another name, or --force to replace it.")


def _print(target: Path, summary: "Summary") -> None:
    """What was written, and what to do with it."""
    from tabulate import tabulate

    rows = [[plain(topic), f"{count}"] for topic, count in summary.messages.items()]
    print(tabulate(rows, ["topic", "messages"], disable_numparse=True, colalign=("left", "right")))
    print(f"Log: {plain(str(target), MAX_SENTENCE)} ({target.stat().st_size / 1e6:.1f} MB)")
    print(f"stsem-replay {plain(shlex.quote(str(target)), MAX_SENTENCE)}")
