"""One document, one sequence of bytes."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_run import example
from pydantic import ValidationError

from stsem.document.accuracy import Score
from stsem.document.canonical import (
    as_json,
    canonical,
    digest,
    document_from,
    read_document,
    results_digest,
    sealed,
    to_bytes,
)
from stsem.document.origin import Host
from stsem.document.schema import Document
from stsem.errors import UsageError


@pytest.fixture(scope="module")
def document() -> Document:
    return example(pictures=False).document


FINITE = st.floats(allow_nan=False, allow_infinity=False)
LEAVES = st.none() | st.booleans() | st.integers() | FINITE | st.text()
VALUES = st.recursive(LEAVES, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=20)


@given(VALUES)
@settings(max_examples=100, derandomize=True, deadline=None)
def test_canonical_reads_back_equal_and_is_stable(value: object) -> None:
    """What is read back is what was written, and writing it again gives the same bytes."""
    data = canonical(value)
    assert json.loads(data) == value
    assert canonical(json.loads(data)) == data


def test_canonical_form() -> None:
    """Keys sorted, shortest floats, NaN as null, no negative zero, UTF-8, numpy welcome."""
    value = {"b": np.float64(0.1), "a": [float("nan"), -0.0, np.int64(3)], "ä": (np.array([1, 2]), True)}
    assert json.loads(canonical(value)) == {"a": [None, 0.0, 3], "b": 0.1, "ä": [[1, 2], True]}
    assert canonical({"x": -0.0, "a": "ä"}).decode() == '{\n  "a": "ä",\n  "x": 0.0\n}\n'


def test_infinity_is_refused() -> None:
    with pytest.raises(ValueError, match="Out of range"):
        canonical({"x": float("inf")})
    with pytest.raises(ValidationError):
        Score(miou=float("inf"))


def test_nan_and_numpy_become_plain() -> None:
    score = Score(
        miou=np.float64("nan"), pixel_accuracy=np.float64(0.5), pixels=np.int64(4), iou={"a": np.float64("nan")}
    )
    assert score.miou is None
    assert score.iou == {"a": None}
    assert type(score.pixels) is int
    assert type(score.pixel_accuracy) is float


def test_digest_is_of_everything_but_host_and_digest(document: Document) -> None:
    """The digest can be recomputed from the file by anybody with sha256 and a JSON library."""
    values = json.loads(to_bytes(document))
    del values["host"], values["digest"]
    text = json.dumps(values, sort_keys=True, indent=2, ensure_ascii=False) + "\n"
    assert hashlib.sha256(text.encode()).hexdigest() == document.digest
    assert sealed(document.model_copy(update={"host": Host(command="other")})).digest == document.digest
    other = document.model_copy(update={"warnings": ()})
    assert digest(other) != document.digest
    assert results_digest(other) == results_digest(document)


def test_one_label_more_or_less_changes_the_digest(document: Document) -> None:
    values = as_json(document)
    values["runs"][1]["keyframes"][-1] += 1  # type: ignore[index, call-overload, operator]
    changed = document_from(values, "here")
    assert digest(changed) != document.digest
    assert results_digest(changed) != results_digest(document)


def test_write_and_read(document: Document, tmp_path: Path) -> None:
    (tmp_path / "report.json").write_bytes(to_bytes(document))
    assert read_document(tmp_path) == document
    assert read_document(tmp_path / "report.json") == document


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"\x89PNG", "it is no JSON"),
        (b"[1, 2]", "it has no schema_version"),
        (b'{"schema_version": 7}', "has schema version 7, this stsem reads 1"),
        (b'{"schema_version": 1, "state": "fine"}', "is not a report of this schema: state"),
    ],
)
def test_what_is_no_report_is_named(content: bytes, sentence: str, tmp_path: Path) -> None:
    file = tmp_path / "report.json"
    file.write_bytes(content)
    with pytest.raises(UsageError, match=sentence):
        read_document(file)


def test_missing_report_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"report\.json cannot be read"):
        read_document(tmp_path)


def test_outcomes_must_sum_to_the_frames(document: Document) -> None:
    """Nothing is lost in silence: a run that loses a frame is no run."""
    values = as_json(document)
    values["runs"][0]["outcomes"]["dropped_busy"] += 1  # type: ignore[index, call-overload, operator]
    with pytest.raises(UsageError, match="the outcomes of per-frame sum to 151, but there are 150 frames"):
        document_from(values, "here")
