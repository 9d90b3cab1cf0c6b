"""A made-up run that looks like a real one: 150 frames of an office at 10 Hz, two modes, a two-core schedule."""

from math import ceil
from pathlib import Path

import numpy as np
from made_up_origin import host, identity, made_up_input
from made_up_pictures import CLASSES, strip_frame, unsure_frame
from made_up_schedule import COST_MS, FIRST_NS, FRAMES, MODES, PERIOD_NS, offline, schedule

from stsem.chance import generator
from stsem.classes import ClassSet
from stsem.document.accuracy import Coverage, DistanceRow, DistanceSummary, Loss, LossParts, Score
from stsem.document.calibration import Calibration, ErrorDetection, Judged, ReliabilityBin
from stsem.document.canonical import sealed
from stsem.document.schema import Comparison, ComparisonRow, Document, Run, Verdict
from stsem.document.timing import PERCENTILES, Distribution, Latency, Outcomes, StageLatency, Throughput
from stsem.report.inputs import FrameRow, ReportInputs
from stsem.result import FrameResult, Outcome

SHARES = (0, 1, 12, 6, 19, 9, 4, 2, 0, 7, 3, 31, 6)


def example(*, truth: bool = True, lossy: bool = False, clock: bool = True, pictures: bool = True) -> ReportInputs:
    """Inputs of a report; without truth, from a damaged log, or without a clock."""
    simulated = {mode: schedule(mode, lossy) if clock else offline(schedule(mode, lossy)) for mode in MODES}
    rows = tuple(_with_accuracy(mode, result, truth) for mode in MODES for result in simulated[mode])
    runs = tuple(_run(mode, [row for row in rows if row.mode == mode], truth, clock) for mode in MODES)
    document = Document(
        state="lossy" if lossy else "valid",
        state_reasons=("2 messages on /camera/color fail their CRC and 1 chunk is cut off.",) if lossy else (),
        accuracy_state="measured" if truth else "not measured",
        accuracy_reason="" if truth else "the log has no channel with labels",
        verdict=Verdict(
            exit_code=3 if lossy else 0, text="Finished, but the log is damaged." if lossy else "Finished."
        ),
        identity=identity(),
        input=made_up_input(truth, lossy),
        config={
            "mode": list(MODES),
            "model": "psp18",
            "keyframes": "paper",
            "propagation": "homography",
            "start": None,
            "end": None,
            "rate": 1,
            "queue": "latest",
            "cores": 2,
            "seed": 0,
            "clock": "real-time" if clock else "offline",
        },
        runs=runs,
        comparison=_comparison(runs, truth, clock),
        warnings=("The labels carry log times only; they are taken as stamps.",),
        host=host(),
    )
    strip = tuple(strip_frame(i, truth) for i in (12, 47, 90, 131)) if pictures else ()
    trace = _write_trace if clock else None
    unsure = unsure_frame(90, truth) if pictures else None
    return ReportInputs(
        sealed(document),
        {mode: [row for row in rows if row.mode == mode] for mode in MODES},
        strip,
        unsure=unsure,
        trace=trace,
        trajectory=[b"# stamp x y z qx qy qz qw\n"],
        answer_classes=ClassSet(CLASSES),
    )


def _write_trace(path: Path) -> None:
    path.write_bytes(b'{"traceEvents":[]}\n')


def _with_accuracy(mode: str, result: FrameResult, truth: bool) -> FrameRow:
    chance = generator(3, result.index)
    base = 0.93 + 0.02 * float(chance.standard_normal())
    distance = result.index - result.keyframe if result.keyframe is not None else 0
    offline = float(np.clip(base - 0.012 * distance * (mode == "keyframe"), 0, 1))
    delivered = offline if result.outcome.is_answer else 0.0
    streaming = float(np.clip(offline - (0.14 if mode == "per-frame" else 0.06), 0, 1))
    scores = (offline, delivered, streaming) if truth else (None, None, None)
    return FrameRow(mode, result, FIRST_NS + result.stamp_ns, result.keyframe, *scores)


