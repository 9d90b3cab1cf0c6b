"""Latency and throughput of the made-up run, from its schedule."""

from math import ceil

import numpy as np
from made_up_schedule import COST_MS, PERIOD_NS

from stsem.document.timing import PERCENTILES, Distribution, Latency, StageLatency, Throughput
from stsem.report.inputs import FrameRow


def distribution(samples_ns: list[int], n_distinct: int | None = 400) -> Distribution:
    """Order statistics of samples, under the rule of DESIGN 5."""
    if not samples_ns:
        return Distribution(n_distinct=n_distinct)
    ordered = sorted(samples_ns)
    n = len(ordered)
    enough = min(n, n if n_distinct is None else n_distinct)
    given = {name: ordered[ceil(p * n) - 1] / 1e6 for name, (p, needed) in PERCENTILES.items() if enough >= needed}
    return Distribution(**given, max=ordered[-1] / 1e6, mean=sum(ordered) / n / 1e6, n=n, n_distinct=n_distinct)


def latency(rows: list[FrameRow]) -> Latency:
    answered = [row for row in rows if row.latency_ns is not None]
    stages = {
        stage: StageLatency(
            waiting=distribution([w for row in rows if (w := row.waiting_ns(stage)) is not None], None),
            service=distribution([s for row in rows if (s := row.service_ns(stage)) is not None]),
        )
        for stage in COST_MS
        if any(row.service_ns(stage) is not None for row in rows)
    }
    arrival = [row.latency_ns or 0 for row in answered]
    stamp = [(row.result.answered_ns or 0) - row.result.stamp_ns for row in answered]
    waiting = [(row.result.taken_ns or 0) - (row.result.arrival_ns or 0) for row in answered]
    return Latency(
        from_arrival=distribution(arrival),
        from_stamp=distribution(stamp),
        waiting=distribution(waiting, None),
        stages=stages,
    )


def throughput(rows: list[FrameRow]) -> Throughput:
    times = sorted(row.result.answered_ns for row in rows if row.result.answered_ns is not None)
    end = times[-1]
    busy = [
        sum(s.end_ns - s.start_ns for row in rows for s in row.result.spans if core in s.cores) / end for core in (0, 1)
    ]
    late = sum(row.latency_ns is None or row.latency_ns > PERIOD_NS for row in rows)
    return Throughput(
        output_hz=(len(times) - 1) / (end - times[0]) * 1e9,
        offered_hz=10.0,
        outputs=len(times),
        processed_share=len(times) / len(rows),
        utilisation=tuple(min(1.0, share) for share in busy),
        deadline_ms=100.0,
        deadline_misses=late,
        jitter_ms=float(np.std(np.diff(times))) / 1e6,
        real_time_factor=0.985,
    )
