"""Class tables in all their forms, and label images translated through them."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.classes import NO_LABEL
from stsem.errors import ClassTableError
from stsem.log.classtable import ClassTable, Translator, find_table, from_names, parse, read_file

NAMES = {0: "wall", 1: "floor", 2: "door"}
RGB = ((10, 20, 30), (40, 50, 60), (255, 0, 1))


@pytest.mark.parametrize(
    "document",
    [
        ["wall", "floor", "door"],
        {"names": ["wall", "floor", "door"], "ignore_id": 255},
        {"names": {"0": "wall", "1": "floor", "2": "door"}},
        {"2": "door", "0": "wall", "1": "floor"},
        {"door": 2, "wall": 0, "floor": 1},
        {"wall": "#0a141e 0", "floor": "#28323c 1", "door": "#ff0001 2"},
        {"wall": "#0a141e", "floor": "#28323c", "door": "#ff0001"},
        {"names": ["wall", "floor", "door"], "colours": [[10, 20, 30], [40, 50, 60], [255, 0, 1]]},
        {"names": ["wall", "floor", "door"], "colors": ["#0a141e", "#28323c", "#ff0001"]},
    ],
)
def test_every_form_is_the_same_table(document: object) -> None:
    table = parse(document, "test")
    assert table.classes.names == ("wall", "floor", "door")
    assert table.raw_ids == (0, 1, 2)
    assert table.classes.colours in ((), RGB)
    assert bool(table.classes.colours) == any(word in json.dumps(document) for word in ("#", "colo"))


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ("wall", "should hold a list of names"),
        ({}, "needs 1 to 255 names, but 0 came"),
        ([], "needs 1 to 255 names"),
        ([1, 2], "a name is not a text"),
        ({"names": 5}, "should hold"),
        ({"wall": "red"}, "should hold"),
        ({"wall": "#0a141e 1", "floor": "#28323c 1"}, "have the same id 1"),
        (["door", "Door"], "are the same name"),
        ({"70000": "far"}, "ids go from 0 to 65535"),
        ({"names": ["a"], "colours": [[1, 2, 300]]}, "is not a colour"),
        (None, "should hold"),
        ({"names": ["a"], "ignore_id": 1e999}, "should hold"),
        ({"names": ["a"], "ignore_id": float("nan")}, "should hold"),
        ({"9" * 5000: "far"}, "should hold"),
        ({"wall": "#0a141e 9999999"}, "ids go from 0 to 65535"),
    ],
)
def test_what_is_no_table_is_refused(document: object, words: str) -> None:
    with pytest.raises(ClassTableError, match=r"The class table test .*") as caught:
        parse(document, "test")
    assert words in str(caught.value)


def test_files(tmp_path: Path) -> None:
    """JSON and TOML; missing and broken ones are named."""
    (tmp_path / "a.json").write_text('["wall", "floor", "door"]')
    (tmp_path / "a.toml").write_text('names = ["wall", "floor", "door"]\nignore_id = 9\n')
    (tmp_path / "b.json").write_text("[")
    (tmp_path / "b.toml").write_text("names = ")
    assert read_file(tmp_path / "a.json").classes == read_file(tmp_path / "a.toml").classes
    assert read_file(tmp_path / "a.toml").ignored == (9,)
    for name, words in {"b.json": "is not JSON", "b.toml": "is not TOML", "c.json": "cannot be read"}.items():
        with pytest.raises(ClassTableError, match=f"{name} {words}"):
            read_file(tmp_path / name)


def test_sources_are_tried_in_order_and_disagreement_is_said(tmp_path: Path) -> None:
    attachment = {"classes.json": json.dumps({"names": ["wall", "floor", "door"], "colours": RGB}).encode()}
    metadata = {"stsem.classes": {"0": "wall", "1": "floor", "2": "door"}}
    table, warnings = find_table(None, NAMES, metadata, attachment)
    assert table is not None
    assert (table.source, warnings) == ("LabelInfo messages", [])
    assert table.classes.colours == RGB  # taken from the attachment, which has the same names
    table, warnings = find_table(None, {0: "sky"}, metadata, attachment)
    assert table is not None
    assert table.classes.names == ("sky",)
    assert table.classes.colours == ()
    assert len(warnings) == 2
    assert "names other classes than the LabelInfo messages" in warnings[0]
    (tmp_path / "own.json").write_text('["tree"]')
    table, warnings = find_table(tmp_path / "own.json", NAMES, metadata, attachment)
    assert table is not None
    assert table.classes.names == ("tree",)
    assert find_table(None, None, {}, {}) == (None, [])


def table_of(names: dict[int, str], ignored: tuple[int, ...] = ()) -> ClassTable:
    return from_names(names, {}, ignored, "test")


@settings(derandomize=True, max_examples=50, deadline=None)
@given(raw_ids=st.sets(st.integers(0, 300), min_size=1, max_size=20), ignored=st.sets(st.integers(0, 300), max_size=3))
def test_ids_are_translated_as_a_dictionary_would(raw_ids: set[int], ignored: set[int]) -> None:
    kept = sorted(raw_ids - ignored - {NO_LABEL})
    if not kept:
        return
    translate = Translator(table_of({i: f"c{i}" for i in raw_ids}, tuple(ignored)))
    own = {raw: position for position, raw in enumerate(kept)}
    for dtype, size in ((np.uint8, 256), (np.uint16, 65536)):
        raw = np.arange(size, dtype=dtype).reshape(16, -1)
        labels, unknown = translate(raw)
        assert labels.dtype == np.uint8
        assert labels.ravel().tolist() == [own.get(i, NO_LABEL) for i in range(size)]
        silent = {i for i in ignored | {NO_LABEL} if i < size} | {i for i in kept if i < size}
        assert unknown == size - len(silent)


def test_colours_are_translated_through_the_palette() -> None:
    table = parse({"wall": "#0a141e 5", "floor": "#28323c 2"}, "test")
    assert table.classes.names == ("floor", "wall")
    raw = np.array([[[10, 20, 30], [40, 50, 60]], [[0, 0, 0], [10, 20, 31]]], np.uint8)
    labels, unknown = Translator(table)(raw)
    assert labels.tolist() == [[1, 0], [255, 255]]
    assert unknown == 2
    with pytest.raises(ValueError, match="labels are colours, but the class table"):
        Translator(table_of(NAMES))(raw)


@pytest.mark.parametrize("count", [254, 255])
@pytest.mark.parametrize("ignored", [(), (7, 999)])
def test_as_many_classes_as_there_can_be(count: int, ignored: tuple[int, ...]) -> None:
    """With 255 classes no id is left to mark the unknown with; they are ignored and counted all the same."""
    translate = Translator(table_of({1000 + i: f"c{i}" for i in range(count)}, ignored))
    labels, unknown = translate(np.array([[1000, 999 + count, 999, 7, 255, 65535]], np.uint16))
    assert labels[0].tolist() == [0, count - 1, 255, 255, 255, 255]
    assert unknown == 3 - len(ignored)


def test_255_classes_of_8_bits() -> None:
    labels, unknown = Translator(table_of({i: f"c{i}" for i in range(255)}))(np.arange(256, dtype=np.uint8)[None])
    assert labels[0].tolist() == list(range(256))
    assert unknown == 0


def test_255_classes_of_colours() -> None:
    document = {f"c{i}": f"#{i:06x} {i}" for i in range(255)}
    labels, unknown = Translator(parse(document, "test"))(np.array([[[0, 0, 254], [0, 0, 255]]], np.uint8))
    assert (labels.tolist(), unknown) == ([[254, 255]], 1)


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8) | st.just("names"), inner, max_size=4)
    ),
    max_leaves=12,
)


@settings(max_examples=200)
@given(document=plain)
def test_any_document_is_a_table_or_a_refusal(document: object) -> None:
    try:
        table = parse(document, "test")
    except ClassTableError as err:
        assert str(err).startswith("The class table test")  # noqa: PT017
        return
    labels, _ = Translator(table)(np.arange(65536, dtype=np.uint16).reshape(256, 256))
    assert labels[0, 255] == NO_LABEL


def test_an_ignored_id_that_16_bits_cannot_hold_stands_for_all_such() -> None:
    for ignored in (-1, -300, 1 << 20):
        translate = Translator(parse({"names": ["a", "b"], "ignore_id": ignored}, "test"))
        assert translate(np.array([[0, 1, 7, 65535]], np.uint16))[1] == 1
        assert translate(np.array([[0, 1, 7, 255]], np.uint8))[1] == 1
