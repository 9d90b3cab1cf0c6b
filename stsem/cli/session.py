"""The straight line of `stsem replay`: open, build, replay, document, write, print."""

import sys
import tempfile
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path

from stsem import hostclock
from stsem.cli.console import note, progress
from stsem.cli.foreign import pointing_to_convert
from stsem.cli.inputs import annotate_map, report_inputs
from stsem.document.canonical import to_bytes
from stsem.document.difference import first_differences, repeatable_files
from stsem.document.origin import Host, StageCost
from stsem.document.schema import Document
from stsem.errors import NotRepeatableError, StsemError, UsageError
from stsem.log.container.source import shown_name, without_secrets
from stsem.log.describe import log_name
from stsem.log.log import Log, open_log
from stsem.plain import MAX_SENTENCE, plain
from stsem.replay.build import Model, build_model, needed_roles, settled, truth_frames
from stsem.replay.config import RunConfig
from stsem.replay.costing import Costing, costing
from stsem.replay.documents import build_document
from stsem.replay.engine import replay_log
from stsem.replay.posing import can_map
from stsem.replay.runs import Context
from stsem.replay.timing import deadline_ns
from stsem.report.annotated import AnnotatedLog
from stsem.report.folder import check_target, folder_name, write_folder
from stsem.report.terminal import closing_table
from stsem.search.probe import Probe
from stsem.search.sustainable import Sustainable, search
from stsem.stages.track import Tracker

REPORTS = Path("reports")


@dataclass(frozen=True)
class Began:
    """When work on a log began, by the host's clocks, nanoseconds."""

    wall_ns: int
    cpu_ns: int

    @classmethod
    def now(cls) -> "Began":
        """This instant."""
        return cls(hostclock.wall_ns(), hostclock.process_cpu_ns())


@dataclass(frozen=True, eq=False)
class Session:
    """One log, opened, with everything that replays of it share."""

    log: Log
    config: RunConfig
    model: Model
    costing: Costing | None
    fused: bool


def replay_all(recordings: Sequence[tuple[str, ...]], config: RunConfig) -> int:
    """Replay each recording into a report of its own; returns the largest exit code.

    With several recordings an error in one is said, and the others go on.
    """
    folders = _folders(recordings, config.out)
    if len(recordings) == 1:
        return _replay_one(recordings[0], config, folders[0])
    return max(_in_turn(paths, config, out) for paths, out in zip(recordings, folders, strict=True))


def _in_turn(paths: tuple[str, ...], config: RunConfig, out: Path | None) -> int:
    try:
        return _replay_one(paths, config, out)
    except UsageError:
        raise
    except StsemError as err:
        note(f"stsem: {err}")
        return err.exit_code


def _folders(recordings: Sequence[tuple[str, ...]], out: Path | None) -> list[Path | None]:
    """Where each report goes: `out` itself for one log, else below it by name; None is the default place."""
    if out is None or len(recordings) == 1:
        return [out] * len(recordings)
    names = [log_name(paths) for paths in recordings]
    if twice := [name for name in names if names.count(name) > 1]:
        raise UsageError(
            f"Two logs are named {twice[0]}, but --out gives each log a folder of its name; replay them one by one."
        )
    return [out / name for name in names]


def _replay_one(paths: tuple[str, ...], config: RunConfig, out: Path | None) -> int:
    began = Began.now()
    name = log_name(paths)
    check_target(out or REPORTS / name / "report")
    if len(paths) > 1:
        note(f"Reading {', '.join(map(shown_name, paths))} as one recording in parts.")
    with progress(f"Reading {name}") as step, pointing_to_convert(paths):
        log = open_log(
            paths,
            topics={str(role): topic for role, topic in config.topic.items()},
            classes_file=config.classes, depth_registered=config.depth_registered,
            start_s=config.start, end_s=config.end, progress=step,
        )  # fmt: skip
    with log:
        session = _session(log, settled(log, config))
        document, folder = _write(session, out, began)
        for number in range(2, config.repeat + 1):
            _check_repeats(session, folder, number)
    _print(document, folder, config)
    return document.verdict.exit_code


def _session(log: Log, config: RunConfig) -> Session:
    model = build_model(log, config)
    fused = can_map(log, config)
    clocked = config.clock == "real-time"
    costs = costing(log, config, model, fused=fused, say=note) if clocked else None
    return Session(log, config, model, costs, fused)


