"""The whole harness over the floor of reading, at 960x540: reading, decoding, answering by `hold`, metrics, document.

DESIGN's promise is at most 1.5. The answers are checked first: a number for a wrong replay is worth nothing.
"""

from pathlib import Path
from time import perf_counter

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from bench.recording import FRAMES, floor
from stsem.document.origin import Host
from stsem.document.schema import Document
from stsem.log.log import open_log
from stsem.replay.build import build_model
from stsem.replay.config import RunConfig
from stsem.replay.documents import build_document
from stsem.replay.engine import replay_log
from stsem.replay.runs import Context

ROUNDS, INTERVAL = 5, 5
CONFIG = RunConfig(model="oracle", mode="keyframe", keyframes=f"every:{INTERVAL}", propagation="hold", clock="offline")


def _harness(path: Path) -> Document:
    with open_log([path]) as log:
        model = build_model(log, CONFIG)
        replayed = replay_log(log, CONFIG, model, None, lambda done, total: None)
        return build_document(Context(log, CONFIG, model, None, replayed), Host())


def test_harness_over_floor(log_path: Path, benchmark: BenchmarkFixture) -> None:
    """From bytes to a sealed document, as a multiple of reading and decoding the same images on one thread."""
    labels = [row.labels.copy() for row in floor(log_path, depth=False)]
    right = sum(int((labels[i] == labels[i - i % INTERVAL]).sum()) for i in range(FRAMES))
    score = _harness(log_path).runs[0].offline
    assert score is not None
    np.testing.assert_allclose(score.pixel_accuracy, right / (FRAMES * labels[0].size), rtol=1e-12)
    times: dict[str, list[float]] = {"floor": [], "ours": []}
    for _ in range(ROUNDS):
        start = perf_counter()
        assert sum(1 for _ in floor(log_path, depth=False)) == FRAMES
        times["floor"].append(perf_counter() - start)
        start = perf_counter()
        _harness(log_path)
        times["ours"].append(perf_counter() - start)
    ms = {name: 1000 * min(values) / FRAMES for name, values in times.items()}
    benchmark.extra_info |= {f"{name}_ms_per_frame": round(value, 3) for name, value in ms.items()}
    benchmark.extra_info["over_floor"] = round(ms["ours"] / ms["floor"], 3)
    print(f"\n{benchmark.extra_info}")
    benchmark.pedantic(_harness, args=(log_path,), rounds=1)
