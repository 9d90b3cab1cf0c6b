"""A made-up run that looks like a real one: 150 frames of an office at 10 Hz, two modes, a two-core schedule."""

from pathlib import Path

import numpy as np
from made_up_accuracy import by_distance, calibration, detection, loss, score, scores
from made_up_comparison import comparison
from made_up_origin import host, identity, made_up_input
from made_up_pictures import CLASSES, strip_frame, unsure_frame
from made_up_schedule import FIRST_NS, FRAMES, MODES, offline, schedule
from made_up_timing import latency, throughput

from stsem.chance import generator
from stsem.classes import ClassSet
from stsem.document.accuracy import Coverage, DistanceSummary
from stsem.document.canonical import sealed
from stsem.document.schema import Document, Run, Verdict
from stsem.document.timing import Outcomes
from stsem.report.inputs import FrameRow, ReportInputs
from stsem.result import FrameResult, Outcome


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
        comparison=comparison(runs, truth, clock),
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


def _run(mode: str, rows: list[FrameRow], truth: bool, clock: bool) -> Run:
    results = [row.result for row in rows]
    keyframes = tuple(r.index for r in results if r.outcome is Outcome.SEGMENTED)
    passes = scores(mode) if truth else {}
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
        loss=loss(mode, passes) if truth and clock else None,
        strata={"segmented": score(0.80, "s", 26), "propagated": score(0.75, "p", 124)}
        if truth and mode == "keyframe"
        else {},
        by_distance=by_distance() if truth and mode == "keyframe" else (),
        by_distance_summary=DistanceSummary(
            miou_mean=0.741, miou_min=0.688, pixel_accuracy_mean=0.86, pixel_accuracy_min=0.82, distances=7
        )
        if truth and mode == "keyframe"
        else None,
        calibration=calibration(mode) if truth else {},
        error_detection=detection() if truth else None,
        latency_ms=latency(rows) if clock else None,
        throughput=throughput(rows) if clock else None,
        not_measured={
            "map": "--map off",
            "trajectory": "the poses of the log are used as they are",
            **({} if truth else {"accuracy": "the log has no truth"}),
        },
    )


def _outcomes(results: list[FrameResult]) -> Outcomes:
    counts = {str(outcome): sum(r.outcome is outcome for r in results) for outcome in Outcome}
    return Outcomes.model_validate(counts)
