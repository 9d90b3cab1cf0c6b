"""The verdict for a pull request: tables only, no pictures, no HTML."""

from stsem.gate.verdict import Check, GateVerdict

_MARKS = {"ok": "ok", "better": "better", "worse": "**WORSE**", "missing": "**MISSING**", "new": "new, not gated"}


def gate_markdown(verdict: GateVerdict, command: str = "") -> str:
    """The verdict, top to bottom: one line, counts, table, reasons, environment, how to reproduce.

    Args:
        verdict: what the gate decided.
        command: the command that repeats it.
    """
    parts = [f"## stsem gate: {verdict.headline}", _counts(verdict)]
    if verdict.checks:
        parts.append(_table(verdict.checks))
    if verdict.reasons:
        parts.append("\n".join(f"- {reason}" for reason in verdict.reasons))
    parts.append(_environment(verdict))
    if command:
        parts.append(f"Reproduce: `{command}`")
    return "\n\n".join(parts) + "\n"


def _counts(verdict: GateVerdict) -> str:
    log = f"{verdict.log}: " if verdict.log else ""
    if not verdict.checks:
        return f"{log}{verdict.state}, no rule was applied."
    names = {"worse": "worse", "missing": "missing", "better": "better", "ok": "within limits", "new": "new"}
    counts = [f"{n} {name}" for mark, name in names.items() if (n := verdict.count(mark))]  # type: ignore[arg-type]
    return f"{log}{len(verdict.checks)} checks: {', '.join(counts)}."


def _table(checks: tuple[Check, ...]) -> str:
    head = "| mode | metric | base | head | change (+ is better) | allowed | |\n|---|---|--:|--:|--:|--:|---|"
    return "\n".join([head, *(_row(check) for check in checks)])


def _row(check: Check) -> str:
    change = "–" if check.change is None else f"{check.change:+.2f} {check.unit}".strip()
    limit = "equal" if check.metric in ("outcomes", "results") else "–" if check.limit is None else _allowed(check)
    cells = (check.mode or "all", check.name, _value(check, check.base), _value(check, check.head), change, limit)
    return f"| {' | '.join(cells)} | {_MARKS[check.mark]} |"


def _allowed(check: Check) -> str:
    return f"-{check.limit:g} {check.unit}".strip() if check.limit else "0"


def _value(check: Check, value: float | None) -> str:
    if value is None:
        return "–" if check.metric in ("outcomes", "results") else "not measured"
    if check.unit == "points":
        return f"{100 * value:.2f} %"
    if check.metric.startswith("latency_ms"):
        return f"{value:.2f} ms"
    return f"{value:.2f} Hz" if check.metric.endswith("_hz") else f"{value:g}"


def _environment(verdict: GateVerdict) -> str:
    if not verdict.environment:
        return "Environment: the same as the baseline's."
    return f"Environment: {'; '.join(verdict.environment)}."
