"""The gate: rules over a report and its baseline, and one verdict."""

from stsem.document.schema import Document
from stsem.document.timing import Outcomes
from stsem.errors import NothingMeasuredError
from stsem.gate.baseline import Baseline, BaselineRun, make_baseline
from stsem.gate.comparable import arithmetic_change, environment_changes, obstacles
from stsem.gate.rules import Limits, Rule
from stsem.gate.verdict import Check, GateState, GateVerdict, Mark, exit_code

_UNITS = {"points": "points", "percent": "%", "none": ""}


def gate(report: Document, baseline: Baseline, limits: Limits | None = None) -> GateVerdict:
    """Judge a report. What is missing, or cannot be compared, never passes.

    Args:
        report: the report to be judged.
        baseline: what it is held against.
        limits: what may change; the defaults of `RULES` when None.
    """
    limits = limits or Limits()
    try:
        head = make_baseline(report)
    except NothingMeasuredError:
        reasons = report.state_reasons or ("The report measured nothing.",)
        return _verdict("nothing measured", reasons, (), report, baseline)
    if reasons := obstacles(baseline, head, limits.timing):
        return _verdict("not comparable", reasons, (), report, baseline)
    checks = (*_exact_checks(baseline, head, limits), *_metric_checks(baseline, head, limits))
    broken = tuple(f"{check.mode}: {check.text}." if check.mode else f"{check.text}." for check in checks if check.text)
    return _verdict(_state(checks), broken, checks, report, baseline)


def _state(checks: tuple[Check, ...]) -> GateState:
    marks = {check.mark for check in checks}
    if "worse" in marks:
        return "failed"
    return "nothing measured" if "missing" in marks or not marks - {"new"} else "passed"


def _metric_checks(base: Baseline, head: Baseline, limits: Limits) -> list[Check]:
    runs = {run.mode: run for run in head.runs}
    return [
        check for run in base.runs for rule in limits.active if (check := _check(rule, run, runs[run.mode])) is not None
    ]


def _check(rule: Rule, base_run: BaselineRun, head_run: BaselineRun) -> Check | None:
    base, head = base_run.metrics.get(rule.path), head_run.metrics.get(rule.path)
    if base is None and head is None:
        return None
    change = limit = None
    text = ""
    mark: Mark = "new" if base is None else "missing"
    if base is not None and head is None:
        text = f"{rule.name} is in the baseline, but was not measured"
    if base is not None and head is not None:
        change, limit, text = rule.change(base, head), rule.limit, rule.broken(base, head) or ""
        better = rule.kind != "none" and change > rule.limit
        mark = "worse" if text else "better" if better else "ok"
    return Check(mode=base_run.mode, metric=rule.path, name=rule.name, base=base, head=head, change=_finite(change),
                 limit=limit, unit=_UNITS[rule.kind], mark=mark, text=text)  # fmt: skip


def _finite(change: float | None) -> float | None:
    return None if change is None or abs(change) == float("inf") else change


def _exact_checks(base: Baseline, head: Baseline, limits: Limits) -> list[Check]:
    wanted = limits.exact if limits.exact is not None else base.is_oracle and head.is_oracle
    if not wanted:
        return []
    runs = {run.mode: run for run in head.runs}
    checks = [
        _equal(run.mode, "outcomes", "outcomes", _outcome_change(run.outcomes, runs[run.mode].outcomes))
        for run in base.runs
    ]
    same = base.results_digest == head.results_digest
    text = "" if same else f"the results' digest is {head.results_digest[:8]}, the baseline's {base.results_digest[:8]}"
    return [*checks, _equal("", "results", "results' digest", text)]


def _equal(mode: str, metric: str, name: str, text: str) -> Check:
    return Check(mode=mode, metric=metric, name=name, mark="worse" if text else "ok", text=text)


def _outcome_change(base: Outcomes, head: Outcomes) -> str:
    changed = [
        f"{name} {before} -> {after}"
        for name in type(base).model_fields
        if (before := getattr(base, name)) != (after := getattr(head, name))
    ]
    return f"the outcomes differ: {', '.join(changed)}" if changed else ""


def _verdict(
    state: GateState, reasons: tuple[str, ...], checks: tuple[Check, ...], report: Document, baseline: Baseline
) -> GateVerdict:
    arithmetic = arithmetic_change(baseline.identity, report.identity)
    return GateVerdict(
        state=state,
        exit_code=exit_code(state, report.state == "lossy"),
        headline=" ".join(filter(None, (_headline(state, reasons, checks), arithmetic))),
        reasons=reasons,
        checks=checks,
        environment=environment_changes(baseline.identity, report.identity),
        base_digest=baseline.digest,
        head_digest=report.digest,
        log=", ".join(log.name for log in report.input.logs),
    )


def _headline(state: GateState, reasons: tuple[str, ...], checks: tuple[Check, ...]) -> str:
    if state == "not comparable":
        return f"Not comparable: {reasons[0]}"
    if state == "nothing measured":
        return f"Nothing to judge: {reasons[0]}" if reasons else "Nothing to judge: no gated metric was measured."
    if state == "failed":
        worst = max((check for check in checks if check.mark == "worse"), key=lambda check: check.strain)
        return f"Failed: {worst.mode + ': ' if worst.mode else ''}{worst.text}."
    worst = max(checks, key=lambda check: check.strain)
    if worst.strain == 0:
        return "Passed: nothing got worse."
    return (
        f"Passed: the worst is {worst.mode} {worst.name}, {worst.change:+.2f} {worst.unit} of {worst.limit:g} allowed."
    )
