"""Randomness without order: every draw is a hash of what it is for, so call order never matters."""

import hashlib

import numpy as np


def _digest(seed: int, parts: tuple[str | int, ...]) -> bytes:
    return hashlib.sha256("\x1f".join(map(str, (seed, *parts))).encode()).digest()


def hash64(seed: int, *parts: str | int) -> int:
    """First 8 bytes (big endian) of sha256(seed, parts): an integer in [0, 2^64)."""
    return int.from_bytes(_digest(seed, parts)[:8], "big")


def hash31(seed: int, *parts: str | int) -> int:
    """A non-negative 31-bit integer, for libraries that take a C int as their seed."""
    return hash64(seed, *parts) >> 33


def choose(seed: int, n: int, *parts: str | int) -> int:
    """floor(u n) with u = hash64 / 2^64, exactly (DESIGN 3, costs): an index in [0, n)."""
    return hash64(seed, *parts) * n >> 64


def generator(seed: int, *parts: str | int) -> np.random.Generator:
    """A numpy generator of its own for `parts`."""
    return np.random.Generator(np.random.PCG64(int.from_bytes(_digest(seed, parts)[:16], "big")))
