"""`stsem inspect`: what is in a log, what would be used, and what looks wrong."""

from pathlib import Path
from typing import Annotated

import typer

from stsem.cli.launch import verb

HELP = """Say what is in a log, what would be used as what, and what looks wrong.

    stsem inspect log.mcap
    stsem inspect log.mcap --json
"""


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
    json_: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> int:
    """Read the log once, and a sample of its frames."""
    from stsem.cli.console import progress
    from stsem.cli.tables import inspection_text
    from stsem.document.canonical import canonical
    from stsem.errors import EXIT_FINE, EXIT_LOSSY
    from stsem.log.describe import log_name
    from stsem.log.inspect import inspect_log
    from stsem.log.log import open_log
    from stsem.replay.settings import parse_topics

    with progress(f"Reading {log_name(log)}") as step:
        opened = open_log(log, topics=parse_topics(topic or []), classes_file=classes, progress=step)
    with opened:
        found = inspect_log(opened)
        print(canonical(found.as_dict()).decode() if json_ else inspection_text(found), end="")
        return EXIT_LOSSY if opened.info.damage.lossy else EXIT_FINE
