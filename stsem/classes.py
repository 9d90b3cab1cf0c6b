"""Names of classes, and how two sets of names meet."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.errors import ClassTableError
from stsem.plain import plain

NO_LABEL = 255
"""In truth: ignore this pixel. In an answer: no label, which counts as wrong."""

MAX_CLASSES = 255

Colour = tuple[int, int, int]
Labels = npt.NDArray[np.uint8]
Bools = npt.NDArray[np.bool_]


def normalised(name: str) -> str:
    """The form in which names are compared: case, `_`, `-` and space are all the same."""
    return "".join(ch for ch in name.casefold() if ch not in "_- ")


@dataclass(frozen=True)
class ClassSet:
    """Class names; the position of a name is the id used in every label image inside stsem.

    Args:
        names: unique after `normalised`, 1 to 255 of them; what does not print becomes an escape.
        colours: RGB for pictures, one per name; empty means the default palette.
    """

    names: tuple[str, ...]
    colours: tuple[Colour, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(map(plain, self.names)))
        if not 1 <= len(self.names) <= MAX_CLASSES:
            raise ClassTableError(f"A class table needs 1 to {MAX_CLASSES} names, but {len(self.names)} came.")
        seen: dict[str, str] = {}
        for name in self.names:
            if other := seen.get(normalised(name)):
                raise ClassTableError(f"The class names {other!r} and {name!r} are the same name; rename one of them.")
            seen[normalised(name)] = name
        if self.colours and len(self.colours) != len(self.names):
            raise ClassTableError(
                f"{len(self.names)} classes came with {len(self.colours)} colours; give one per class."
            )

    def __len__(self) -> int:
        return len(self.names)

    def find(self, name: str) -> int | None:
        """Id of `name`, compared by `normalised`; None when there is no such class."""
        wanted = normalised(name)
        return next((i for i, own in enumerate(self.names) if normalised(own) == wanted), None)

    def palette(self) -> npt.NDArray[np.uint8]:
        """(256, 3) RGB; row 255 is black. Own colours if given, else a default table."""
        table = np.zeros((256, 3), np.uint8)
        own = self.colours or tuple(_default_colour(i) for i in range(len(self.names)))
        table[: len(own)] = np.array(own, np.uint8)
        return table


def translation(source: ClassSet, target: ClassSet, extra: Mapping[str, str] | None = None) -> Labels:
    """Lookup table (256,) uint8 from ids of `source` to ids of `target`; NO_LABEL where no name meets.

    Args:
        source: whose ids come in, e.g. the network's classes.
        target: whose ids go out, e.g. the log's classes.
        extra: source name -> target name, for names that differ (`--class-map`).

    Raises:
        ClassTableError: `extra` names a class that the source or the target does not have.
    """
    table = np.full(256, NO_LABEL, np.uint8)
    renamed = {_known(source, a): _known(target, b) for a, b in (extra or {}).items()}
    for i, name in enumerate(source.names):
        found = renamed.get(i, target.find(name))
        if found is not None:
            table[i] = found
    return table


def _known(classes: ClassSet, name: str) -> int:
    found = classes.find(name)
    if found is None:
        raise ClassTableError(f"The class map names {name!r}, which is none of {', '.join(classes.names)}.")
    return found


def _default_colour(i: int) -> Colour:
    """A table of muted colours that stay apart; beyond its end the same ones darker."""
    r, g, b = _DEFAULT_COLOURS[i % len(_DEFAULT_COLOURS)]
    shade = 0.72 ** (i // len(_DEFAULT_COLOURS) % 4)
    return int(r * shade), int(g * shade), int(b * shade)


_DEFAULT_COLOURS: tuple[Colour, ...] = (
    (91, 143, 199), (196, 120, 90), (240, 200, 80), (110, 110, 122), (205, 160, 190), (88, 140, 80), (210, 70, 75),
    (150, 105, 170), (60, 70, 130), (230, 110, 160), (80, 170, 165), (140, 95, 60), (165, 190, 95), (235, 150, 60),
    (120, 180, 225), (95, 60, 90), (190, 185, 160), (45, 105, 95), (225, 185, 165), (130, 130, 60),
)  # fmt: skip
