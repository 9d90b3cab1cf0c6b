"""The two commands: `stsem VERB ...`, and `stsem-replay` as a short name for `stsem replay`."""

from typing import Annotated

import typer

from stsem import __version__
from stsem.cli import adopt, cache, convert, costs, export, gate, inspect, quantize, replay, synth, train
from stsem.cli.launch import launch
from stsem.errors import EXIT_USAGE

_SETTINGS = {"help_option_names": ["-h", "--help"]}

app = typer.Typer(
    name="stsem",
    help="How accurate, how late and how fast a semantic scene-mapping pipeline is on your recorded logs.",
    pretty_exceptions_enable=False,
    context_settings=_SETTINGS,
)
app.command("replay", help=replay.HELP)(replay.replay)
app.command("inspect", help=inspect.HELP)(inspect.inspect)
app.command("gate", help=gate.HELP)(gate.gate)
app.command("convert", help=convert.HELP)(convert.convert)
app.command("export", help=export.HELP)(export.export)
app.command("adopt", help=adopt.HELP)(adopt.adopt)
app.command("quantize", help=quantize.HELP)(quantize.quantize)
app.command("synth", help=synth.HELP)(synth.synth)
app.command("train", help=train.HELP)(train.train)
app.add_typer(costs.app, name="costs")
app.add_typer(cache.app, name="cache")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"stsem {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _stsem(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show it.")] = False,
) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit(EXIT_USAGE)


def stsem() -> None:
    """Entry point of `stsem`."""
    launch(app)


def stsem_replay() -> None:
    """Entry point of `stsem-replay`."""
    single = typer.Typer(pretty_exceptions_enable=False, context_settings=_SETTINGS)
    single.command("stsem-replay", help=replay.HELP)(replay.replay)
    launch(single)
