"""Options as `--help` shows them: in panels, with their defaults in square brackets."""

import re
from typing import Any

import typer

_TAG = re.compile(r"\[(?=[a-z#/@])")
"""What rich would read as markup, and leave out."""


def option(*names: str, panel: str, help: str, metavar: str | None = None) -> Any:
    """An option in a panel of its verb's `--help`.

    Args:
        names: with their dashes.
        panel: heading.
        help: a sentence; a default in square brackets behind it is shown as it stands.
        metavar: what stands for the value; None for its type.
    """
    return typer.Option(*names, help=_TAG.sub(r"\\[", help), rich_help_panel=panel, metavar=metavar, show_default=False)
