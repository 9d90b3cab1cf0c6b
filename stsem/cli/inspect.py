"""`stsem inspect`: what is in a log, what would be used, what looks wrong, and what to do about it."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stsem.cli.launch import verb

if TYPE_CHECKING:
    from stsem.errors import StsemError
    from stsem.inference.network import Network
    from stsem.log.log import ScannedLog

HELP = """Say what is in a log, what would be used as what, what looks wrong, and what to do about it.

    stsem inspect log.mcap
    stsem inspect log.mcap --topic color=/front/image --json
    stsem inspect log.mcap --model my-network.onnx

Findings do not change the exit code: 0, 3 when the log is damaged, 1 when there is no clear choice, 5 when no image can be decoded.
"""  # noqa: E501  typer breaks the lines of a paragraph itself


@verb
def inspect(
    log: Annotated[
        list[str], typer.Argument(metavar="LOG...", help="MCAP file or address, or the files of one recording.")
    ],
    topic: Annotated[
        list[str] | None,
        typer.Option("--topic", metavar="ROLE=TOPIC", help="Channel for color, depth, pose or labels."),
    ] = None,
    classes: Annotated[Path | None, typer.Option("--classes", help="Class table of the truth.")] = None,
    depth_registered: Annotated[
        str, typer.Option("--depth-registered", metavar="yes|no|auto", help="Are depth's pixels those of color?")
    ] = "auto",
    model: Annotated[
        str | None, typer.Option("--model", metavar="NAME|ONNX", help="Also say what this network would be given.")
    ] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> int:
    """Read the log once, and a sample of its frames."""
    from stsem.cli.console import progress
    from stsem.cli.foreign import pointing_to_convert
    from stsem.cli.recordings import check_once
    from stsem.cli.tables import inspection_text, network_line, terminal_width
    from stsem.document.canonical import canonical
    from stsem.errors import EXIT_FINE, EXIT_LOSSY, ClassTableError, LogError
    from stsem.log.describe import log_name
    from stsem.log.doctor.inspection import inspect_log
    from stsem.log.log import scan_log
    from stsem.replay.settings import parse_topics

    check_once(log)
    network = None if model is None else _network(model)
    topics = parse_topics(topic or [])
    with progress(f"Reading {log_name(log)}") as step, pointing_to_convert(log):
        scanned = scan_log(log, step)
    try:
        opened = scanned.open(topics=topics, classes_file=classes, depth_registered=depth_registered)
    except (LogError, ClassTableError) as err:
        _print_unopened(scanned, err, as_json=json_)
        raise
    with opened:
        found = inspect_log(opened)
    if json_:
        given = {} if network is None else {"network": {"name": network.name, "inputs": network.sidecar.inputs}}
        print(canonical({**found.as_dict(), **given}).decode(), end="")
    else:
        command = _command(log, topic or [], classes, depth_registered, model)
        said = None if network is None else network_line(network.name, network.sidecar.inputs, found)
        print(inspection_text(found, command, terminal_width(), said), end="")
    return EXIT_LOSSY if opened.info.damage.lossy else EXIT_FINE


def _network(model: str) -> "Network":
    from stsem.inference.network import load_network  # and with it ONNX Runtime, which nothing else here needs

    return load_network(model)


def _print_unopened(scanned: "ScannedLog", error: "StsemError", *, as_json: bool) -> None:
    """What is in the log, so that one sees what can be chosen; the sentence itself goes to stderr."""
    from dataclasses import asdict

    from stsem.cli.tables import terminal_width, unopened_text
    from stsem.document.canonical import canonical

    if not as_json:
        print(unopened_text(scanned.channels, scanned.damage, error, terminal_width()), end="")
        return
    known = {
        "channels": [asdict(channel) for channel in scanned.channels],
        "damage": scanned.damage.as_dict(),
        "error": str(error),
    }
    print(canonical(known).decode(), end="")


def _command(
    log: Sequence[str], topics: Sequence[str], classes: Path | None, depth_registered: str, model: str | None
) -> str:
    """The replay of what was inspected, as typed in a shell."""
    from stsem.log.container.source import without_secrets

    words = ["stsem-replay", *map(without_secrets, log)]
    words += [word for topic in topics for word in ("--topic", topic)]
    words += ["--classes", str(classes)] if classes else []
    words += ["--depth-registered", depth_registered] if depth_registered != "auto" else []
    words += ["--model", model] if model else []
    return shlex.join(words)
