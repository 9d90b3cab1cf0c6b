"""The report of one replay: state, verdict, identity, input, runs, comparison."""

import importlib.metadata
import platform

from stsem import __version__
from stsem.document.canonical import sealed
from stsem.document.origin import Channel, Host, Identity, Input, LogInput
from stsem.document.schema import Document, Run, State, Verdict
from stsem.errors import EXIT_FINE, EXIT_LOSSY, EXIT_NOTHING_MEASURED
from stsem.inference.backends import BACKENDS
from stsem.inference.cpu import cpu_features
from stsem.log.log import Log
from stsem.replay.behind import fell_behind
from stsem.replay.build import policy_of
from stsem.replay.calibrate import registers
from stsem.replay.comparison import Contender, compare
from stsem.replay.engine import Replayed
from stsem.replay.runs import Context, Found, part, scored, without_scores
from stsem.stages.propagate import PROPAGATIONS

_UNNAMED = "homography", "points"
"""Method and work of `register` that profiles were measured with which do not name them."""
_PACKAGES = ("mcap", "numpy", "onnxruntime", "opencv-python-headless")


def build_document(context: Context, host: Host) -> Document:
    """The sealed document of a finished replay.

    Args:
        context: the log, the configuration and what came of it.
        host: what differs from run to run.
    """
    found = [scored(run) for run in context.replayed.runs]
    if not _anything_answered(context.replayed):
        found = [without_scores(f, "no frame was answered") for f in found]
    base = next((f for f in found if f.run.mode.segments_every_frame), None)
    measured, reason = _accuracy_state(context, found)
    state, reasons = _state(context, measured)
    parts = tuple(part(context, f, base) for f in found)
    comparisons = compare([_contender(p, f) for p, f in zip(parts, found, strict=True)], context.config.seed)
    return sealed(
        Document(
            state=state,
            state_reasons=reasons,
            accuracy_state="measured" if measured else "not measured",
            accuracy_reason=reason,
            verdict=_verdict(context, state, max(p.coverage.scored for p in parts) if measured else 0, reason),
            identity=_identity(context),
            input=_input(context, found),
            config=context.config.reported(),
            runs=parts,
            comparison=comparisons[0] if comparisons else None,
            more_comparisons=comparisons[1:],
            warnings=_warnings(context),
            host=host,
        )
    )


def _contender(part: Run, found: Found) -> Contender:
    """The frames of a pass are compared only if its score stands."""
    clocked, offline = (accuracy is not None and accuracy.measured for accuracy in (found.clocked, found.offline))
    return Contender(part, found.run.real_time if clocked else None, found.run.offline if offline else None)


def _anything_answered(replayed: Replayed) -> bool:
    """Whether any pass of any mode answered a frame; streaming would score even a run that never answers, with 0."""
    records = (record for run in replayed.runs for record in (run.real_time, run.offline) if record is not None)
    return any(result.outcome.is_answer for record in records for result in record.results)


def _accuracy_state(context: Context, found: list[Found]) -> tuple[bool, str]:
    if context.model.reason:
        return False, context.model.reason
    scores = [accuracy for f in found for accuracy in (f.offline, f.clocked) if accuracy is not None]
    if any(accuracy.measured for accuracy in scores):
        return True, ""
    return False, next((accuracy.reason for accuracy in scores), "no pass with truth ran")


def _state(context: Context, measured: bool) -> tuple[State, tuple[str, ...]]:
    timed = any(
        r.answered_ns is not None for run in context.replayed.runs if run.real_time for r in run.real_time.results
    )
    if not measured and not timed:
        return "invalid", ("Neither accuracy nor timing could be measured.",)
    damage = context.log.info.damage
    return ("lossy", (f"Parts of the log are missing or cannot be used: {damage}.",)) if damage.lossy else ("valid", ())


def _verdict(context: Context, state: str, scored: int, reason: str) -> Verdict:
    frames = len(context.replayed.slots)
    counted = "1 frame" if frames == 1 else f"{frames} frames"
    if state == "invalid":
        return Verdict(exit_code=EXIT_NOTHING_MEASURED, text=f"Nothing was measured: {reason}.")
    accuracy = f"accuracy measured on {scored}" if scored else f"accuracy not measured: {reason}"
    if state == "lossy":
        return Verdict(exit_code=EXIT_LOSSY, text=f"Finished with a damaged log: {counted}, {accuracy}.")
    return Verdict(exit_code=EXIT_FINE, text=f"Finished: {counted}, {accuracy}.")


def _identity(context: Context) -> Identity:
    network, costing, config = context.model.network, context.costing, context.config
    packages = {*_PACKAGES, *([BACKENDS[config.backend].distribution] if network else [])}
    versions = {name: importlib.metadata.version(name) for name in sorted(packages)}
    return Identity(
        backend=config.backend if network else "oracle",
        precision=config.precision if network else "",
        versions={"stsem": __version__, "python": platform.python_version(), **versions},
        cpu_features=cpu_features(),
        model=context.model.name,
        model_inputs=network.sidecar.inputs if network else (),
        model_sha256=network.model_sha256 if network else None,
        sidecar_sha256=network.sidecar_sha256 if network else None,
        costs="" if costing is None else costing.name,
        costs_sha256=None if costing is None else costing.sha256,
        costs_disturbed=costing is not None and costing.profile is not None and costing.profile.disturbed,
    )


