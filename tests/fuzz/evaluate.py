"""What becomes of a log: opened, inspected, replayed and reported in this process, with oracle and fixed costs."""

import contextlib
import hashlib
import io
import json
import os
import resource
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import typer

from stsem.cli.inspect import inspect
from stsem.cli.session import replay_all
from stsem.document.origin import Host
from stsem.document.schema import Document
from stsem.errors import StsemError
from stsem.log.log import Log, open_log
from stsem.replay.build import build_model
from stsem.replay.config import RunConfig
from stsem.replay.costing import costing
from stsem.replay.documents import build_document
from stsem.replay.engine import replay_log
from stsem.replay.posing import can_map
from stsem.replay.runs import Context
from stsem.sim.profile import CostProfile

COSTS_MS = {"segment@2": 100, "segment@1": 160, "register@1": 8, "propagate@1": 1, "fuse@1": 20, "decode@1": 3}
"""One sample a stage: then durations do not depend on the log's sha256, and equal logs have equal reports."""
OF_THE_FILE = ("digest", "host", "state", "state_reasons", "verdict")
OF_THE_LOG = ("name", "sha256", "damage")
OF_THE_INSPECTION = ("log", "damage", "damage_text")
FINE, LOSSY, NOTHING_MEASURED = 0, 3, 5

Content = Mapping[str, Any]


@dataclass(frozen=True)
class Outcome:
    """What came of a log.

    Args:
        kind: `valid`, `lossy`, `refused` (one sentence), or `crashed` (any other exception).
        content: everything that must be as in the undamaged log when the state is `valid`; empty without a report.
        text: the damage, the sentence, or the traceback.
        error: class of the exception; "" without one.
        seconds: wall-clock time.
        peak_bytes: largest resident set of this process so far.
        left_open: files that are open afterwards and were not before.
        files: what was written where nothing should be.
    """

    kind: str
    content: Content = field(default_factory=dict)
    text: str = ""
    error: str = ""
    seconds: float = 0.0
    peak_bytes: int = 0
    left_open: int = 0
    files: tuple[str, ...] = ()


