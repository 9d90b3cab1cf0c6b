"""From the classes of the data to those of the network."""

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from stsem.classes import NO_LABEL, ClassSet, Labels, normalised
from stsem.errors import ClassTableError, TrainingError
from stsem.train.dataset import Pair, Pairs, fingerprint

ClassMap = Mapping[str, str]
"""Name in the data -> name in the network; "" for pixels that are not to be learned. Other names stay."""


def network_classes(data: ClassSet, class_map: ClassMap) -> ClassSet:
    """The classes that a network learns from data of `data`: their new names, in order, each once.

    Raises:
        ClassTableError: the map names a class that is not there, or leaves none.
    """
    for name in class_map:
        if data.find(name) is None:
            raise ClassTableError(f"The class map names {name!r}, which is none of {', '.join(data.names)}.")
    kept: dict[str, int] = {}
    for number, name in enumerate(_renamed(data, class_map)):
        if name and normalised(name) not in map(normalised, kept):
            kept[name] = number
    if not kept:
        raise ClassTableError("The class map leaves no class to learn; leave one its name.")
    return ClassSet(tuple(kept), tuple(data.colours[number] for number in kept.values()) if data.colours else ())


def lookup(data: ClassSet, network: ClassSet, class_map: ClassMap, where: str) -> Labels:
    """(256,) uint8: the network's id of each of the data's, NO_LABEL for what is not to be learned.

    Raises:
        ClassTableError: `where` has a class that the network does not have and the map does not name.
    """
    table = np.full(256, NO_LABEL, np.uint8)
    names = _renamed(data, class_map)
    if unknown := [name for name in names if name and network.find(name) is None]:
        raise ClassTableError(
            f"{where} has classes that the first data does not have ({', '.join(unknown)}); give each another name, or "
            'none (""), in --class-map.'
        )
    for number, name in enumerate(names):
        found = network.find(name) if name else None
        table[number] = NO_LABEL if found is None else found
    return table


def _renamed(data: ClassSet, class_map: ClassMap) -> list[str]:
    new = {normalised(name): to for name, to in class_map.items()}
    return [new.get(normalised(name), name) for name in data.names]


class Translated:
    """Pairs with their labels looked up in a table.

    Args:
        pairs: in ids of their own.
        table: (256,) uint8, from `lookup`.
        known: number of classes that these ids are of.
        name: of the data, for people.
    """

    def __init__(self, pairs: Pairs, table: Labels, *, known: int, name: str) -> None:
        self._pairs, self._table, self._known, self._name = pairs, table, known, name

    @property
    def fingerprint(self) -> str:
        """Of the pairs and the table."""
        return fingerprint([self._pairs.fingerprint, self._table.tobytes().hex()])

    def __len__(self) -> int:
        return len(self._pairs)

    def pair(self, index: int) -> Pair:
        """The pair at `index`. Raises TrainingError, also for an id that the data's class table does not have."""
        pair = self._pairs.pair(index)
        beyond = pair.labels[(pair.labels >= self._known) & (pair.labels != NO_LABEL)]
        if beyond.size:
            raise TrainingError(f"Pair {index} of {self._name} has {beyond.size} pixels with the label {beyond.max()}, "
                                f"but its class table has {self._known} classes, 0 to {self._known - 1}; mend one of "
                                "them.")  # fmt: skip
        return Pair(pair.images, np.stack([np.asarray(cv2.LUT(x, self._table), np.uint8) for x in pair.labels]),
                    pair.depths)  # fmt: skip


class Joined:
    """Several data sets, one behind the other."""

    def __init__(self, parts: Sequence[Pairs]) -> None:
        self._parts = tuple(parts)
        self._ends = np.cumsum([len(part) for part in parts])

    @property
    def fingerprint(self) -> str:
        """Of all parts in their order."""
        return fingerprint(part.fingerprint for part in self._parts)

    def __len__(self) -> int:
        return int(self._ends[-1])

    def pair(self, index: int) -> Pair:
        """The pair at `index`."""
        part = int(np.searchsorted(self._ends, index, side="right"))
        return self._parts[part].pair(index - int(self._ends[part - 1] if part else 0))
