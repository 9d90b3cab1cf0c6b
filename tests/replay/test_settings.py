"""Where a configuration comes from, and what it says about itself."""

from collections.abc import Callable
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stsem.document.canonical import canonical
from stsem.errors import UsageError
from stsem.replay.config import RunConfig
from stsem.replay.settings import keys, nearest, parse_topics, resolve, validated


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_precedence(tmp_path: Path) -> None:
    """Defaults < file < environment < --set < flags, key by key."""
    (tmp_path / "stsem.toml").write_text("seed = 1\ncores = 1\nqueue = 'fifo:1'\nrate = '1/2'\n")
    found = resolve(
        {"seed": 4, "mode": None},
        environment={"STSEM_SEED": "2", "STSEM_CORES": "2", "STSEM_QUEUE": "fifo:2", "HOME": "/", "STSEM_CACHE": "x"},
        assignments=["seed=3", "cores=3"],
    )
    assert (found.seed, found.cores, found.queue, found.rate, found.mode) == (
        4,
        3,
        "fifo:2",
        "1/2",
        "per-frame,keyframe",
    )


def test_a_named_file_replaces_the_default_one(tmp_path: Path) -> None:
    """stsem.toml of the current folder is not read when another is given."""
    (tmp_path / "stsem.toml").write_text("seed = 1\nqueue = 'lossless'\n")
    (tmp_path / "other.toml").write_text("seed = 2\n")
    found = resolve({}, file=tmp_path / "other.toml")
    assert (found.seed, found.queue) == (2, "latest")


def test_tables_are_joined(tmp_path: Path) -> None:
    """One source may name the colour topic and the next the depth topic."""
    (tmp_path / "stsem.toml").write_text("[topic]\ncolor = '/a'\ndepth = '/b'\n")
    found = resolve({"topic": {"pose": "/d"}}, assignments=["topic.depth=/c", "topic.labels=/e"])
    assert found.topic == {"color": "/a", "depth": "/c", "labels": "/e", "pose": "/d"}


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("rate=0.5", "rate", "1/2"),
        ("rate=3/2", "rate", "3/2"),
        ("rate=2", "rate", "2"),
        ("map=off", "map", False),
        ("map=true", "map", True),
        ("offline=no", "offline", False),
        ("mode=both", "mode", "per-frame,keyframe"),
        ("keyframe_time_s=2", "keyframe_time_s", 2.0),
        ('model="my net.onnx"', "model", "my net.onnx"),
        ("model=my net.onnx", "model", "my net.onnx"),
        ("model=a=b.onnx", "model", "a=b.onnx"),
    ],
)
def test_assignments(text: str, key: str, value: object) -> None:
    """TOML spelling where the key wants it, bare text elsewhere."""
    assert getattr(resolve({}, assignments=[text]), key) == value


def test_every_key_has_its_neighbour() -> None:
    """Leave out one letter of any key, and that key is named."""
    for key in keys():
        if len(key) > 4:
            with pytest.raises(UsageError, match=f"did you mean '{key}'"):
                resolve({}, assignments=[f"{key[:2]}{key[3:]}=1"])
    assert "the valid ones are a, b" in nearest("zzz", ["b", "a"])


def refusal(ask: Callable[[], object]) -> str:
    """The sentence with which something is refused, "" if it is not; any other exception goes through."""
    try:
        ask()
    except UsageError as err:
        return str(err)
    return ""


@given(text=st.text(max_size=30))
def test_any_assignment_is_taken_or_refused_in_one_sentence(text: str) -> None:
    """No other exception, whatever is typed."""
    for key in ("seed", "rate", "topic.color", "mode", "map", "keyframe_time_s", "json"):
        assert "\n" not in refusal(partial(resolve, {}, assignments=[f"{key}={text}"]))


@given(text=st.text(max_size=20))
def test_any_flag_value_is_taken_or_refused(text: str) -> None:
    """Of the texts that have a grammar."""
    for key in ("rate", "queue", "keyframes", "mode", "propagation", "clock", "backend"):
        assert "\n" not in refusal(partial(validated, {key: text}))


@given(numerator=st.integers(1, 10**6), denominator=st.integers(1, 10**6))
def test_the_rate_is_exact(numerator: int, denominator: int) -> None:
    """A ratio stays that ratio; a decimal is the decimal, not the nearest binary fraction."""
    ratio = Fraction(numerator, denominator)
    if Fraction(1, 1000) <= ratio <= 1000:
        assert validated({"rate": f"{numerator}/{denominator}"}).exact_rate == ratio
    assert validated({"rate": "0.1"}).exact_rate == Fraction(1, 10)


def test_topics() -> None:
    """role=topic, each role once, the last one winning."""
    assert parse_topics(["color=/a", "depth=/b=c", "color=/d"]) == {"color": "/d", "depth": "/b=c"}
    for text in ("color", "=x", "color=", "gt=/x"):
        with pytest.raises(UsageError):
            parse_topics([text])


def base(**changes: Any) -> RunConfig:
    return validated(changes)


def test_what_is_reported() -> None:
    """Nothing about places and display; files by name; everything that moves a result."""
    found = base(model="/somewhere/else/net.onnx", costs="/there/robot.json", out="/tmp/x", repeat=3, json=True)
    reported = found.reported()
    assert (reported["model"], reported["costs"]) == ("net.onnx", "file")
    assert not {"out", "repeat", "json", "json_", "plots", "cache", "annotate", "classes", "class_map"} & set(reported)
    assert "/somewhere" not in str(reported)
    assert base(out="/a", repeat=2, plots=False, cache=False).reported() == base().reported()
    changes: list[dict[str, Any]] = [
        {"seed": 1}, {"rate": "2"}, {"mode": "keyframe"}, {"queue": "lossless"}, {"cores": 1}, {"map": False},
        {"topic": {"color": "/a"}}, {"start": 1.0}, {"keyframe_rotation": 0.2}, {"offline": False}, {"model": "oracle"},
    ]  # fmt: skip
    assert len({canonical(base(**change).reported()) for change in [{}, *changes]}) == len(changes) + 1


def test_equal_spellings_are_one_configuration() -> None:
    """`both` is both modes in any order, 0.5 is 1/2."""
    assert base(mode="both").reported() == base(mode="keyframe, per-frame").reported() == base().reported()
    assert base(rate="0.5").reported() == base(rate="1/2").reported() == base(rate=0.5).reported()
