"""The judge is tested like a suspect: it must fail exactly when a rule is broken."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_run import example

from stsem.document.canonical import as_json, document_from, sealed
from stsem.document.schema import Document
from stsem.errors import UsageError
from stsem.gate.baseline import make_baseline
from stsem.gate.judge import gate
from stsem.gate.rules import RULES, Limits, Rule

BASE = example(pictures=False).document
MODES = ("per-frame", "keyframe")


def changed(document: Document, changes: dict[str, Any]) -> Document:
    """The document with some dotted paths set anew."""
    values: Any = as_json(document)
    for path, new in changes.items():
        *parents, last = path.split(".")
        place = values
        for key in parents:
            place = place[int(key) if key.isdigit() else key]
        place[int(last) if last.isdigit() else last] = new
    return sealed(document_from(values, "test"))


def oracle(document: Document) -> Document:
    return changed(document, {"identity.model": "oracle", "identity.backend": "oracle", "identity.model_sha256": None})


def value(document: Document, run: int, path: str) -> float:
    found: Any = as_json(document)["runs"][run]  # type: ignore[index, call-overload]
    for key in path.split("."):
        found = found[key]
    return float(found)


def test_a_report_passes_against_itself() -> None:
    verdict = gate(BASE, make_baseline(BASE))
    assert (verdict.state, verdict.exit_code) == ("passed", 0)
    assert verdict.headline == "Passed: nothing got worse."
    assert {check.mark for check in verdict.checks} == {"ok"}


def breaks(rule: Rule, base: float, head: float) -> bool:
    """The rule in words of this test: worse by more than its limit, with exact arithmetic left a hair of slack."""
    worse = base - head if rule.higher_is_better else head - base
    allowed = {"points": rule.limit / 100, "percent": rule.limit / 100 * base, "none": 0.0}[rule.kind]
    return worse > allowed + 1e-8 * max(1.0, abs(base))


@given(
    run=st.sampled_from((0, 1)),
    rule=st.sampled_from(RULES),
    factor=st.floats(0.8, 1.2),
)
@settings(max_examples=150, derandomize=True, deadline=None)
def test_the_gate_fails_exactly_when_a_rule_is_broken(run: int, rule: Rule, factor: float) -> None:
    """One metric is changed by a random factor; the verdict is that metric's rule, and nothing else."""
    if run == 0 and rule.path.endswith("p95"):
        return  # too few distinct samples: the baseline has none
    base = value(BASE, run, rule.path)
    head = base * factor if rule.kind != "none" else float(round(base * factor))
    head = min(head, 1.0) if rule.kind == "points" else head
    verdict = gate(changed(BASE, {f"runs.{run}.{rule.path}": head}), make_baseline(BASE))
    broken = breaks(rule, base, head)
    assert (verdict.state, verdict.exit_code) == (("failed", 4) if broken else ("passed", 0))
    worse = [(check.mode, check.metric) for check in verdict.checks if check.mark == "worse"]
    assert worse == ([(MODES[run], rule.path)] if broken else [])


def test_a_planted_regression_is_seen_and_named() -> None:
    """0.6 points of streaming mIoU are too much, 0.4 are not."""
    miou = value(BASE, 1, "streaming.miou")
    verdict = gate(changed(BASE, {"runs.1.streaming.miou": miou - 0.006}), make_baseline(BASE))
    assert verdict.headline == "Failed: keyframe: streaming mIoU fell by 0.60 points; 0.5 points is allowed."
    assert gate(changed(BASE, {"runs.1.streaming.miou": miou - 0.004}), make_baseline(BASE)).exit_code == 0


def test_exactly_the_limit_passes() -> None:
    miou = value(BASE, 0, "offline.miou")
    assert gate(changed(BASE, {"runs.0.offline.miou": miou - 0.005}), make_baseline(BASE)).exit_code == 0


