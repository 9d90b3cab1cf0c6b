"""`stsem export`: a training checkpoint, or a network with random weights, as ONNX and sidecar."""

from pathlib import Path
from typing import Annotated

import typer

from stsem.cli.launch import verb

HELP = """Export a network to an ONNX file with its sidecar, and check it against torch (needs the extra 'train').

    stsem export network.onnx --checkpoint training.pt --sidecar like.toml
    stsem export network.onnx --architecture pspnet-r50 --sidecar like.toml   (random weights, for timing)
"""


@verb
def export(
    out: Annotated[Path, typer.Argument(metavar="OUT.onnx", help="The file to write; its sidecar goes beside it.")],
    sidecar: Annotated[
        Path,
        typer.Option("--sidecar", metavar="TOML", help="Size, normalisation, classes and difference to export with."),
    ],
    checkpoint: Annotated[Path | None, typer.Option("--checkpoint", help="Weights and architecture.")] = None,
    architecture: Annotated[
        str | None, typer.Option("--architecture", metavar="NAME", help="Random weights of a network by name.")
    ] = None,
) -> int:
    """Exactly one of checkpoint and architecture."""
    from stsem.errors import MissingExtraError, NetworkError, UsageError
    from stsem.inference.sidecar import parse

    if (checkpoint is None) == (architecture is None):
        raise UsageError("stsem export takes either --checkpoint or --architecture.")
    if out.suffix != ".onnx":
        raise UsageError(f"The network is written as {out}, but its name must end in .onnx.")
    try:
        from stsem.models.zoo import build
        from stsem.train.publish import load_checkpoint, publish
    except ModuleNotFoundError as err:
        raise MissingExtraError("train", "Exporting a network") from err
    try:
        described = parse(sidecar.read_text(encoding="utf-8"), str(sidecar))
    except OSError as err:
        raise NetworkError(f"The sidecar {sidecar} cannot be read: {err.strerror}.") from err
    classes = len(described.classes)
    if checkpoint is not None:
        network = load_checkpoint(checkpoint, classes)
    else:
        network = build(architecture or "", classes).eval()
    published = publish(network, described, out)
    width, height = published.size
    print(f"Network: {out} ({out.stat().st_size / 1e6:.1f} MB, {classes} classes, {width}x{height})")
    print(f"Replay:  stsem-replay LOG --model {out}")
    return 0
