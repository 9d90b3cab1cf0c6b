"""A baseline is small, canonical, and says so when it is none."""

import json
from pathlib import Path

import pytest
from made_up_run import example

from stsem.document.canonical import to_bytes
from stsem.errors import NothingMeasuredError, UsageError
from stsem.gate.baseline import baseline_bytes, make_baseline, read_baseline
from stsem.gate.judge import gate
from stsem.gate.markdown import gate_markdown
from stsem.gate.rules import RULES

BASE = example(pictures=False).document


def test_baseline_reads_back_and_is_small(tmp_path: Path) -> None:
    file = tmp_path / "office.json"
    file.write_bytes(baseline_bytes(make_baseline(BASE)))
    assert read_baseline(file) == make_baseline(BASE)
    assert len(file.read_bytes()) < 8000


def test_a_report_serves_as_baseline(tmp_path: Path) -> None:
    file = tmp_path / "report.json"
    file.write_bytes(to_bytes(BASE))
    assert read_baseline(file) == make_baseline(BASE)
    assert read_baseline(tmp_path) == make_baseline(BASE)


def test_no_baseline_is_nothing_measured(tmp_path: Path) -> None:
    """A cold start exits 5, it does not pass."""
    with pytest.raises(NothingMeasuredError, match="There is no baseline"):
        read_baseline(tmp_path / "none.json")
    with pytest.raises(NothingMeasuredError, match="There is no baseline"):
        read_baseline(tmp_path)
    with pytest.raises(NothingMeasuredError, match="cannot be a baseline"):
        make_baseline(BASE.model_copy(update={"state": "invalid"}))


@pytest.mark.parametrize(
    ("content", "sentence"),
    [("{", "it is no JSON"), ("[]", "is not a report"), ('{"baseline_version": 2}', "not a baseline of this version")],
)
def test_what_is_no_baseline_is_named(content: str, sentence: str, tmp_path: Path) -> None:
    file = tmp_path / "x.json"
    file.write_text(content)
    with pytest.raises(UsageError, match=sentence):
        read_baseline(file)


def test_markdown_of_a_failure_reads_top_to_bottom() -> None:
    """One-line verdict, counts, table, reasons, environment, command."""
    values = json.loads(to_bytes(BASE))
    values["runs"][1]["streaming"]["miou"] -= 0.05
    values["identity"]["versions"]["onnxruntime"] = "1.31.0"
    text = gate_markdown(gate(type(BASE).model_validate(values), make_baseline(BASE)), "stsem gate r --baseline b")
    lines = text.splitlines()
    assert lines[0] == "## stsem gate: Failed: keyframe: streaming mIoU fell by 5.00 points; 0.5 points is allowed."
    assert lines[2] == "office.mcap: 19 checks: 1 worse, 18 within limits."
    assert "| keyframe | streaming mIoU | 70.43 % | 65.43 % | -5.00 points | -0.5 points | **WORSE** |" in lines
    assert "- keyframe: streaming mIoU fell by 5.00 points; 0.5 points is allowed." in lines
    assert "Environment: onnxruntime 1.30.0 -> 1.31.0." in lines
    assert lines[-1] == "Reproduce: `stsem gate r --baseline b`"
    assert "<" not in text


def test_markdown_without_checks() -> None:
    verdict = gate(BASE, make_baseline(BASE).model_copy(update={"classes": ("wall",)}))
    text = gate_markdown(verdict)
    assert text.startswith("## stsem gate: Not comparable: ")
    assert "no rule was applied" in text
    assert "|" not in text


def test_every_gated_number_is_kept_and_found() -> None:
    """A rule whose path a baseline lacks, or that leads nowhere in a run, would be a gate that never closes."""
    run = next(run for run in make_baseline(BASE).runs if run.mode == "keyframe")
    gated = {rule.path for rule in RULES}
    assert gated
    assert gated < set(run.metrics)
    assert [path for path, value in run.metrics.items() if value is None] == []
