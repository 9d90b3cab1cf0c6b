"""The networks that can be built by name: one row each."""

from dataclasses import dataclass

from stsem.errors import UsageError
from stsem.models.resnet import ResNetSpec
from stsem.models.two_stream import OneStream, TwoStream


@dataclass(frozen=True)
class Architecture:
    """Shapes of a network's streams; no difference stream means the spatial network alone."""

    colour: ResNetSpec
    difference: ResNetSpec | None


def _both(spec: ResNetSpec) -> Architecture:
    return Architecture(spec, spec)


ARCHITECTURES: dict[str, Architecture] = {
    "pspnet-r50": _both(ResNetSpec(50)),  # the paper's
    "pspnet-r18": _both(ResNetSpec(18)),
    "pspnet-r18-w4": _both(ResNetSpec(18, 4 / 16)),  # width in sixteenths
    "pspnet-r18-w4-w2": Architecture(ResNetSpec(18, 4 / 16), ResNetSpec(18, 2 / 16)),  # the shipped one
    "pspnet-r18-w6-w4": Architecture(ResNetSpec(18, 6 / 16), ResNetSpec(18, 4 / 16)),
    "pspnet-r50-spatial": Architecture(ResNetSpec(50), None),
    "pspnet-r18-spatial": Architecture(ResNetSpec(18), None),
}


def build(name: str, classes: int) -> TwoStream | OneStream:
    """A network with random weights (torch's default initialisation; set the seed first).

    Raises:
        UsageError: `name` is not in `ARCHITECTURES`.
    """
    if name not in ARCHITECTURES:
        raise UsageError(f"There is no architecture {name!r}; choose one of {', '.join(ARCHITECTURES)}.")
    row = ARCHITECTURES[name]
    if row.difference is None:
        return OneStream(row.colour, classes)
    return TwoStream(row.colour, row.difference, classes)
