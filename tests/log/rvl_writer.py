"""RVL written by the book: A. D. Wilson, "Fast lossless depth image compression", ISS 2017, figure 3."""

from collections.abc import Iterator

import numpy as np


def rvl(image: np.ndarray) -> bytes:
    """The stream of a (H, W) uint16 image."""
    nibbles = [nibble for number in numbers(image.ravel().tolist()) for nibble in split(number)]
    return packed(nibbles)


def numbers(values: list[int]) -> Iterator[int]:
    """Zeros, nonzeros, their zigzag differences from the last nonzero value; and so on."""
    at, previous = 0, 0
    while at < len(values):
        first = at
        while at < len(values) and values[at] == 0:
            at += 1
        yield at - first
        first = at
        while at < len(values) and values[at] != 0:
            at += 1
        yield at - first
        for value in values[first:at]:
            delta = value - previous
            yield 2 * delta if delta >= 0 else -2 * delta - 1
            previous = value


def split(number: int) -> Iterator[int]:
    """Three bits a nibble, the lowest first; the fourth bit says that more follow."""
    while True:
        more = number >> 3
        yield (number & 7) | (8 if more else 0)
        if not more:
            return
        number = more


def packed(nibbles: list[int]) -> bytes:
    """Eight nibbles to a little-endian word, the first one at its top; the last word is filled up with zeros."""
    words = []
    for at in range(0, len(nibbles), 8):
        word = 0
        for nibble in (nibbles[at : at + 8] + [0] * 8)[:8]:
            word = word << 4 | nibble
        words.append(word)
    return np.array(words, "<u4").tobytes()