class Bench:
    """A folder of its own, with everything in it that a command could write to: current folder, home, cache, scratch.

    Making one changes this process's environment and current folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()
        for name in ("in", "here", "home", "cache", "tmp", "out"):
            (self._folder / name).mkdir(parents=True)
        costs = self._folder / "in" / "costs.json"
        CostProfile("fuzz", {stage: (ms * 1_000_000,) for stage, ms in COSTS_MS.items()}).save(costs)
        os.environ |= {
            "HOME": str(self._folder / "home"), "TMPDIR": str(self._folder / "tmp"),
            "STSEM_CACHE": str(self._folder / "cache"), "STSEM_DEBUG": "1",
        }  # fmt: skip
        os.chdir(self._folder / "here")
        self._path = self._folder / "in" / "log.mcap"
        self._config = RunConfig(
            mode="per-frame,keyframe", model="oracle", keyframes="every:3", propagation="hold", costs=str(costs),
            plots=False, out=self._folder / "out" / "report",
        )  # fmt: skip

    def evaluate(self, data: bytes, *, command: bool = False) -> Outcome:
        """The outcome of `data` as a log; with `command` the whole commands run as well, and write their folder."""
        self._path.write_bytes(data)
        before, opened, began = self._files(), open_files(self._folder), time.monotonic()
        found = outcome(lambda: self._report(command=command))
        if found.kind == "refused":
            found = outcome(lambda: self._inspected(found, json_=not command))
        return replace(
            found,
            seconds=time.monotonic() - began,
            peak_bytes=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
            left_open=open_files(self._folder) - opened,
            files=tuple(sorted(name for name in self._files() - before if not name.startswith("out/report"))),
        )

    def _report(self, *, command: bool) -> Outcome:
        """Everything that is made of the log; raises what the commands raise."""
        with open_log([self._path]) as log:
            document, damage = self._replayed(log), log.info.damage
            report = document.model_dump(mode="json", exclude=set(OF_THE_FILE))
            report["input"]["logs"] = [without(entry, OF_THE_LOG) for entry in report["input"]["logs"]]
            report["pixels"] = pixels(log)
            state = "lossy" if damage.lossy else "valid"
            if document.state not in (state, "invalid"):
                raise DisagreementError(f"the report is {document.state}, the damage is {damage}")
        expected = LOSSY if damage.lossy else FINE
        report |= self._inspection(expected)
        if command:
            self._commands(expected)
        return Outcome(state, report, str(damage))

    def _inspection(self, expected: int) -> Content:
        code, shown = said(lambda: inspect([str(self._path)], json_=True))
        check_exit("inspect --json", code, (expected,))
        inspection = without(json.loads(shown), OF_THE_INSPECTION)
        return {f"inspect {key}": value for key, value in inspection.items()}

    def _inspected(self, refused: Outcome, *, json_: bool) -> Outcome:
        """Of a log that cannot be replayed what there is to say can be said, or that is refused, too."""
        with contextlib.suppress(StsemError):
            said(lambda: inspect([str(self._path)], json_=json_))
        return refused

    def _commands(self, expected: int) -> None:
        check_exit("inspect", said(lambda: inspect([str(self._path)]))[0], (expected,))
        check_exit("replay", said(self._command)[0], (expected, NOTHING_MEASURED))

    def _replayed(self, log: Log) -> Document:
        config = self._config
        model = build_model(log, config)
        costs = costing(log, config, model, fused=can_map(log, config), say=lambda text: None)
        replayed = replay_log(log, config, model, costs.of, lambda done, of: None)
        return build_document(Context(log, config, model, costs, replayed, {}, ()), Host())

    def _command(self) -> None:
        raise typer.Exit(replay_all([(str(self._path),)], self._config))

    def _files(self) -> set[str]:
        return {str(path.relative_to(self._folder)) for path in self._folder.rglob("*")}


class DisagreementError(Exception):
    """Two views of one log do not agree about its state."""


def check_exit(command: str, code: int, expected: tuple[int, ...]) -> None:
    """DisagreementError unless the command ended as the log is."""
    if code not in expected:
        raise DisagreementError(f"{command} ended with {code}, not with {' or '.join(map(str, expected))}")


def said(command: Callable[[], None]) -> tuple[int, str]:
    """(exit code, stdout) of a command that ends with `typer.Exit`."""
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), contextlib.redirect_stderr(io.StringIO()):
        try:
            command()
        except typer.Exit as end:
            return end.exit_code, shown.getvalue()
    raise DisagreementError("a command ended without an exit code")


def outcome(report: Callable[[], Outcome]) -> Outcome:
    """What came of `report`: what it returns, a refusal, or a crash."""
    try:
        return report()
    except StsemError as err:
        return Outcome("refused", text=str(err), error=type(err).__name__)
    except Exception as err:  # noqa: BLE001  that none comes is what is tested
        place = traceback.extract_tb(err.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        return Outcome("crashed", text=f"{where} {err}", error=type(err).__name__)


def pixels(log: Log) -> str:
    """Hash over stamps, images, depths, poses and labels of all frames."""
    found = hashlib.sha256()
    for loaded in log.frames(range(len(log.plans)), depth=True, previous=False, truth=True):
        frame = loaded.frame
        found.update(str(loaded.error).encode())
        parts = (frame.image, frame.depth, frame.T_WC) if frame else ()
        for part in (*parts, loaded.truth):
            found.update(b"-" if part is None else np.ascontiguousarray(part).tobytes())
    found.update(repr(list(log.plans)).encode())
    return found.hexdigest()


def without(mapping: Mapping[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    """`mapping` without `keys`."""
    return {key: value for key, value in mapping.items() if key not in keys}


def open_files(folder: Path) -> int:
    """Files below `folder` that this process has open; 0 where the system does not say."""
    links = Path("/proc/self/fd").glob("*") if sys.platform == "linux" else ()
    return sum(_target(link).startswith(f"{folder}{os.sep}") for link in links)


def _target(link: Path) -> str:
    try:
        return os.readlink(link)
    except OSError:  # closed since it was listed
        return ""
