"""Two replays that differ are told apart by field, frame and byte."""

import json
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_run import example

from stsem.document.canonical import as_json, canonical, to_bytes
from stsem.document.difference import (
    first_byte,
    first_differences,
    first_field,
    first_frame,
    first_report_field,
    repeatable_files,
)

CSV = b"mode,frame,outcome,answered_ns\nkeyframe,0,segmented,10\nkeyframe,1,propagated,20\n"


def test_equal_things_have_no_difference() -> None:
    data = to_bytes(example(pictures=False).document)
    assert first_report_field(data, data) is None
    assert first_frame(CSV, CSV) is None
    assert first_byte(CSV, CSV) is None
    assert first_differences({"report.json": data, "frames.csv": CSV}, {"report.json": data, "frames.csv": CSV}) == ()


def test_the_first_field_is_named_by_its_path() -> None:
    document = example(pictures=False).document
    values = as_json(document)
    values["runs"][1]["offline"]["miou"] = 0.25  # type: ignore[index, call-overload]
    values["digest"], values["host"] = "other", {}
    found = first_report_field(to_bytes(document), canonical(values))
    assert found is not None
    assert found.where == "runs[1].offline.miou"
    assert found.second == "0.25"


def test_missing_and_longer_things_differ() -> None:
    assert str(first_field({"a": [1]}, {"a": [1, 2]})) == "a[1]: nothing against 2"
    assert str(first_field({"a": 1}, {})) == "a: 1 against nothing"
    assert str(first_field(1, 1.0)) == "the whole: 1 against 1.0"
    assert str(first_field({"a": True}, {"a": 1})) == "a: true against 1"


def test_the_first_frame_and_column_are_named() -> None:
    found = first_frame(CSV, CSV.replace(b"20", b"21"))
    assert str(found) == "keyframe, frame 1, answered_ns: 20 against 21"
    assert str(first_frame(CSV, CSV[: CSV.rindex(b"keyframe")])).endswith("against nothing")
    assert "header" in str(first_frame(CSV, CSV.replace(b"frame,", b"index,")))


def test_files_are_compared_each_in_its_own_way() -> None:
    a = {"frames.csv": CSV, "map.ply": b"ply\x00", "trace.json": b"{}"}
    b = {"frames.csv": CSV.replace(b"10", b"11"), "map.ply": b"ply\x01", "plots/x.png": b"x"}
    assert [str(found) for found in first_differences(a, b)] == [
        "frames.csv: keyframe, frame 0, answered_ns: 10 against 11",
        "map.ply: byte 3: 0x00 against 0x01",
        "trace.json: there against missing",
        "plots/x.png: missing against there",
    ]


def test_repeatable_files_leave_the_views_out(tmp_path: Path) -> None:
    (tmp_path / "plots").mkdir()
    for name in ("report.json", "frames.csv", "report.html", "report.md", "plots/a.png"):
        (tmp_path / name).write_bytes(b"x")
    assert list(repeatable_files(tmp_path)) == ["report.json", "frames.csv", "plots/a.png"]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=2), inner, max_size=3),
)


@given(JSON, JSON)
@settings(max_examples=200, derandomize=True, deadline=None)
def test_a_difference_is_found_exactly_when_there_is_one(a: object, b: object) -> None:
    same = json.dumps(a, sort_keys=True) == json.dumps(b, sort_keys=True)
    assert (first_field(a, b) is None) == same