def test_limits_can_be_set_for_one_metric() -> None:
    worse = changed(BASE, {"runs.1.offline.miou": value(BASE, 1, "offline.miou") - 0.02})
    assert gate(worse, make_baseline(BASE)).exit_code == 4
    assert gate(worse, make_baseline(BASE), Limits().with_limits({"offline.miou": 2.5})).exit_code == 0


@pytest.mark.parametrize(
    ("limits", "sentence"),
    [({"offline.moiu": 1.0}, "the nearest is 'offline.miou'"), ({"offline.miou": -1.0}, "of at least 0"),
     ({"offline.miou": float("nan")}, "of at least 0")],
)  # fmt: skip
def test_wrong_limits_are_named(limits: dict[str, float], sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        Limits().with_limits(limits)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"input.logs.0.sha256": "00" * 32}, "not the same log"),
        ({"input.classes": ["wall", "floor"]}, "classes differ"),
        ({"runs.1.mode": "keyframe-async"}, "has the mode keyframe, the report only per-frame, keyframe-async"),
        ({"runs.0.clock": "offline"}, "the real-time clock, the report offline"),
        ({"identity.costs_sha256": "00" * 32}, "The cost profiles differ"),
        ({"identity.costs_sha256": None}, "Measured costs are never gated"),
        ({"config.end": 5.0}, "ran with end = null, the report with 5.0: another experiment"),
        ({"config.queue": "lossless"}, 'ran with queue = "latest", the report with "lossless"'),
    ],
)
def test_what_is_not_comparable_never_passes(changes: dict[str, Any], sentence: str) -> None:
    verdict = gate(changed(BASE, changes), make_baseline(BASE))
    assert (verdict.state, verdict.exit_code) == ("not comparable", 5)
    assert sentence in verdict.headline
    assert verdict.checks == ()


def test_other_classes_order_and_schema_are_not_comparable() -> None:
    classes = list(reversed(BASE.input.classes))
    assert "another order" in gate(changed(BASE, {"input.classes": classes}), make_baseline(BASE)).headline
    older = make_baseline(BASE).model_copy(update={"schema_version": 0})
    assert "report schema 0" in gate(BASE, older).headline


def test_other_costs_are_comparable_offline() -> None:
    """Without timing, only the offline scores are judged, and the profile may differ."""
    other = changed(BASE, {"identity.costs_sha256": "00" * 32, "runs.1.streaming.miou": 0.1})
    verdict = gate(other, make_baseline(BASE), Limits(timing=False))
    assert verdict.exit_code == 0
    assert {check.metric.split(".")[0] for check in verdict.checks} == {"offline", "coverage"}


def test_thresholds_may_differ_and_without_timing_the_simulation_too() -> None:
    """A gate is for changes: of the model, of thresholds, of code."""
    assert gate(changed(BASE, {"config.keyframes": "every:3"}), make_baseline(BASE)).exit_code == 0
    assert gate(changed(BASE, {"config.rate": "2"}), make_baseline(BASE), Limits(timing=False)).exit_code == 0
    assert gate(changed(BASE, {"config.end": 3.0}), make_baseline(BASE), Limits(timing=False)).exit_code == 5


def test_a_metric_that_is_gone_fails_closed() -> None:
    verdict = gate(changed(BASE, {"runs.1.streaming": None}), make_baseline(BASE))
    assert (verdict.state, verdict.exit_code) == ("nothing measured", 5)
    assert "streaming mIoU is in the baseline, but was not measured" in verdict.headline


def test_a_broken_rule_wins_over_a_missing_metric() -> None:
    verdict = gate(changed(BASE, {"runs.1.streaming": None, "runs.1.offline.miou": 0.1}), make_baseline(BASE))
    assert verdict.exit_code == 4


