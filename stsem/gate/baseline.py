"""The baseline: a small reviewed file that holds what is gated, and what must agree for a comparison to make sense."""

import json
from pathlib import Path
from typing import Literal

from pydantic import Field, JsonValue, ValidationError

from stsem.document.canonical import canonical, document_from, results_digest
from stsem.document.origin import Identity
from stsem.document.part import Count, Number, Part
from stsem.document.schema import Document, Run, State
from stsem.document.timing import Outcomes
from stsem.errors import NothingMeasuredError, UsageError
from stsem.gate.rules import RULES

ORACLE = "oracle"

SHOWN = ("latency_ms.from_arrival.p50", "throughput.processed_share")
"""Paths inside a run that a baseline keeps for whoever reviews it; no rule judges them."""
KEPT = (*(rule.path for rule in RULES), *SHOWN)
"""Paths inside a run that a baseline keeps."""

WINDOW = ("start", "end")
SIMULATION = ("rate", "queue", "cores", "seed", "count_decode")
"""Keys of the configuration that make another experiment: which frames, and what the simulated clock does with them."""


class BaselineRun(Part):
    """What is kept of one run."""

    mode: str
    """Mode of the run."""
    clock: str
    """Clock of the run."""
    outcomes: Outcomes
    """How many frames ended how."""
    keyframes: tuple[Count, ...] = ()
    """Log indices of the frames that went through the network."""
    metrics: dict[str, Number]
    """Path inside the run -> value in the unit of report.json; null when it was not measured."""


class Baseline(Part):
    """What a report is gated against."""

    baseline_version: Literal[1] = 1
    """Version of this file's layout."""
    schema_version: int
    """Schema version of the report it was made from."""
    state: State
    """State of the report it was made from."""
    digest: str
    """Digest of the report it was made from."""
    results_digest: str
    """Digest of what was measured alone, comparable across installations."""
    logs: dict[str, str]
    """Name of a log -> sha256."""
    classes: tuple[str, ...]
    """Classes of the log."""
    identity: Identity
    """Network, backend, versions and costs."""
    conditions: dict[str, JsonValue] = Field(default_factory=dict)
    """The configuration's window and simulation: they make another experiment, where thresholds do not."""
    runs: tuple[BaselineRun, ...] = Field(min_length=1)
    """One per mode."""

    @property
    def is_oracle(self) -> bool:
        """Whether the truth stood in for the network: then results must be equal, not merely close."""
        return self.identity.model == ORACLE or self.identity.backend == ORACLE


def make_baseline(document: Document) -> Baseline:
    """The baseline that a report would be.

    Raises:
        NothingMeasuredError: the report measured nothing, so it cannot judge another.
    """
    if document.state == "invalid" or not document.runs:
        raise NothingMeasuredError("The report measured nothing, so it cannot be a baseline; make it from a valid run.")
    return Baseline(
        schema_version=document.schema_version,
        state=document.state,
        digest=document.digest,
        results_digest=results_digest(document),
        logs={log.name: log.sha256 for log in document.input.logs},
        classes=document.input.classes,
        identity=document.identity,
        conditions={key: document.config[key] for key in (*WINDOW, *SIMULATION) if key in document.config},
        runs=tuple(_kept(run) for run in document.runs),
    )


def _kept(run: Run) -> BaselineRun:
    return BaselineRun(
        mode=run.mode,
        clock=run.clock,
        outcomes=run.outcomes,
        keyframes=run.keyframes,
        metrics={path: _number(run, path) for path in KEPT},
    )


def _number(run: Run, path: str) -> float | None:
    found: object = run
    for key in path.split("."):
        found = getattr(found, key) if isinstance(found, Part) else None
    return float(found) if isinstance(found, int | float) else None


def baseline_bytes(baseline: Baseline) -> bytes:
    """The file, canonical: one report, one baseline, small differences in review."""
    return canonical(baseline.model_dump(mode="json"))


def read_baseline(path: Path) -> Baseline:
    """Read a baseline, or make one from a report.json or a report's folder.

    Raises:
        NothingMeasuredError: there is no such file, so there is nothing to compare with.
        UsageError: the file is neither a baseline nor a report of this version.
    """
    file = path / "report.json" if path.is_dir() else path
    try:
        values = json.loads(file.read_bytes())
    except OSError as err:
        raise NothingMeasuredError(
            f"There is no baseline {path} ({err.strerror}); make one from a good report with --write-baseline."
        ) from err
    except ValueError as err:
        raise UsageError(f"{path} is not a baseline: it is no JSON; make one from a report.") from err
    if not isinstance(values, dict) or "baseline_version" not in values:
        return make_baseline(document_from(values, str(path)))
    try:
        return Baseline.model_validate(values)
    except ValidationError as err:
        first = err.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise UsageError(f"{path} is not a baseline of this version: {where}: {first['msg']}; make it again.") from err
