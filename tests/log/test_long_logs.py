"""Long logs: what is kept grows by a small index per frame, and each chunk is opened once per pass. All by counting."""

import gc
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("fsspec", reason="needs the extra 'remote'")

from looping_log import FRAMES, LoopingLog, register

from stsem.cli.inputs import report_inputs
from stsem.document.origin import Host
from stsem.log.container import remote
from stsem.log.container.store import Store
from stsem.log.log import Log, open_log
from stsem.replay.build import build_model
from stsem.replay.costing import costing
from stsem.replay.documents import build_document
from stsem.replay.engine import replay_log
from stsem.replay.runs import Context
from stsem.replay.settings import validated
from stsem.report.folder import write_folder

SHORT, LONG = 10, 50
READING, REPLAYING = 450, 2_200
"""Bytes per frame that may be held."""

COSTS = Path(__file__).parents[2] / "bench" / "costs" / "reference.json"


@pytest.fixture(autouse=True)
def _nothing_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Caches as small as a chunk, so that what grows with the log stands out."""
    register()
    monkeypatch.setattr("stsem.log.scanned.CACHE_BYTES", 0)
    monkeypatch.setattr("stsem.log.log.Store", partial(Store, cache_bytes=400_000))
    monkeypatch.setattr(remote, "BLOCK_BYTES", 1 << 14)


def address(chunks: int) -> str:
    return f"loop://{chunks}/2000/long.mcap"


def grown(work: Callable[[int], AbstractContextManager[None]]) -> tuple[float, float]:
    """By how many bytes (what is held inside `work`, its peak) grows for each further frame."""
    with work(SHORT):  # imports and caches of the libraries
        pass
    held, peaks = [], []
    tracemalloc.start()
    for chunks in (SHORT, LONG):
        gc.collect()
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        with work(chunks):
            peaks.append(tracemalloc.get_traced_memory()[1] - before)
            gc.collect()
            held.append(tracemalloc.get_traced_memory()[0] - before)
    tracemalloc.stop()
    return tuple((long - short) / ((LONG - SHORT) * FRAMES) for short, long in (held, peaks))


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
    """Of a frame with depth, labels and pose: three references, its partners, its plan and a pose."""

    @contextmanager
    def read(chunks: int) -> Iterator[None]:
        with open_log([address(chunks)]) as log:
            all_frames(log)
            yield

    held, _ = grown(read)
    assert held < READING


def test_a_replay_keeps_little_per_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Index, results and jobs of two modes with and without a clock, tallies of 13 classes, and the report's files."""
    monkeypatch.setattr("stsem.metrics.bootstrap.RESAMPLES", 20)  # of blocks: more in a longer log, up to 100
    monkeypatch.setattr("stsem.report.frames_csv.BLOCK_ROWS", 50)
    config = validated({"model": "oracle", "costs": str(COSTS), "keyframes": "every:5", "propagation": "hold",
                        "map": "off"})  # fmt: skip

    @contextmanager
    def replay(chunks: int) -> Iterator[None]:
        with open_log([address(chunks)]) as log:
            model = build_model(log, config)
            costs = costing(log, config, model, fused=False, say=print)
            replayed = replay_log(log, config, model, costs.of, lambda done, total: None)
            context = Context(log, config, model, costs, replayed)
            document = build_document(context, Host())
            inputs = report_inputs(context, document, tmp_path, plots=False)
            write_folder(inputs, tmp_path / "report")
            yield

    held, peak = grown(replay)
    assert held < REPLAYING
    assert peak < 1.5 * REPLAYING
    rows = (tmp_path / "report" / "frames.csv").read_text().splitlines()
    assert len(rows) == 1 + 2 * LONG * FRAMES
