"""Which earlier views look like this one: binary descriptors hashed to words, words weighted by how rare they are.

There is no vocabulary to train or to ship: a word is WORD_BITS bits of a descriptor at places drawn once for each
table (locality-sensitive hashing; Indyk, Motwani 1998), and words score by inverse document frequency (Sivic,
Zisserman 2003), so that what every room shows counts for nothing.
"""

import numpy as np
import numpy.typing as npt

from stsem.chance import generator

TABLES = 8
WORD_BITS = 16
DESCRIPTOR_BITS = 256

Words = npt.NDArray[np.int32]
"""(m,) int32, ascending, each once."""


class Recall:
    """Views by their words. Views are numbered in the order they are added."""

    def __init__(self) -> None:
        self._bits = np.stack(
            [generator(0, "recall", table).permutation(DESCRIPTOR_BITS)[:WORD_BITS] for table in range(TABLES)]
        )
        self._views_with = np.zeros(TABLES << WORD_BITS, np.int32)
        self._words = np.zeros(1 << 14, np.int32)
        self._starts = [0]

    def __len__(self) -> int:
        return len(self._starts) - 1

    def words(self, descriptors: npt.NDArray[np.uint8]) -> Words:
        """The words of one view's descriptors (n, 32)."""
        bits = np.unpackbits(descriptors, axis=1)[:, self._bits].astype(np.int32)  # (n, tables, word bits)
        values = bits @ (1 << np.arange(WORD_BITS, dtype=np.int32))
        return np.unique(values + (np.arange(TABLES, dtype=np.int32) << WORD_BITS))

    def add(self, words: Words) -> None:
        """Remember a view."""
        end = self._starts[-1] + len(words)
        if end > len(self._words):
            self._words = np.concatenate([self._words, np.zeros(max(len(self._words), len(words)), np.int32)])
        self._words[self._starts[-1] : end] = words
        self._starts.append(end)
        self._views_with[words] += 1

    def similarity(self, words: Words) -> npt.NDArray[np.float64]:
        """(views,) 0..1: weight of the words shared, over that of all words of this view, a geometric mean of both."""
        if not len(self) or not len(words):
            return np.zeros(len(self))
        rarity = np.log((len(self) + 1.0) / np.maximum(np.arange(len(self) + 1), 1)).astype(np.float32)[
            self._views_with
        ]
        here = np.zeros(len(rarity), np.bool_)
        here[words] = True
        stored = self._words[: self._starts[-1]]
        weights = rarity[stored]
        shared, own = self._sums(weights * here[stored]), self._sums(weights)
        return np.asarray(shared / np.sqrt(np.maximum(own * float(rarity[words].sum(dtype=np.float64)), 1e-12)))

    def _sums(self, values: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """(views,) sums over the words of each; a view may have none."""
        total = np.concatenate([[0.0], np.cumsum(values, dtype=np.float64)])
        return np.asarray(np.diff(total[self._starts]))
