"""Whether two reports can be compared at all, and how their installations differ."""

import json

from stsem.document.origin import Identity
from stsem.gate.baseline import SIMULATION, WINDOW, Baseline


def obstacles(base: Baseline, head: Baseline, timing: bool) -> tuple[str, ...]:
    """Why the two are not comparable, one sentence each; empty when they are (DESIGN 6).

    Args:
        base, head: baseline and judged report.
        timing: whether anything that depends on the cost profile is to be compared.
    """
    found = []
    if base.schema_version != head.schema_version:
        found.append(f"The baseline has report schema {base.schema_version}, the report {head.schema_version}.")
    if sorted(base.logs.values()) != sorted(head.logs.values()):
        found.append(f"The baseline is of {_logs(base)}, the report of {_logs(head)}: not the same log.")
    if base.classes != head.classes:
        found.append(_classes(base.classes, head.classes))
    clocks = {run.mode: run.clock for run in head.runs}
    for run in base.runs:
        if run.mode not in clocks:
            found.append(f"The baseline has the mode {run.mode}, the report only {', '.join(clocks) or 'none'}.")
        elif clocks[run.mode] != run.clock:
            found.append(f"The baseline ran {run.mode} on the {run.clock} clock, the report {clocks[run.mode]}.")
    found += _conditions(base, head, WINDOW)
    if timing and any(run.clock == "real-time" for run in base.runs):
        found += _conditions(base, head, SIMULATION)
        found += _costs(base.identity, head.identity)
    return tuple(found)


def _logs(baseline: Baseline) -> str:
    return ", ".join(f"{name} ({sha256[:8]})" for name, sha256 in sorted(baseline.logs.items()))


def _classes(base: tuple[str, ...], head: tuple[str, ...]) -> str:
    gone, new = [name for name in base if name not in head], [name for name in head if name not in base]
    if not gone and not new:
        return "The classes stand in another order than in the baseline."
    changes = [f"without {', '.join(gone)}"] * bool(gone) + [f"with {', '.join(new)}"] * bool(new)
    return f"The report's classes differ from the baseline's: {' and '.join(changes)}."


def _conditions(base: Baseline, head: Baseline, keys: tuple[str, ...]) -> list[str]:
    changed = [key for key in keys if base.conditions.get(key) != head.conditions.get(key)]
    return [
        f"The baseline ran with {key} = {json.dumps(base.conditions.get(key))}, the report with "
        f"{json.dumps(head.conditions.get(key))}: another experiment."
        for key in changed
    ]


def _costs(base: Identity, head: Identity) -> list[str]:
    advice = "replay with the same --costs file, or gate the offline scores alone with --no-timing"
    if base.costs_sha256 is None or head.costs_sha256 is None:
        return [f"Measured costs are never gated; {advice}."]
    if base.costs_sha256 != head.costs_sha256:
        names = f"{base.costs} ({base.costs_sha256[:8]}) and {head.costs} ({head.costs_sha256[:8]})"
        return [f"The cost profiles differ, {names}; {advice}."]
    return []


def arithmetic_change(base: Identity, head: Identity) -> str:
    """A sentence when the two networks computed in another way; "" when not, or when either was the oracle."""
    if not (base.precision and head.precision) or (base.backend, base.precision) == (head.backend, head.precision):
        return ""
    return f"The report is in {head.precision} by {head.backend}, the baseline in {base.precision} by {base.backend}."


def environment_changes(base: Identity, head: Identity) -> tuple[str, ...]:
    """What differs between the installations: `onnxruntime 1.29.0 -> 1.30.0`."""
    found = []
    for name in sorted({*base.versions, *head.versions}):
        before, after = base.versions.get(name, "none"), head.versions.get(name, "none")
        if before != after:
            found.append(f"{name} {before} -> {after}")
    for name in ("model", "backend", "precision", "costs"):
        before, after = getattr(base, name), getattr(head, name)
        if before != after:
            found.append(f"{name} {before or 'none'} -> {after or 'none'}")
    if base.model == head.model and base.model_sha256 != head.model_sha256:
        found.append(f"model file {(base.model_sha256 or 'none')[:8]} -> {(head.model_sha256 or 'none')[:8]}")
    if base.cpu_features != head.cpu_features:
        found.append(f"CPU features {' '.join(base.cpu_features) or 'none'} -> {' '.join(head.cpu_features) or 'none'}")
    return tuple(found)