def test_nothing_measured_never_passes() -> None:
    assert gate(changed(BASE, {"state": "invalid"}), make_baseline(BASE)).exit_code == 5
    baseline = make_baseline(BASE)
    empty = baseline.model_copy(update={"runs": tuple(run.model_copy(update={"metrics": {}}) for run in baseline.runs)})
    bare = changed(BASE, {f"runs.{i}.{part}": None for i in (0, 1)
                          for part in ("offline", "delivered", "streaming", "latency_ms", "throughput")})  # fmt: skip
    assert gate(bare, empty).exit_code == 5


def test_a_new_metric_is_shown_but_not_gated() -> None:
    verdict = gate(BASE, make_baseline(changed(BASE, {"runs.1.delivered": None})))
    assert verdict.exit_code == 0
    assert [check.metric for check in verdict.checks if check.mark == "new"] == [
        "delivered.miou", "delivered.pixel_accuracy",
    ]  # fmt: skip


def test_a_lossy_input_that_passes_exits_3() -> None:
    lossy = example(pictures=False, lossy=True).document
    assert gate(lossy, make_baseline(lossy)).exit_code == 3


def test_the_oracle_must_repeat_exactly() -> None:
    """With the truth as network every result is exact: one keyframe elsewhere fails, any network's would not."""
    elsewhere = {"runs.1.keyframes.3": as_json(BASE)["runs"][1]["keyframes"][3] + 1}  # type: ignore[index, call-overload, operator]
    assert gate(changed(BASE, elsewhere), make_baseline(BASE)).exit_code == 0
    verdict = gate(oracle(changed(BASE, elsewhere)), make_baseline(oracle(BASE)))
    assert verdict.exit_code == 4
    assert "the results' digest is" in verdict.headline
    assert gate(oracle(BASE), make_baseline(oracle(BASE))).exit_code == 0


def leaves(value: Any, path: str) -> list[str]:
    """Paths of all numbers inside a JSON value."""
    if isinstance(value, dict):
        return [leaf for key, item in value.items() for leaf in leaves(item, f"{path}.{key}")]
    if isinstance(value, list):
        return [leaf for i, item in enumerate(value) for leaf in leaves(item, f"{path}.{i}")]
    return [path] if isinstance(value, int | float) and not isinstance(value, bool) else []


NUMBERS = [leaf for leaf in leaves(as_json(BASE)["runs"], "runs") if ".outcomes." not in leaf and leaf[7:] != "frames"]


@given(st.sampled_from(NUMBERS))
@settings(max_examples=60, derandomize=True, deadline=None)
def test_no_number_of_an_oracle_run_can_change_unseen(path: str) -> None:
    """One label, one latency, one keyframe: the smallest change of any number fails the gate."""
    values: Any = as_json(BASE)
    for key in path.split("."):
        values = values[int(key) if key.isdigit() else key]
    new = values + 1 if isinstance(values, int) else values * 0.999999 if values else 1e-9
    verdict = gate(oracle(changed(BASE, {path: new})), make_baseline(oracle(BASE)))
    assert verdict.exit_code == 4


def test_the_oracles_outcomes_are_named() -> None:
    outcomes = {"runs.1.outcomes.dropped_busy": 2, "runs.1.outcomes.propagated": 124}
    verdict = gate(oracle(changed(BASE, outcomes)), make_baseline(oracle(BASE)))
    assert "the outcomes differ: propagated 123 -> 124, dropped_busy 3 -> 2" in " ".join(verdict.reasons)


def test_other_versions_alone_do_not_fail_the_oracle() -> None:
    """A digest contains versions; what is compared across installations is the results' digest."""
    other = changed(oracle(BASE), {"identity.versions.python": "3.12.1", "config.seed": 0, "warnings": []})
    assert other.digest != oracle(BASE).digest
    verdict = gate(other, make_baseline(oracle(BASE)))
    assert verdict.exit_code == 0
    assert verdict.environment == ("python 3.11.2 -> 3.12.1",)


def test_improvements_are_marked() -> None:
    verdict = gate(changed(BASE, {"runs.0.offline.miou": 0.99}), make_baseline(BASE))
    assert [check.mark for check in verdict.checks].count("better") == 1
