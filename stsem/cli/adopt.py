"""`stsem adopt`: an ONNX file from elsewhere, made to fit."""

from pathlib import Path
from typing import Annotated, Literal, cast

import typer

from stsem.cli.launch import verb

HELP = """Make an ONNX network from elsewhere fit for stsem-replay (needs the extra 'train').

    stsem adopt theirs.onnx mine.onnx --sidecar mine.toml
    stsem adopt theirs.onnx mine.onnx --sidecar mine.toml --input image=pixel_values --output out --bgr

    Names, channels last, half precision, whole-number or 8-bit types, softmax, enlargement and argmax are seen to. The
    sidecar states what no file tells: size, mean and std, class names.
"""


@verb
def adopt(
    network: Annotated[Path, typer.Argument(metavar="THEIRS.onnx", help="The network.")],
    out: Annotated[Path, typer.Argument(metavar="OUT.onnx", help="The file to write; its sidecar goes beside it.")],
    sidecar: Annotated[Path, typer.Option("--sidecar", metavar="TOML", help="Size, mean, std, classes.")],
    input_: Annotated[
        list[str] | None,
        typer.Option("--input", metavar="[ROLE=]NAME", help="Which input takes image, difference or depth."),
    ] = None,
    output: Annotated[
        str | None, typer.Option("--output", metavar="NAME", help="Which output has scores or labels.")
    ] = None,
    layout: Annotated[
        str | None, typer.Option("--layout", metavar="nchw|nhwc", help="Of inputs whose shape does not tell.")
    ] = None,
    bgr: Annotated[bool, typer.Option("--bgr", help="It takes blue first; mean and std stay red first.")] = False,
) -> int:  # fmt: skip
    """Write OUT.onnx and OUT.toml, and load them as a replay does."""
    from stsem.cli.export import sidecar_of
    from stsem.errors import MissingExtraError, UsageError
    from stsem.inference.network import CHANNELS, CLASS_COUNT, load_network
    from stsem.inference.placing import placed

    try:
        from stsem.models.adopt import Told
        from stsem.models.adopt import adopt as adopt_network
    except ModuleNotFoundError as err:
        raise MissingExtraError("train", "Adopting a network") from err
    if out.suffix != ".onnx" or out.resolve() == network.resolve():
        raise UsageError(f"The network is written as {out}, but its name must end in .onnx and be another one.")
    if layout not in (None, "nchw", "nhwc"):
        raise UsageError(f"There is no layout {layout!r}; choose nchw (channels first) or nhwc (channels last).")
    form = sidecar_of(sidecar)
    told = Told(_roles(input_ or []), output, cast(Literal["nchw", "nhwc"] | None, layout), bgr)
    with placed(out, form) as unchecked:
        found = adopt_network(
            network, unchecked, told, size=form.size, classes=len(form.classes),
            metadata={CLASS_COUNT: str(len(form.classes))}, inputs={role: CHANNELS[role] for role in form.inputs},
        )  # fmt: skip
        load_network(unchecked)
    print("Found:   " + "\n         ".join(found))
    width, height = form.size
    print(f"Network: {out} ({out.stat().st_size / 1e6:.1f} MB, {len(form.classes)} classes, {width}x{height})")
    print(f"Replay:  stsem-replay LOG --model {out}")
    return 0


def _roles(given: list[str]) -> dict[str, str]:
    """`image=x` or `x`, which is the image's."""
    return dict((role, name) if name else ("image", role) for role, _, name in (text.partition("=") for text in given))
