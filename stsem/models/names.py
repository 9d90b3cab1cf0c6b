"""How other projects name the weights of a ResNet, and of a PSPNet on it: a row of `FAMILIES` each.

Names were read off hszhao/semseg (`model/pspnet.py`, `model/resnet.py`) and torchvision (`models/resnet.py`).
"""

import re
from collections.abc import Set
from dataclasses import dataclass

Rules = tuple[tuple[str, str], ...]

_STAGES: Rules = (
    (r"^layer1\.", "backbone.early.0."), (r"^layer2\.", "backbone.early.1."), (r"^layer3\.", "backbone.middle."),
    (r"^layer4\.", "backbone.late."),
)  # fmt: skip
_BLOCKS: Rules = (
    (r"\.conv1\.", ".body.0."), (r"\.bn1\.", ".body.1."), (r"\.conv2\.", ".body.3."), (r"\.bn2\.", ".body.4."),
    (r"\.conv3\.", ".body.6."), (r"\.bn3\.", ".body.7."), (r"\.downsample\.", ".shortcut."),
)  # fmt: skip
_ONE: Rules = ((r"^conv1\.", "backbone.stem.0."), (r"^bn1\.", "backbone.stem.1."))
_THREE: Rules = (
    *_ONE, (r"^conv2\.", "backbone.stem.3."), (r"^bn2\.", "backbone.stem.4."), (r"^conv3\.", "backbone.stem.6."),
    (r"^bn3\.", "backbone.stem.7."),
)  # fmt: skip
_PSPNET: Rules = (
    (r"^layer0\.", "backbone.stem."), (r"^ppm\.features\.(\d)\.1\.", r"pyramid.branches.\1.0."),
    (r"^ppm\.features\.(\d)\.2\.", r"pyramid.branches.\1.1."), (r"^cls\.", "head."), (r"^aux\.", "auxiliary."),
)  # fmt: skip


@dataclass(frozen=True)
class Family:
    """The names of a project.

    Args:
        title: whose they are.
        signs: a file with all of these is of the family.
        rules: patterns and what takes their place, one after the other, to make our names within a stream.
        stem: side of the first convolution.
    """

    title: str
    signs: frozenset[str]
    rules: Rules = ()
    stem: int | None = None

    def rename(self, key: str) -> str:
        """Our name within a stream."""
        for pattern, name in self.rules:
            key = re.sub(pattern, name, key)
        return key


FAMILIES: tuple[Family, ...] = (
    Family("PSPNet of hszhao/semseg", frozenset({"layer0.0.weight", "layer1.0.conv1.weight"}),
           (*_STAGES, *_BLOCKS, *_PSPNET), 3),
    Family("ResNet of hszhao/semseg", frozenset({"conv1.weight", "conv3.weight", "layer1.0.conv1.weight"}),
           (*_STAGES, *_BLOCKS, *_THREE), 3),
    Family("ResNet as torchvision names it", frozenset({"conv1.weight", "layer1.0.conv1.weight"}),
           (*_STAGES, *_BLOCKS, *_ONE), 7),
)  # fmt: skip
"""The first whose signs are all there counts."""
OURS = Family("stsem", frozenset())


def family_of(names: Set[str], own: Set[str]) -> Family | None:
    """Whose names these are: those of the network itself, `own`, or of another of ours with streams, or a row; else
    None."""
    for family in FAMILIES:
        if family.signs <= names:
            return family
    streams = ("colour.", "difference.")
    return OURS if names & own or any(name.startswith(streams) for name in names) else None