def _replay(session: Session, annotated: AnnotatedLog | None) -> Context:
    log, config, model, costs = session.log, session.config, session.model, session.costing
    watch = None if annotated is None else lambda mode, result, frame: annotated.answer(mode.name, result, frame)
    with progress(f"Replaying {log.info.name}") as step:
        replayed = replay_log(log, config, model, None if costs is None else costs.of, step, watch)
    rates = _sustainable(session, replayed.runs[0].tracker)
    notes = tuple(
        f"{mode} sustains {found.hz:g} Hz, the highest rate tried; it may sustain more."
        for mode, found in rates.items()
        if found.on_bound
    )
    return Context(log, config, model, costs, replayed, {mode: found.hz for mode, found in rates.items()}, notes)


def _sustainable(session: Session, tracker: Tracker | None) -> dict[str, Sustainable]:
    """Mode -> the highest rate it sustains, in frames per second, where that was asked for."""
    log, config, costs = session.log, session.config, session.costing
    if not config.sustainable or costs is None:
        return {}
    usable = truth_frames(log) if config.is_oracle else None
    deadline = deadline_ns(config.deadline_ms, log.period_ns, Fraction(1))
    needs = needed_roles(session.model, config, fused=session.fused)
    probe = Probe(log, config, costs.of, needs=needs, fused=session.fused, usable=usable, tracker=tracker,
                  patience_ns=deadline)  # fmt: skip
    return {
        mode.name: search(partial(probe.attempt, mode), capture_hz=1e9 / log.period_ns, deadline_ns=deadline)
        for mode in config.modes
    }


def _write(session: Session, out: Path | None, began: Began) -> tuple[Document, Path]:
    with tempfile.TemporaryDirectory(prefix="stsem-") as scratch:
        path = Path(scratch) / "annotated.mcap"
        with AnnotatedLog(path, session.model.classes) if session.config.annotate else nullcontext() as annotated:
            context = _replay(session, annotated)
            if annotated is not None:
                annotate_map(annotated, context)
        document = build_document(context, _host(session, context, began))
        folder = out or REPORTS / session.log.info.name / folder_name(document)
        inputs = report_inputs(context, document, Path(scratch), plots=session.config.plots)
        return document, write_folder(replace(inputs, annotated=None if annotated is None else path), folder)


def _check_repeats(session: Session, first: Path, number: int) -> None:
    """Replay once more and compare every file that must have the same bytes.

    Raises:
        NotRepeatableError: they differ; the first field and frame are named.
    """
    with tempfile.TemporaryDirectory(prefix="stsem-") as scratch:
        _, again = _write(session, Path(scratch) / "again", Began.now())
        found = first_differences(repeatable_files(first), repeatable_files(again))
    if found:
        where = "; ".join(map(str, found[:3]))
        raise NotRepeatableError(f"Replay {number} differs from the first ({first}): {where}.")


def _host(session: Session, context: Context, began: Began) -> Host:
    replayed = context.replayed
    inside = sum(time.total_ns for time in replayed.stage_times.values())
    return Host(
        paths={"log": _shown(map(str, session.log.info.sources), ", "), "model": session.config.model,
               "costs": session.config.costs},
        command=_shown(sys.argv, " "),
        machine=hostclock.machine_facts(),
        started_at=hostclock.utc_now(),
        wall_s=(hostclock.wall_ns() - began.wall_ns) / 1e9,
        cpu_s=(hostclock.process_cpu_ns() - began.cpu_ns) / 1e9,
        stages={
            stage: StageCost(mean_ms=time.total_ns / time.n / 1e6, max_ms=time.max_ns / 1e6, n=time.n)
            for stage, time in sorted(replayed.stage_times.items())
        },
        overhead_ms=(replayed.wall_ns - inside) / max(1, len(replayed.slots)) / 1e6,
        peak_memory_bytes=hostclock.peak_memory_bytes(),
    )  # fmt: skip


def _shown(words: Iterable[str], between: str) -> str:
    """Paths and addresses as a report may show them."""
    return between.join(plain(without_secrets(word), MAX_SENTENCE) for word in words)


def _print(document: Document, folder: Path, config: RunConfig) -> None:
    if config.json_:
        sys.stdout.write(to_bytes(document).decode())
    else:
        print(f"{closing_table(document)}\n\n{document.verdict.text}")
    if document.state == "lossy":
        note(" ".join(document.state_reasons))
    for warning in document.warnings:
        note(f"Note: {warning}")
    (note if config.json_ else print)(f"Report: {folder / 'report.html'}")
