"""`stsem synth`: a rendered log with exact truth."""

from pathlib import Path
from typing import Annotated

import typer

from stsem.cli.launch import verb

HELP = """Render a walk through an office floor to a log: colour, depth, pose and labels of 13 classes.

    stsem synth office.mcap --seed 7 --layout 12 --seconds 15
    stsem synth big.mcap --size 960x540 --rate 30 --seconds 60 --speed steady --noise none
"""


@verb
def synth(
    out: Annotated[Path, typer.Argument(metavar="OUT.mcap", help="The log to write.")],
    seed: Annotated[int, typer.Option("--seed", help="Of path, noise and everything that moves.")] = 0,
    layout: Annotated[int, typer.Option("--layout", help="Of rooms, furniture, materials and lights.")] = 0,
    size: Annotated[str, typer.Option("--size", metavar="WxH", help="Of the images.")] = "480x270",
    rate: Annotated[float, typer.Option("--rate", metavar="HZ", help="Frames per second.")] = 10.0,
    seconds: Annotated[float, typer.Option("--seconds", metavar="S", help="Length.")] = 15.0,
    noise: Annotated[str, typer.Option("--noise", help="Depth noise: kinect or none.")] = "kinect",
    speed: Annotated[
        str, typer.Option("--speed", help="steady (0.5 m/s), searching (looks about) or varying (pauses, fast turns).")
    ] = "steady",
    label_every: Annotated[int, typer.Option("--label-every", metavar="N", help="Truth for every Nth frame.")] = 1,
) -> int:
    """Same options, same bytes."""
    from stsem.cli.console import progress
    from stsem.errors import UsageError
    from stsem.synth.generate import render_log

    width, times, height = size.partition("x")
    if not (times and size.isascii() and width.isdigit() and height.isdigit()):
        raise UsageError(f"--size takes WIDTHxHEIGHT, such as 480x270, but {size!r} came.")
    with progress(f"Rendering {out.name}") as step:
        render_log(
            out, seed=seed, layout=layout, width=int(width), height=int(height), rate_hz=rate, length_s=seconds,
            noise=noise, speed=speed, label_every=label_every, progress=step,
        )  # fmt: skip
    print(f"Log: {out} ({out.stat().st_size / 1e6:.1f} MB)")
    return 0