def score(base: float, key: str, n: int = FRAMES, misses: int = 0) -> Score:
    """A plausible score around `base`."""
    total = 480 * 270 * n
    pixels = {name: total * share // 100 for name, share in zip(CLASSES, SHARES, strict=True)}
    iou = {
        name: float(np.clip(base + 0.1 * _normal(name) + 0.01 * _normal(key, name), 0.05, 0.98))
        if pixels[name]
        else None
        for name in CLASSES
    }
    present = [value for value in iou.values() if value is not None]
    return Score(
        miou=float(np.mean(present)),
        miou_union=float(np.mean(present)) * 11 / 12,
        classes_averaged=len(present),
        iou=iou,
        pixel_accuracy=min(1.0, base + 0.09),
        pixels=total,
        misses=misses,
        n=n,
        class_pixels=pixels,
        unlabelled_share=0.031,
        miou_common=float(np.mean(present)),
        classes_common=len(present),
    )


def _normal(*key: str) -> float:
    return float(generator(4, *key).standard_normal())


def distribution(samples_ns: list[int], n_distinct: int | None = 400) -> Distribution:
    """Order statistics of samples, under the rule of DESIGN 5."""
    if not samples_ns:
        return Distribution(n_distinct=n_distinct)
    ordered = sorted(samples_ns)
    n = len(ordered)
    enough = min(n, n if n_distinct is None else n_distinct)
    given = {name: ordered[ceil(p * n) - 1] / 1e6 for name, (p, needed) in PERCENTILES.items() if enough >= needed}
    return Distribution(**given, max=ordered[-1] / 1e6, mean=sum(ordered) / n / 1e6, n=n, n_distinct=n_distinct)


def _run(mode: str, rows: list[FrameRow], truth: bool, clock: bool) -> Run:
    results = [row.result for row in rows]
    keyframes = tuple(r.index for r in results if r.outcome is Outcome.SEGMENTED)
    passes = _scores(mode) if truth else {}
    if not clock:
        passes = {name: value for name, value in passes.items() if name == "offline"}
    reasons = [r.reason for r in results if r.outcome is Outcome.SEGMENTED]
    return Run(
        mode=mode,
        clock="real-time" if clock else "offline",
        frames=FRAMES,
        outcomes=_outcomes(results),
        keyframes=keyframes,
        keyframe_reasons={reason: reasons.count(reason) for reason in dict.fromkeys(reasons)},
        stages_inside=("segment",) if mode == "per-frame" else ("register", "segment", "propagate"),
        coverage=Coverage(frames_with_truth=FRAMES * truth, scored=FRAMES * truth, frames=FRAMES),
        **passes,
        loss=_loss(mode, passes) if truth and clock else None,
        strata={"segmented": score(0.80, "s", 26), "propagated": score(0.75, "p", 124)}
        if truth and mode == "keyframe"
        else {},
        by_distance=_by_distance() if truth and mode == "keyframe" else (),
        by_distance_summary=DistanceSummary(
            miou_mean=0.741, miou_min=0.688, pixel_accuracy_mean=0.86, pixel_accuracy_min=0.82, distances=7
        )
        if truth and mode == "keyframe"
        else None,
        calibration=_calibration(mode) if truth else {},
        error_detection=_detection() if truth else None,
        latency_ms=_latency(rows) if clock else None,
        throughput=_throughput(rows) if clock else None,
        not_measured={
            "map": "--map off",
            "trajectory": "the poses of the log are used as they are",
            **({} if truth else {"accuracy": "the log has no truth"}),
        },
    )


def _scores(mode: str) -> dict[str, Score]:
    drop = {"per-frame": (0.82, 0.66, 0.58), "keyframe": (0.76, 0.74, 0.69)}[mode]
    names = ("offline", "delivered", "streaming")
    return {
        name: score(base, mode + name, misses=2 * (name == "streaming")) for name, base in zip(names, drop, strict=True)
    }


def _loss(mode: str, passes: dict[str, Score]) -> Loss:
    first = _scores("per-frame")["offline"].miou or 0.0
    offline, delivered, streaming = (passes[name].miou or 0.0 for name in ("offline", "delivered", "streaming"))
    parts = {
        "network": 1 - first,
        "prediction": first - offline,
        "scheduling": offline - delivered,
        "staleness": delivered - streaming,
    }
    return Loss(**parts, n=LossParts(network=FRAMES, prediction=FRAMES, scheduling=FRAMES, staleness=FRAMES))


def _by_distance() -> tuple[DistanceRow, ...]:
    n = (26, 25, 24, 24, 22, 14, 10, 4, 1)
    return tuple(
        DistanceRow(
            frames=d, ms=100.0 * d, miou=0.80 - 0.019 * d + 0.004 * (d % 2), pixel_accuracy=0.92 - 0.011 * d, n=count
        )
        for d, count in enumerate(n)
    )


def _calibration(mode: str) -> dict[str, Calibration]:
    parts: dict[str, Judged] = {"segmented": "offline"}
    if mode == "keyframe":
        parts |= {"propagated": "offline", "delivered": "delivered"}
    return {name: _reliability(judged, 0.04 * (name == "propagated")) for name, judged in parts.items()}


def _reliability(judged: Judged, worse: float) -> Calibration:
    pixels = [0, 0, 90, 400, 900, 2_000, 4_000, 8_000, 12_000, 20_000, 30_000, 50_000, 80_000, 120_000, 900_000]
    middles = [(i + 0.5) / 15 for i in range(15)]
    bins = tuple(
        ReliabilityBin(lower=i / 15, upper=(i + 1) / 15, pixels=n, confidence=middle if n else None,
                       accuracy=min(1.0, middle + 0.06 - worse) if n else None)
        for i, (n, middle) in enumerate(zip(pixels, middles, strict=True))
    )  # fmt: skip
    return Calibration(judged=judged, ece=0.06 - worse, mce=0.06, confidence=0.9, accuracy=0.95 - worse,
                       pixels=sum(pixels), n=26, bins=bins)  # fmt: skip


def _detection() -> ErrorDetection:
    auc = {"one_minus_confidence": 0.91, "variance": 0.85, "entropy": 0.88, "mutual_information": 0.86}
    return ErrorDetection(judged="offline", auc=auc, wrong_share=0.05, pixels=1_227_390, n=26)


def _outcomes(results: list[FrameResult]) -> Outcomes:
    counts = {str(outcome): sum(r.outcome is outcome for r in results) for outcome in Outcome}
    return Outcomes.model_validate(counts)


def _latency(rows: list[FrameRow]) -> Latency:
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


def _throughput(rows: list[FrameRow]) -> Throughput:
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


def _comparison(runs: tuple[Run, ...], truth: bool, clock: bool) -> Comparison:
    base, other = runs
    rows = []
    for name in ("offline", "delivered", "streaming"):
        for key in ("miou", "pixel_accuracy"):
            a, b = getattr(base, name), getattr(other, name)
            if a and b:
                delta = getattr(b, key) - getattr(a, key)
                rows.append(
                    ComparisonRow(
                        metric=f"{name.replace('delivered', 'delivered_paired')}.{key}",
                        base=getattr(a, key),
                        other=getattr(b, key),
                        delta=delta,
                        ci95=(delta - 0.012, delta + 0.015),
                        n=FRAMES,
                        unit="fraction",
                    )
                )
    if clock and base.latency_ms and other.latency_ms and base.throughput and other.throughput:
        for key in ("mean", "p50", "max"):
            x, y = getattr(base.latency_ms.from_arrival, key), getattr(other.latency_ms.from_arrival, key)
            rows.append(
                ComparisonRow(
                    metric=f"latency_ms.from_arrival.{key}",
                    base=x,
                    other=y,
                    delta=y - x,
                    n=FRAMES,
                    unit="ms",
                    higher_is_better=False,
                    ci95=(y - x - 9, y - x + 7) if key == "mean" else None,
                    why_no_interval="" if key == "mean" else "no interval is computed for it",
                )
            )
        hz = base.throughput.output_hz or 0.0, other.throughput.output_hz or 0.0
        rows.append(
            ComparisonRow(
                metric="throughput.output_hz",
                base=hz[0],
                other=hz[1],
                delta=hz[1] - hz[0],
                n=FRAMES,
                unit="Hz",
                why_no_interval="a rate of the whole run",
            )
        )
    return Comparison(base=base.mode, other=other.mode, rows=tuple(rows))
