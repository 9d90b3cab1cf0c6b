"""`stsem costs`: cost profiles, measured on one machine for use on another."""

from fractions import Fraction
from pathlib import Path
from typing import Annotated

import typer

from stsem.cli.launch import verb

app = typer.Typer(help="Measure or scale cost profiles.")


@app.command("measure", help="Measure what every stage costs on this machine, on frames of a log.")
@verb
def measure(
    log: Annotated[str, typer.Argument(metavar="LOG", help="MCAP file, folder or address.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Where the profile goes.")],
    model: Annotated[str, typer.Option("--model", metavar="NAME|ONNX", help="The network.")] = "default",
    propagation: Annotated[str, typer.Option("--propagation", help="The method between keyframes.")] = "auto",
    backend: Annotated[
        str, typer.Option("--backend", help="What runs the network: onnxruntime or openvino.")
    ] = "onnxruntime",
    precision: Annotated[str, typer.Option("--precision", help="f32, int8 or (openvino only) bf16.")] = "f32",
    samples: Annotated[int, typer.Option("--samples", min=1, help="Undisturbed samples per stage.")] = 60,
    seconds: Annotated[float, typer.Option("--seconds", min=0.1, help="Longest time per stage.")] = 60.0,
) -> int:
    """Write a profile with the network on one and on two cores."""
    from stsem.cli.console import note
    from stsem.log.log import open_log
    from stsem.replay.build import build_model, needed_roles, settled
    from stsem.replay.calibrate import measure as calibrate
    from stsem.replay.costing import calibration_frames, subject
    from stsem.replay.posing import can_map, can_track
    from stsem.replay.settings import validated

    config = validated(
        {"model": model, "propagation": propagation, "backend": backend, "precision": precision, "count_decode": True}
    )
    with open_log([log]) as opened:
        config = settled(opened, config)
        built, fused = build_model(opened, config), can_map(opened, config)
        frames = calibration_frames(opened, needed_roles(built, config, fused=fused))
        wanted = subject(opened, config, built, cores=(1, 2), fused=fused, track=can_track(opened))
        profile = calibrate(wanted, frames, samples=samples, limit_ns=round(seconds * 1e9))
    profile.save(out)
    for stage, times in profile.samples_ns.items():
        print(f"{stage:14} median {times[len(times) // 2] / 1e6:8.2f} ms of {len(times)} samples")
    if profile.disturbed:
        note("Other work held a core during the measurement; the profile is marked as disturbed.")
    print(f"Profile: {out}")
    return 0


@app.command("scale", help="A profile for a machine that is slower or faster by known factors.")
@verb
def scale(
    profile: Annotated[Path, typer.Argument(metavar="PROFILE", help="A cost profile.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Where the scaled profile goes.")],
    by: Annotated[
        list[str], typer.Option("--by", metavar="X or STAGE=X", help="Factor for all stages, or for one; repeatable.")
    ],
) -> int:
    """Multiply samples."""
    from stsem.errors import UsageError
    from stsem.sim.profile import load_profile

    default, factors = Fraction(1), {}
    for text in by:
        stage, equals, number = text.rpartition("=")
        try:
            factor = Fraction(number)
        except (ValueError, ZeroDivisionError):
            raise UsageError(f"--by takes a factor such as 2.5 or segment=2.5, but {text!r} came.") from None
        if equals:
            factors[stage] = factor
        else:
            default = factor
    load_profile(profile).scaled(factors, default).save(out)
    print(f"Profile: {out}")
    return 0
