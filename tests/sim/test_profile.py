"""Cost profiles: what a file may say, and that equal profiles are equal bytes."""

import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.errors import CostError, OutputError
from stsem.sim.profile import CostProfile, json_schema, load_profile, parse_profile

PUBLISHED = Path(__file__).resolve().parents[2] / "docs" / "cost-profile.schema.json"
PROFILE = CostProfile("a laptop", {"segment@2": (30, 10, 20), "register@1": (5,)}, made_for={"image": "480x270"})


def test_a_profile_comes_back_from_its_file(tmp_path: Path) -> None:
    PROFILE.save(tmp_path / "costs.json")
    loaded = load_profile(tmp_path / "costs.json")
    assert loaded == PROFILE
    assert loaded.samples("segment", 2) == (10, 20, 30)
    assert loaded.made_for == {"image": "480x270"}


def test_neither_layout_nor_order_changes_the_digest() -> None:
    document = json.loads(PROFILE.to_bytes())
    document["samples_ns"] = {"register@1": [5], "segment@2": [20, 30, 10]}
    assert parse_profile(json.dumps(document, indent=7).encode(), "x").sha256 == PROFILE.sha256
    document["samples_ns"]["segment@2"] = [20, 30, 11]
    assert parse_profile(json.dumps(document).encode(), "x").sha256 != PROFILE.sha256


def test_the_disturbed_mark_survives_and_counts() -> None:
    disturbed = CostProfile(PROFILE.machine, PROFILE.samples_ns, disturbed=True, made_for=PROFILE.made_for)
    assert parse_profile(disturbed.to_bytes(), "x").disturbed
    assert disturbed.sha256 != PROFILE.sha256


def test_a_missing_stage_is_named_with_what_there_is_and_the_cure() -> None:
    with pytest.raises(CostError, match=r"no 'segment@1', only register@1, segment@2; measure it with `stsem costs"):
        PROFILE.samples("segment", 1)


def change(**changes: Any) -> Callable[[dict[str, Any]], dict[str, Any]]:
    return lambda document: {**document, **changes}


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda _: [1], "found 'list'"),
        (change(schema="stsem-costs/9"), "found 'stsem-costs/9'"),
        (change(sampels_ns={}), "'sampels_ns' is none of"),
        (change(machine=None), "'machine' must be a text"),
        (change(disturbed=1), "'disturbed' true or false"),
        (change(made_for={"image": 3}), "'made_for' must map"),
        (change(samples_ns={}), "samples of at least one stage"),
        (change(samples_ns={"segment@2": 3}), "to lists of nanoseconds"),
        (change(samples_ns={"segment@2": []}), "at least 1 ns, and at least one"),
        (change(samples_ns={"segment@2": [1.5]}), "at least 1 ns"),
        (change(samples_ns={"segment@2": [True]}), "at least 1 ns"),
        (change(samples_ns={"segment@2": [0]}), "at least 1 ns"),
        (change(samples_ns={"segment": [1]}), "'segment' is not of the form stage@cores"),
        (change(samples_ns={"segment@02": [1]}), "'segment@02' is not of the form"),
    ],
)
def test_what_is_not_a_profile_is_refused_in_one_sentence(
    spoil: Callable[[dict[str, Any]], Any], sentence: str
) -> None:
    data = json.dumps(spoil(json.loads(PROFILE.to_bytes()))).encode()
    with pytest.raises(CostError) as caught:
        parse_profile(data, "costs.json")
    assert sentence in str(caught.value)
    assert str(caught.value).startswith("costs.json")


@settings(max_examples=100, derandomize=True)
@given(st.binary(max_size=40) | st.integers(0, 200).map(lambda cut: PROFILE.to_bytes()[:cut]))
def test_no_bytes_cause_anything_but_a_cost_error(data: bytes) -> None:
    if data.strip() == PROFILE.to_bytes().strip():
        return
    with pytest.raises(CostError):
        parse_profile(data, "x")


def test_files_that_cannot_be_read_or_written_are_named(tmp_path: Path) -> None:
    with pytest.raises(CostError, match=r"none\.json cannot be read: No such file"):
        load_profile(tmp_path / "none.json")
    with pytest.raises(OutputError, match="cannot be written"):
        PROFILE.save(tmp_path / "none" / "costs.json")


def test_scaling_takes_the_longer_name_and_rounds_half_to_even() -> None:
    profile = CostProfile("m", {"segment@1": (3, 5), "segment@2": (10,), "fuse@1": (7,)})
    scaled = profile.scaled({"segment": Fraction(1, 2), "segment@2": Fraction(3)}, default=Fraction("0.01"))
    assert scaled.samples_ns == {"fuse@1": (1,), "segment@1": (2, 2), "segment@2": (30,)}


@pytest.mark.parametrize(
    ("factors", "default", "sentence"),
    [
        ({"segmnt": Fraction(2)}, Fraction(1), "no stage 'segmnt' to scale, only register@1, segment@2"),
        ({"segment": Fraction(0)}, Fraction(1), "more than 0"),
        ({}, Fraction(-1), "every other stage"),
    ],
)
def test_scaling_refuses_what_makes_no_sense(factors: dict[str, Fraction], default: Fraction, sentence: str) -> None:
    with pytest.raises(CostError, match=sentence):
        PROFILE.scaled(factors, default)


def test_percentiles_are_bounded_by_the_distinct_samples_of_the_slowest_stage() -> None:
    profile = CostProfile("m", {"segment@2": (9, 9, 8), "register@1": (1, 2, 3, 4)})
    assert profile.distinct_samples_of_slowest(["register@1", "segment@2"]) == 2
    assert profile.distinct_samples_of_slowest(["register@1"]) == 4
    assert profile.distinct_samples_of_slowest(["fuse@1"]) == 0


def test_the_published_schema_is_the_one_in_the_code() -> None:
    assert json.loads(PUBLISHED.read_text()) == json_schema()
