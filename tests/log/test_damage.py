"""Random damage: never a traceback, and never a difference in silence where the container can tell."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from made_up_logs import room

from stsem.errors import LogError
from stsem.log.log import open_log

MUTATIONS = 60
PROTECTED = {"zstd chunks": {}, "data checksum, no chunks": {"use_chunking": False, "enable_data_crcs": True}}


def everything(path: Path) -> tuple[str, bool]:
    """(digest of all that a replay may see, whether the log is lossy)."""
    digest = hashlib.sha256()
    with open_log([path]) as log:
        for loaded in log.frames(range(len(log.plans)), depth=True, previous=True, truth=True):
            digest.update(repr(log.plans[loaded.index]).encode())
            frame = loaded.frame
            parts = (frame.image, frame.previous, frame.depth, frame.T_WC) if frame else ()
            for part in (*parts, loaded.truth):
                digest.update(b"-" if part is None else part.tobytes())
        digest.update(repr((log.classes, log.camera, log.info.choice)).encode())
        return digest.hexdigest(), log.info.damage.lossy


def mutants(data: bytes, draw: np.random.Generator) -> Iterator[bytes]:
    """Flips, cuts, overwritten stretches and splices, behind the magic."""
    for _ in range(MUTATIONS // 4):
        at, other, length = (int(x) for x in draw.integers(8, [len(data), len(data), 2000]))
        flipped = bytearray(data)
        flipped[at] ^= 1 << int(draw.integers(8))
        yield bytes(flipped)
        yield data[:at]
        yield data[:at] + draw.integers(0, 256, length % 200, np.uint8).tobytes() + data[at + length % 200 :]
        yield data[:at] + data[other : other + length] + data[at:]


@pytest.mark.parametrize("options", PROTECTED.values(), ids=PROTECTED.keys())
def test_damage_is_never_silent(tmp_path: Path, options: dict[str, bool]) -> None:
    data = room(tmp_path / "whole.mcap", frames=3, **options).read_bytes()
    whole, lossy = everything(tmp_path / "whole.mcap")
    assert not lossy
    path, survived = tmp_path / "mutant.mcap", 0
    refusals: list[str] = []
    for mutant in mutants(data, np.random.Generator(np.random.PCG64(11))):
        path.write_bytes(mutant)
        try:
            digest, lossy = everything(path)
        except LogError as err:
            refusals.append(str(err))
            continue
        survived += 1
        assert lossy or digest == whole
    assert survived > MUTATIONS // 2
    assert all("; the log is damaged: " in refusal for refusal in refusals)
