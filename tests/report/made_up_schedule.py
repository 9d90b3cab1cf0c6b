"""A made-up schedule: 150 frames at 10 Hz, one answer at a time, on two cores."""

from dataclasses import dataclass, replace

from stsem.chance import generator
from stsem.result import FrameResult, Outcome, Span

FRAMES, PERIOD_NS, FIRST_NS = 150, 100_000_000, 1_700_000_000_000_000_123
MODES = ("per-frame", "keyframe")
COST_MS = {"register": (8.0, 11.0), "segment": (150.0, 195.0), "propagate": (4.5, 7.0), "fuse": (14.0, 22.0)}


@dataclass
class _Cores:
    """The two-core schedule of the example, job after job."""

    mode: str
    free_ns: int = 0

    def job(self, frame: int, stage: str, ready: int, cores: tuple[int, ...]) -> Span:
        low, high = COST_MS[stage]
        start = max(ready, self.free_ns if len(cores) == 2 else ready)
        cost = int(1e6 * generator(0, stage, frame).uniform(low, high))
        self.free_ns = start + cost
        return Span(frame, stage, cores, ready, start, start + cost)


def schedule(mode: str, lossy: bool) -> list[FrameResult]:
    """What becomes of every frame under the rule `latest`, with costs drawn at random."""
    cores, results, busy_until, keyframe = _Cores(mode), [], 0, None
    for i in range(FRAMES):
        stamp = i * PERIOD_NS
        arrival = stamp + 12_000_000 + int(generator(1, i).uniform(0, 4e6))
        if lossy and i in (40, 41):
            results.append(FrameResult(i, stamp, None, None, None, Outcome.UNDECODABLE, reason="bad CRC"))
            continue
        if busy_until > arrival + PERIOD_NS:
            results.append(FrameResult(i, stamp, arrival, None, None, Outcome.DROPPED_BUSY, reason="newer frame came"))
            continue
        taken, spans = max(arrival, busy_until), []
        segment = mode == "per-frame" or keyframe is None or i - keyframe >= 5 + int(generator(2, i).integers(0, 4))
        if mode == "keyframe":
            spans.append(cores.job(i, "register", taken, (0,)))
        stage, which = ("segment", (0, 1)) if segment else ("propagate", (0,))
        spans.append(cores.job(i, stage, spans[-1].end_ns if spans else taken, which))
        busy_until = answered = spans[-1].end_ns
        if segment:
            keyframe = i
            if mode == "keyframe":
                spans.append(replace(cores.job(i, "fuse", answered, (1,)), cores=(1,)))
        reason = ("first" if i == 0 else "every frame" if mode == "per-frame" else "rotation") if segment else ""
        outcome = Outcome.SEGMENTED if segment else Outcome.PROPAGATED
        results.append(FrameResult(i, stamp, arrival, taken, answered, outcome, keyframe, reason, 0.97, tuple(spans)))
    return results


def offline(results: list[FrameResult]) -> list[FrameResult]:
    """The same frames without a clock: no times, and none dropped."""
    return [
        replace(r, arrival_ns=None, taken_ns=None, answered_ns=None, spans=(), outcome=Outcome.PROPAGATED
                if r.outcome is Outcome.DROPPED_BUSY else r.outcome, keyframe=r.keyframe or 0)
        for r in results
    ]  # fmt: skip
