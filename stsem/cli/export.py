"""`stsem export`: a training checkpoint, or a network with random weights, as ONNX and sidecar."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stsem.cli.launch import verb

if TYPE_CHECKING:
    from stsem.inference.sidecar import Sidecar
    from stsem.models.network import SegmentationNetwork

HELP = """Export a network to an ONNX file with its sidecar, and check it against torch (needs the extra 'train').

    stsem export network.onnx --checkpoint training.pt --sidecar like.toml
    stsem export network.onnx --architecture pspnet-r50 --sidecar like.toml   (random weights, for timing)
    stsem export network.onnx --architecture pspnet-r50-spatial --weights semseg.pth --sidecar like.toml
    stsem export --list                                                       (the architectures there are)
"""


@verb
def export(
    out: Annotated[
        Path | None, typer.Argument(metavar="OUT.onnx", help="The file to write; its sidecar goes beside it.")
    ] = None,
    sidecar: Annotated[
        Path | None,
        typer.Option("--sidecar", metavar="TOML", help="Size, normalisation, classes, forms of difference and depth."),
    ] = None,
    checkpoint: Annotated[Path | None, typer.Option("--checkpoint", help="Weights and architecture.")] = None,
    architecture: Annotated[
        str | None, typer.Option("--architecture", metavar="NAME", help="A network by name; random weights.")
    ] = None,
    weights: Annotated[
        Path | None,
        typer.Option("--weights", help="Weights for --architecture: of hszhao/semseg, a torchvision ResNet, or ours."),
    ] = None,
    passes: Annotated[
        int,
        typer.Option(
            "--uncertainty", metavar="PASSES", min=0, max=1000,
            help="Passes of Monte Carlo dropout, for maps of variance, entropy and mutual information; 0 for none.",
        ),
    ] = 0,
    show: Annotated[bool, typer.Option("--list", help="List the architectures with their size and work.")] = False,
) -> int:  # fmt: skip
    """Exactly one of checkpoint and architecture, or the list alone."""
    from stsem.errors import MissingExtraError, UsageError

    if show:
        from stsem.models.sizes import table

        print(table())
        return 0
    try:
        from stsem.train.publish import load_checkpoint, publish
    except ModuleNotFoundError as err:
        raise MissingExtraError("train", "Exporting a network") from err
    if out is None or sidecar is None or (checkpoint is None) == (architecture is None):
        raise UsageError("stsem export takes OUT.onnx, --sidecar, and either --checkpoint or --architecture.")
    if weights is not None and architecture is None:
        raise UsageError("--weights needs --architecture, the network that they are for.")
    if out.suffix != ".onnx":
        raise UsageError(f"The network is written as {out}, but its name must end in .onnx.")
    described = sidecar_of(sidecar)
    classes = len(described.classes)
    if checkpoint is not None:
        network = load_checkpoint(checkpoint, classes)
    else:
        network = _built(architecture or "", weights, described)
    published = publish(network, described, out, passes=passes)
    width, height = published.size
    print(f"Network: {out} ({out.stat().st_size / 1e6:.1f} MB, {classes} classes, {width}x{height})")
    print(f"Inputs:  {', '.join(published.sidecar.inputs)}")
    print(f"Replay:  stsem-replay LOG --model {out}")
    return 0


def _built(architecture: str, weights: Path | None, sidecar: "Sidecar") -> "SegmentationNetwork":
    """A network by name, with random weights or those of a file, whose fate is told."""
    from stsem.models.checkpoint import begin_with
    from stsem.models.zoo import build

    network = build(architecture, len(sidecar.classes)).eval()
    if weights is not None:
        difference = sidecar.difference
        loaded = begin_with(network, weights, std=sidecar.std, scale=difference.scale if difference else None)
        print("Weights: " + "\n         ".join(loaded.lines()))
        if not loaded.complete:
            print("         What was not taken is random: train the network before you judge it.")
    return network


def sidecar_of(path: Path) -> "Sidecar":
    """The sidecar in a file. Raises NetworkError."""
    from stsem.errors import NetworkError
    from stsem.inference.sidecar import parse

    try:
        return parse(path.read_text(encoding="utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as err:
        reason = err.strerror if isinstance(err, OSError) else "it is not UTF-8 text"
        raise NetworkError(f"The sidecar {path} cannot be read: {reason}.") from err
