"""The closing table says what was measured, and in words what was not."""

import pytest
from made_up_comparison import with_third_mode
from made_up_run import example

from stsem.report.terminal import closing_table


def test_closing_table_is_short_and_complete() -> None:
    lines = closing_table(example(pictures=False).document).splitlines()
    assert max(len(line) for line in lines[:-1]) <= 100
    words = {line.split("  ")[0]: line.split() for line in lines}
    assert words["mIoU streaming, %"][3:] == ["59.9", "70.4", "+10.6", "[+9.4,", "+12.1]"]
    assert words["latency p95, ms"][3:] == ["n", "too", "small", "187.1"]
    assert words["frames dropped"][2:] == ["62", "3"]
    assert words["keyframes"][1:] == ["88", "24"]
    assert lines[-1].startswith("Accuracy over 150 of 150 frames (150 with truth), 11 classes averaged.")


def test_each_further_mode_has_its_own_difference() -> None:
    """Of three modes, no column of differences leaves open whose they are."""
    lines = closing_table(with_third_mode(example(pictures=False).document)).splitlines()
    assert [line.split() for line in lines[:3]] == [
        ["per-frame", "keyframe", "keyframe-async", "keyframe", "keyframe-async"],
        ["−", "per-frame", "−", "per-frame"], ["[95", "%", "interval]", "[95", "%", "interval]"],
    ]  # fmt: skip
    (rate,) = (line.split()[-5:] for line in lines if line.startswith("output rate"))
    assert (float(rate[3]), float(rate[4])) == pytest.approx(
        (float(rate[1]) - float(rate[0]), float(rate[2]) - float(rate[0])), abs=0.011
    )
    assert rate[3] != rate[4]


def test_without_truth_it_says_so() -> None:
    table = closing_table(example(pictures=False, truth=False).document)
    assert "Accuracy was not measured: the log has no channel with labels." in table
    assert table.count("not measured") == 3 * 2 + 1
    assert "nan" not in table.lower()


def test_offline_has_no_latency() -> None:
    assert "Offline: no clock, so no latency." in closing_table(example(pictures=False, clock=False).document)
