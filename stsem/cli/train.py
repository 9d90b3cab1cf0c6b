"""`stsem train`: labelled logs in, a network to replay with out."""

from pathlib import Path
from typing import Annotated, Any

import typer

from stsem.cli.launch import verb

HELP = """Train a network on labelled logs, folders of images or rendered pairs (needs the extra 'train').

    stsem train walk.mcap corridor.mcap --validation lab.mcap --out office
    stsem train images/ --classes classes.json --architecture pspnet-r50 --recipe paper --weights pspnet50.pth
    stsem train walk.mcap --architecture fcn-8s-w4 --iterations 2000 --crop 320x192

The same command again goes on where it was stopped. docs/train.md says the rest.
"""

_DATA, _NETWORK, _RECIPE, _MACHINE = "Data", "Network", "Recipe", "Machine"


def _option(*names: str, panel: str, help: str, metavar: str | None = None) -> Any:
    return typer.Option(*names, help=help, rich_help_panel=panel, metavar=metavar, show_default=False)


@verb
def train(
    data: Annotated[
        list[str], typer.Argument(metavar="DATA...", help="Logs, folders of images and labels, or of .npz pairs.")
    ],
    out: Annotated[
        Path, _option("--out", panel=_NETWORK, metavar="DIR", help="Checkpoints, curves, network. [training]")
    ] = Path("training"),
    architecture: Annotated[
        str,
        _option("--architecture", panel=_NETWORK, metavar="NAME", help="A row of stsem export --list. [pspnet-r18-w4]"),
    ] = "pspnet-r18-w4",
    weights: Annotated[
        Path | None, _option("--weights", panel=_NETWORK, help="Weights to begin with, a file of torch.")
    ] = None,
    size: Annotated[
        str | None,
        _option("--size", panel=_NETWORK, metavar="WxH", help="Input of the network. [from crop and scales]"),
    ] = None,
    validation: Annotated[
        list[str] | None,
        _option("--validation", panel=_DATA, metavar="DATA", help="Other data to judge on; may be repeated."),
    ] = None,
    classes: Annotated[Path | None, _option("--classes", panel=_DATA, help="Class table of the truth.")] = None,
    class_map: Annotated[
        Path | None, _option("--class-map", panel=_DATA, help='TOML of data class = network class; "" for none.')
    ] = None,
    topic: Annotated[
        list[str] | None,
        _option("--topic", panel=_DATA, metavar="ROLE=TOPIC", help="Channel for color, depth or labels."),
    ] = None,
    recipe: Annotated[
        str, _option("--recipe", panel=_RECIPE, metavar="NAME|TOML", help="scratch, paper, or a file. [scratch]")
    ] = "scratch",
    stages: Annotated[
        str | None,
        _option("--stages", panel=_RECIPE, metavar="LIST", help="Of colour,difference,fused. [all there are]"),
    ] = None,
    iterations: Annotated[
        int | None, _option("--iterations", panel=_RECIPE, metavar="N", help="Of a stream; fused in proportion.")
    ] = None,
    batch: Annotated[int | None, _option("--batch", panel=_RECIPE, metavar="N", help="Views an iteration.")] = None,
    rate: Annotated[
        float | None, _option("--rate", panel=_RECIPE, metavar="R", help="Largest learning rate; fused in proportion.")
    ] = None,
    crop: Annotated[str | None, _option("--crop", panel=_RECIPE, metavar="WxH", help="Size of a view.")] = None,
    set_: Annotated[
        list[str] | None,
        _option("--set", panel=_RECIPE, metavar="KEY=VALUE", help="Any number of the recipe: 'scales=[1, 1.7]'."),
    ] = None,
    seed: Annotated[int, _option("--seed", panel=_RECIPE, metavar="N", help="Of every draw. [0]")] = 0,
    device: Annotated[str, _option("--device", panel=_MACHINE, help="auto, cpu or cuda. [auto]")] = "auto",
    precision: Annotated[
        str, _option("--precision", panel=_MACHINE, help="auto (bf16 where the processor has it), f32 or bf16. [auto]")
    ] = "auto",
    workers: Annotated[
        int, _option("--workers", panel=_MACHINE, metavar="N", help="Threads, each with a part of the batch. [2]")
    ] = 2,
) -> int:
    """Train every stage, export the last one."""
    from stsem.errors import MissingExtraError

    try:
        from stsem.cli.training import train_all
        from stsem.cli.training_plan import Wanted
    except ModuleNotFoundError as err:
        raise MissingExtraError("train", "Training a network") from err
    return train_all(
        Wanted(
            data=tuple(data), validation=tuple(validation or ()), out=out, architecture=architecture, weights=weights,
            size=size, classes=classes, class_map=class_map, topics=tuple(topic or ()), recipe=recipe, stages=stages,
            iterations=iterations, batch=batch, rate=rate, crop=crop, assignments=tuple(set_ or ()), seed=seed,
            device=device, precision=precision, workers=workers,
        )
    )  # fmt: skip
