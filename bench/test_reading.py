"""Reading against its floor, at 960x540: one pass that reads, decompresses and decodes the same messages and no more.

Content first: both must give the same pixels. Then the ratio of the two, taken in turns in one run.
"""

from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from bench.recording import FRAMES, floor
from stsem.log.log import open_log

ROUNDS = 5


def _harness(path: Path) -> int:
    with open_log([path]) as log:
        return sum(1 for _ in log.frames(range(len(log.plans)), depth=True, previous=True, truth=True))


def test_reading_overfloor(log_path: Path, benchmark: BenchmarkFixture) -> None:
    """Scan and all frames through `Log`, as a multiple of the floor."""
    with open_log([log_path]) as log:
        loaded = log.frames(range(len(log.plans)), depth=True, previous=True, truth=True)
        for row, got in zip(floor(log_path), loaded, strict=True):
            assert got.frame is not None
            assert got.frame.depth is not None
            assert got.truth is not None
            np.testing.assert_array_equal(got.frame.image, row.rgb)
            np.testing.assert_array_equal(got.frame.depth, row.depth)
            np.testing.assert_array_equal(got.truth, row.labels)
    times: dict[str, list[float]] = {"floor": [], "floor_cpu": [], "ours": [], "ours_cpu": [], "scan": []}
    for _ in range(ROUNDS):
        start, cpu = perf_counter(), process_time()
        assert sum(1 for _ in floor(log_path)) == FRAMES
        times["floor"].append(perf_counter() - start)
        times["floor_cpu"].append(process_time() - cpu)
        start, cpu = perf_counter(), process_time()
        assert _harness(log_path) == FRAMES
        times["ours"].append(perf_counter() - start)
        times["ours_cpu"].append(process_time() - cpu)
        start = perf_counter()
        open_log([log_path]).close()
        times["scan"].append(perf_counter() - start)
    ms = {name: 1000 * min(values) / FRAMES for name, values in times.items()}
    benchmark.extra_info |= {f"{name}_ms_per_frame": round(value, 3) for name, value in ms.items()}
    benchmark.extra_info["wall_over_floor"] = round(ms["ours"] / ms["floor"], 3)
    benchmark.extra_info["cpu_over_floor"] = round(ms["ours_cpu"] / ms["floor_cpu"], 3)
    print(f"\n{log_path.stat().st_size / 1e6:.1f} MB", benchmark.extra_info)
    benchmark.pedantic(_harness, args=(log_path,), rounds=1)
