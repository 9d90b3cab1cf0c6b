"""`stsem train`: labelled logs in, a network to replay with out."""

from pathlib import Path
from typing import Annotated

import typer

from stsem.cli.launch import verb
from stsem.cli.options import option

HELP = """Train a network on labelled logs, folders of images or rendered pairs (needs the extra 'train').

    stsem train walk.mcap corridor.mcap --validation lab.mcap --out office
    stsem train images/ --classes classes.json --architecture pspnet-r50 --recipe paper --weights pspnet50.pth
    stsem train walk.mcap --architecture fcn-8s-w4 --iterations 2000 --crop 320x192

The same command again goes on where it was stopped. docs/train.md says the rest.
"""

_DATA, _NETWORK, _RECIPE, _MACHINE = "Data", "Network", "Recipe", "Machine"


@verb
def train(
    data: Annotated[
        list[str], typer.Argument(metavar="DATA...", help="Logs, folders of images and labels, or of .npz pairs.")
    ],
    out: Annotated[
        Path, option("--out", panel=_NETWORK, metavar="DIR", help="Checkpoints, curves, network. [training]")
    ] = Path("training"),
    architecture: Annotated[
        str,
        option("--architecture", panel=_NETWORK, metavar="NAME", help="A row of stsem export --list. [pspnet-r18-w4]"),
    ] = "pspnet-r18-w4",
    weights: Annotated[
        Path | None, option("--weights", panel=_NETWORK, help="Weights to begin with, a file of torch.")
    ] = None,
    size: Annotated[
        str | None,
        option("--size", panel=_NETWORK, metavar="WxH", help="Input of the network. [from crop and scales]"),
    ] = None,
    validation: Annotated[
        list[str] | None,
        option("--validation", panel=_DATA, metavar="DATA", help="Other data to judge on; may be repeated."),
    ] = None,
    classes: Annotated[Path | None, option("--classes", panel=_DATA, help="Class table of the truth.")] = None,
    class_map: Annotated[
        Path | None, option("--class-map", panel=_DATA, help='TOML of data class = network class; "" for none.')
    ] = None,
    topic: Annotated[
        list[str] | None,
        option("--topic", panel=_DATA, metavar="ROLE=TOPIC", help="Channel for color, depth or labels."),
    ] = None,
    recipe: Annotated[
        str, option("--recipe", panel=_RECIPE, metavar="NAME|TOML", help="scratch, paper, or a file. [scratch]")
    ] = "scratch",
    stages: Annotated[
        str | None,
        option("--stages", panel=_RECIPE, metavar="LIST", help="Of colour,difference,fused. [all there are]"),
    ] = None,
    iterations: Annotated[
        int | None, option("--iterations", panel=_RECIPE, metavar="N", help="Of a stream; fused in proportion.")
    ] = None,
    batch: Annotated[int | None, option("--batch", panel=_RECIPE, metavar="N", help="Views an iteration.")] = None,
    rate: Annotated[
        float | None, option("--rate", panel=_RECIPE, metavar="R", help="Largest learning rate; fused in proportion.")
    ] = None,
    crop: Annotated[str | None, option("--crop", panel=_RECIPE, metavar="WxH", help="Size of a view.")] = None,
    set_: Annotated[
        list[str] | None,
        option("--set", panel=_RECIPE, metavar="KEY=VALUE", help="Any number of the recipe: 'scales=[1, 1.7]'."),
    ] = None,
    seed: Annotated[int, option("--seed", panel=_RECIPE, metavar="N", help="Of every draw. [0]")] = 0,
    device: Annotated[str, option("--device", panel=_MACHINE, help="auto, cpu or cuda. [auto]")] = "auto",
    precision: Annotated[
        str, option("--precision", panel=_MACHINE, help="auto (bf16 where the processor has it), f32 or bf16. [auto]")
    ] = "auto",
    workers: Annotated[
        int, option("--workers", panel=_MACHINE, metavar="N", help="Threads, each with a part of the batch. [2]")
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
