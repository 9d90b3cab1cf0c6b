"""The gate through the command line, on a log that ships: it passes what is the same and sees a planted regression."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from stsem.cli.main import app

ROOT = Path(__file__).resolve().parents[2]
LOG = ROOT / "logs" / "tiny-a.mcap"
COSTS = {
    "schema": "stsem-costs/1", "machine": "made up", "disturbed": False, "made_for": {},
    "samples_ns": {"segment@2": [60_000_000, 70_000_000], "register@1": [6_000_000], "propagate@1": [1_000_000],
                   "fuse@1": [4_000_000]},
}  # fmt: skip


def _stsem(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Reports of the oracle with the interval that is the baseline, the same again, and a longer one."""
    folder = tmp_path_factory.mktemp("gate")
    costs = folder / "costs.json"
    costs.write_text(json.dumps(COSTS))
    reports = {}
    for name, interval in (("base", 3), ("same", 3), ("worse", 6)):
        reports[name] = folder / name
        code, output = _stsem(
            "replay", LOG, "--model", "oracle", "--keyframes", f"every:{interval}", "--propagation", "hold", "--costs",
            costs, "--no-plots", "--out", reports[name],
        )  # fmt: skip
        assert code == 0, output
    code, output = _stsem("gate", reports["base"], "--write-baseline", folder / "baseline.json")
    assert code == 0, output
    return {**reports, "baseline": folder / "baseline.json", "folder": folder}


def test_the_same_passes(replayed: dict[str, Path]) -> None:
    """Nothing changed: exit code 0."""
    code, output = _stsem("gate", replayed["same"], "--baseline", replayed["baseline"])
    assert code == 0, output


def test_a_planted_regression_fails(replayed: dict[str, Path]) -> None:
    """Twice the distance between keyframes: exit code 4, and the verdict names the score that fell."""
    verdict = replayed["folder"] / "verdict.md"
    code, output = _stsem("gate", replayed["worse"], "--baseline", replayed["baseline"], "--no-exact", "--out", verdict)
    assert code == 4, output
    assert "keyframe" in output
    assert "offline mIoU fell by" in verdict.read_text()


def test_another_log_is_not_comparable(replayed: dict[str, Path]) -> None:
    """A report of another log: exit code 5."""
    other = replayed["folder"] / "other"
    code, output = _stsem(
        "replay", LOG.with_name("tiny-b.mcap"), "--model", "oracle", "--clock", "offline", "--no-plots", "--out", other
    )
    assert code == 0, output
    code, output = _stsem("gate", other, "--baseline", replayed["baseline"])
    assert code == 5, output