def _input(context: Context, found: list[Found]) -> Input:
    classes = context.model.classes
    scores = [accuracy for f in found for accuracy in (f.offline, f.clocked) if accuracy is not None]
    return Input(
        logs=(_log_input(context),),
        classes=classes.names,
        colours=classes.colours,
        classes_unknown_to_network=scores[0].unknown if scores else (),
    )


def _log_input(context: Context) -> LogInput:
    log, config, slots = context.log, context.config, context.replayed.slots
    pictures = context.replayed.pictures
    truth = next((p.truth for p in pictures if p.truth is not None), None)
    return LogInput(
        name=log.info.name,
        sha256=log.info.sha256,
        frames=len(slots),
        frames_with_truth=sum(slot.has_truth for slot in slots),
        duration_s=(slots[-1].log_stamp_ns - slots[0].log_stamp_ns) / 1e9 if slots else None,
        damage=log.info.damage.as_dict(),
        period_ms=log.period_ns / 1e6,
        size=pictures[0].image.shape[1::-1] if pictures else None,
        truth_size=None if truth is None else truth.shape[::-1],
        channels=_channels(log),
        window_s=None if config.start is None and config.end is None else (config.start, config.end),
    )


def _channels(log: Log) -> dict[str, Channel]:
    choice, by_topic = log.info.choice, {channel.topic: channel for channel in log.info.channels}
    chosen = {
        "color": choice.color, "depth": choice.depth, "pose": choice.pose, "labels": choice.labels,
        "camera": choice.calibration,
    }  # fmt: skip
    table = {}
    for role, topic in chosen.items():
        if topic is not None and topic in by_topic:
            channel = by_topic[topic]
            offset = channel.offset_min_ns
            table[role] = Channel(
                topic=topic, messages=channel.count, schema_name=channel.schema,
                offset_ms=None if offset is None else offset / 1e6,
                offset_removed=topic in log.info.clock_offsets_ns,
            )  # fmt: skip
    return table


def _foreign_costs(context: Context) -> list[str]:
    """That the network's durations are those of another backend or precision, where the profile says so."""
    profile = None if context.costing is None else context.costing.profile
    if profile is None or context.model.network is None:
        return []
    measured, ran = profile.made_for.get("backend"), f"{context.config.backend} {context.config.precision}"
    if measured is None or measured == ran:
        return []
    return [
        f"The cost profile was measured with {measured}, but the network ran with {ran}: the timing is the former's."
    ]


def _other_method(context: Context) -> list[str]:
    """That the durations between keyframes are those of another method, or that nobody knows of which."""
    profile, config = None if context.costing is None else context.costing.profile, context.config
    if profile is None or all(mode.segments_every_frame for mode in config.modes):
        return []
    ran = config.propagation, registers(policy_of(config), PROPAGATIONS[config.propagation].needs)
    measured = profile.made_for.get("propagation", _UNNAMED[0]), profile.made_for.get("register", _UNNAMED[1])
    if measured == ran:
        return []
    return [
        f"The cost profile was measured with --propagation {measured[0]} (register: {measured[1]}), but the run used "
        f"{ran[0]} (register: {ran[1]}): the durations of `register` and `propagate` are the former's."
    ]


def _second_keyframe(context: Context) -> list[str]:
    """That profiles know what it takes to register a frame to one keyframe, not to two."""
    profile, config = None if context.costing is None else context.costing.profile, context.config
    policy = policy_of(config)
    looks = policy.needs_homography or policy.needs_coverage
    if profile is None or not (looks and PROPAGATIONS[config.propagation].needs.points):
        return []
    return [
        f"{mode.name} registers a frame to two keyframes while a newer one is on its way, but the cost profile was "
        "measured with one: its durations of `register` are too short."
        for mode in config.modes
        if mode.in_background
    ]


def _warnings(context: Context) -> tuple[str, ...]:
    found = [*map(str, context.log.info.warnings), *context.notes]
    if sentence := context.replayed.posing.sentence:
        found.append(sentence)
    found += [
        f"{run.mode.name} answered no frame before its run ended: the jobs last too long for this log."
        for run in context.replayed.runs
        if run.real_time is not None and not any(result.outcome.is_answer for result in run.real_time.results)
    ]
    found += [said for run in context.replayed.runs for said in fell_behind(context, run)]
    if context.config.cores == 1 and context.config.clock == "real-time":
        found += [
            f"{mode.name} needs two cores to answer while the network works; with one, answers wait for it."
            for mode in context.config.modes
            if mode.in_background
        ]
    if lacking := context.replayed.without_depth:
        frames = len(context.replayed.slots)
        found.append(
            f"{lacking} of {frames} frames have no depth, which the network {context.model.name} takes; it is given "
            "them as unknown all over."
        )
    costing = context.costing
    if costing is not None and costing.profile is not None and costing.profile.disturbed:
        found.append("The cost profile was measured while other work held a core; its durations are too long.")
    found += _foreign_costs(context) + _other_method(context) + _second_keyframe(context)
    if context.config.costs == "measured" and context.config.clock == "real-time":
        found.append("Durations were measured as they happened on this machine: timing does not repeat.")
    return tuple(found)
