"""Random damage to the container: what is found was there, and nothing is lost or changed in silence."""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_logs import room
from mcap.writer import CompressionType, IndexType

from stsem.log.container.files import find_files
from stsem.log.container.layout import FRAME
from stsem.log.container.records import MAGIC
from stsem.log.container.store import Store
from stsem.log.scan import Scan, scan

MUTANTS_OF_A_KIND = 12
NO_SUMMARY = {"use_statistics": False, "use_summary_offsets": False, "repeat_channels": False}
CHECKED: dict[str, dict[str, Any]] = {
    "zstd": {},
    "lz4": {"compression": CompressionType.LZ4, "chunk_size": 9000},
    "uncompressed chunks": {"compression": CompressionType.NONE},
    "no index": {"index_types": IndexType.NONE},
    "no summary": NO_SUMMARY | {"index_types": IndexType.MESSAGE},
    "no chunks, data checksum": {"use_chunking": False, "enable_data_crcs": True},
}
Images = frozenset[tuple[str, int, int, str]]


def images_of(result: Scan) -> Images:
    """(topic, stamp, log time, digest of the payload) of every image."""
    found = set()
    with Store(result.files, result.chunks, result.opened) as store:
        for track in result.tracks.values():
            refs = track.references()
            columns = (refs.stamp_ns, refs.log_ns, refs.place, refs.offset, refs.length)
            for stamp, log, place, offset, length in zip(*(c.tolist() for c in columns), strict=True):
                digest = hashlib.sha256(store.payload(place, offset, length)).hexdigest()
                found.add((track.topic, stamp, log, digest))
    return frozenset(found)


def others_of(result: Scan) -> dict[str, object]:
    """Number of messages and the content of all that are no images, by topic."""
    return {
        track.topic: (
            track.count, track.calibrations, track.class_names,
            {link: [array.tobytes() for array in samples.arrays()] for link, samples in track.transforms.items()},
        )
        for track in result.tracks.values()
    }  # fmt: skip


def heads(data: bytes) -> list[int]:
    """The place of each record, and of the closing magic."""
    places, at = [], len(MAGIC)
    while at <= len(data) - len(MAGIC):
        places.append(at)
        at += FRAME.size + FRAME.unpack_from(data, min(at, len(data) - FRAME.size))[1]
    return places


def mutants(data: bytes, draw: np.random.Generator, *, aligned: bool) -> Iterator[bytes]:
    """Flips, cuts, overwritten, removed and inserted stretches; with `aligned`, also stretches of whole records."""
    places = heads(data)

    def flipped(at: int) -> bytes:
        changed = bytearray(data)
        changed[at] ^= 1 << int(draw.integers(8))
        return bytes(changed)

    for _ in range(MUTANTS_OF_A_KIND):
        at, other, length = (int(n) for n in draw.integers(8, [len(data), len(data), 3000]))
        first, last = sorted(int(n) for n in draw.choice(places, 2, replace=False))
        yield flipped(at)
        yield flipped(first + int(draw.integers(FRAME.size)))
        yield flipped(min(first + int(draw.integers(60)), len(data) - 1))
        yield data[:at]
        yield data[:at] + draw.integers(0, 256, length % 200, np.uint8).tobytes() + data[at + length % 200 :]
        yield data[:at] + bytes(length % 50) + data[at + length % 50 :]
        yield data[:at] + data[at + length :]
        yield data[:at] + data[other : other + length] + data[at:]
        if aligned:
            yield data[:first] + data[last:]
            yield data[:last] + data[first:last] + data[last:]


@pytest.mark.parametrize("options", CHECKED.values(), ids=CHECKED.keys())
def test_what_is_found_was_there_and_what_differs_is_said(tmp_path: Path, options: dict[str, Any]) -> None:
    path = room(tmp_path / "log.mcap", frames=4, **options)
    data = path.read_bytes()
    whole = scan(find_files([path]))
    images, others = images_of(whole), others_of(whole)
    assert not whole.damage.lossy
    assert whole.unprotected == 0
    aligned = "use_statistics" not in options
    for number, mutant in enumerate(mutants(data, np.random.Generator(np.random.PCG64(5)), aligned=aligned)):
        path.write_bytes(mutant)
        result = scan(find_files([path]))
        found = images_of(result)
        same = found == images and others_of(result) == others
        assert same or result.damage.lossy, number
        assert found <= images or "use_chunking" in options, number
        assert result.sha256 == hashlib.sha256(mutant).hexdigest()
