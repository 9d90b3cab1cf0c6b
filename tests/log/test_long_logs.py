"""Long logs: what is kept grows by a small index per frame, and each chunk is opened once per pass. All by counting."""

import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("fsspec", reason="needs the extra 'remote'")

from looping_log import FRAMES, LoopingLog, register

from stsem.log.container import remote
from stsem.log.container.store import Store
from stsem.log.log import Log, open_log
from stsem.replay.build import build_model
from stsem.replay.costing import costing
from stsem.replay.engine import replay_log
from stsem.replay.runs import Context
from stsem.replay.settings import validated

SHORT, LONG = 10, 40
BOUND = 2_500
"""Bytes per frame: index, two modes with and without a clock, 3 classes."""

COSTS = Path(__file__).parents[2] / "bench" / "costs" / "reference.json"


@pytest.fixture(autouse=True)
def _nothing_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Caches as small as a chunk, so that what grows with the log stands out."""
    register()
    monkeypatch.setattr("stsem.log.scanned.CACHE_BYTES", 0)
    monkeypatch.setattr("stsem.log.log.Store", partial(Store, cache_bytes=400_000))
    monkeypatch.setattr(remote, "BLOCK_BYTES", 1 << 18)


def address(chunks: int) -> str:
    return f"loop://{chunks}/2000/long.mcap"


def grown(work: Callable[[int], object]) -> float:
    """By how many bytes the peak of `work` grows for each further frame."""
    work(SHORT)  # imports and caches of the libraries
    peaks = []
    tracemalloc.start()
    for chunks in (SHORT, LONG):
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        work(chunks)
        peaks.append(tracemalloc.get_traced_memory()[1] - before)
    tracemalloc.stop()
    return (peaks[1] - peaks[0]) / ((LONG - SHORT) * FRAMES)


def test_the_looping_log_is_a_log() -> None:
    """Every byte is the same however it is asked for, and nothing in it is damaged."""
    log = LoopingLog(3, 100)
    whole = log.read(0, log.size)
    assert b"".join(log.read(at, min(log.size, at + 777)) for at in range(0, log.size, 777)) == whole
    with open_log([address(3)]) as opened:
        assert (len(opened.plans), opened.info.damage.lossy) == (3 * FRAMES, False)
        assert opened.info.choice.labels == "/gt/labels"
        stamps = [plan.stamp_ns for plan in opened.plans]
        assert stamps[-1] - stamps[0] == 29 * 10**9 // 30


def all_frames(log: Log) -> int:
    return sum(f.truth is not None for f in log.frames(range(len(log.plans)), depth=True, previous=True, truth=True))


def test_each_chunk_is_opened_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pass over all channels in order; what a log holds is told by a few looks, however long it is."""
    stores: list[Store] = []

    def make(*args: Any) -> Store:
        stores.append(Store(*args, cache_bytes=1_000_000))
        return stores[-1]

    monkeypatch.setattr("stsem.log.log.Store", make)
    for chunks in (SHORT, LONG):
        with open_log([address(chunks)]) as log:
            looks = stores[-1].decompressed
            assert looks <= 20
            assert all_frames(log) == chunks * FRAMES
            assert stores[-1].decompressed - looks <= chunks
            assert stores[-1].held_bytes <= 1_000_000


def test_reading_keeps_an_index_only() -> None:
    def read(chunks: int) -> None:
        with open_log([address(chunks)]) as log:
            all_frames(log)

    assert grown(read) < 1_200


def test_results_keep_little_per_frame() -> None:
    """Index, results of two modes with and without a clock, and tallies of 3 classes."""
    config = validated({"model": "oracle", "costs": str(COSTS), "keyframes": "every:5", "propagation": "hold",
                        "map": "off"})  # fmt: skip
    kept: list[Context] = []

    def replay(chunks: int) -> None:
        kept.clear()
        with open_log([address(chunks)]) as log:
            model = build_model(log, config)
            costs = costing(log, config, model, fused=False, say=print)
            replayed = replay_log(log, config, model, costs.of, lambda done, total: None)
            kept.append(Context(log, config, model, costs, replayed))

    assert grown(replay) < BOUND
