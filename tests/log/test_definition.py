"""Texts of ROS message definitions: layouts, namesakes, and definitions made to cost memory or time."""

import pytest
from encoders_ros import Ros
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.records import Schema

from stsem.log.schemas import definition
from stsem.log.schemas.definition import MAX_BYTES, check_layout, layout
from stsem.log.schemas.ros import TYPES

RULE = "=" * 80 + "\n"
COMPRESSED = "{header} string i8[]"
HEADER = "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
OWN = "# comment\nint32 K=5\nstring X = a # b\nstd_msgs/Header header # when\nstring format\n\nuint8[] data\n"


def ros1(text: str) -> Schema:
    return Schema(id=1, name="sensor_msgs/CompressedImage", encoding="ros1msg", data=text.encode())


@pytest.mark.parametrize("version", [1, 2])
def test_the_definitions_of_others_have_the_layouts_that_are_built_in(version: int) -> None:
    ros = Ros(version)
    for name, message in TYPES.items():
        package, short = name.split("/")
        text = ros.schema(f"{package}/msg/{short}")
        check_layout(Schema(id=1, name=name, encoding=f"ros{version}msg", data=text), message.layout)


def test_a_layout_is_the_order_of_the_primitive_fields() -> None:
    text = (
        "Inner[] list\nbool[3] flags\nother_pkg/Inner one\nstring<=10 short\nfloat64[<=4] few\nduration d\r\n"
        "uint8 DEFAULT=3\nint16 with_default 4\n" + RULE + "MSG: own_pkg/Inner\nchar a\nuint64 b\n"
    )
    assert layout(text) == "(i8 i64)[] i8[3] i8 i64 string f64[] i32 i32 i16"
    assert layout("") == ""


@pytest.mark.parametrize("spelling", ["Header", "std_msgs/Header", "std_msgs/msg/Header", "roslib/Header"])
def test_a_header_may_be_named_in_every_way(spelling: str) -> None:
    check_layout(ros1(OWN.replace("std_msgs/Header", spelling) + RULE + HEADER), COMPRESSED)


def test_a_namesake_with_other_fields_is_not_read() -> None:
    other = OWN.replace("string format", "uint8 quality\nstring format") + RULE + HEADER
    with pytest.raises(ValueError, match="its layout is 'i32 i32 i32 string i8 string i8\\[\\]', but 'i32 i32 i32 str"):
        check_layout(ros1(other), COMPRESSED)


@pytest.mark.parametrize("language", ["ros2idl", "omgidl", ""])
def test_in_languages_that_are_not_read_the_name_stands_for_the_layout(language: str) -> None:
    check_layout(Schema(id=1, name="a/B", encoding=language, data=b"module a {}"), COMPRESSED)


def test_an_unknown_language_is_said() -> None:
    with pytest.raises(ValueError, match="a schema in 'protobuf' cannot be read, only ros2msg or ros1msg"):
        check_layout(Schema(id=1, name="a/B", encoding="protobuf", data=b"x"), COMPRESSED)


def chain(width: int, depth: int) -> str:
    """Types that each hold the next `width` times."""
    types = [f"MSG: p/T{i}\n" + f"T{i + 1} x\n" * width for i in range(depth)]
    return "T0 x\n" + RULE + RULE.join([*types, f"MSG: p/T{depth}\nuint8 x\n"])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("A x\n" + RULE + "MSG: p/A\nA x\n", "p/A contains itself"),
        ("A x\n" + RULE + "MSG: p/A\nint8 x\nB[] x\n" + RULE + "MSG: p/B\nA x\n", "p/A contains itself"),
        (chain(10, 10), "thousands of fields"),
        (chain(1, 1000), "contains itself"),
        ("uint8 x\n" * 100_000, "thousands of fields"),
        ("Missing x\n", "the type Missing is not defined"),
        ("A x\n" + RULE + "MSG: p/A\n" * 100_000, "its layout is 'empty'"),
        ("x" * 1_000_000, "is no field"),
        ("x" * 500_000 + " " + "y" * 500_000, "is not defined"),
        ("x" * (MAX_BYTES + 1), "more than any message definition"),
        (b"\xff\xfe".decode("latin1"), "is no field"),
    ],
)
def test_a_definition_made_to_cost_is_refused(text: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        check_layout(ros1(text), COMPRESSED)


def test_a_schema_that_many_channels_share_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one that is refused: the number of channels times its size would be hours."""
    asked: list[str] = []

    def counted(text: str) -> str:
        asked.append(text)
        return layout(text)

    monkeypatch.setattr(definition, "layout", counted)
    for text in (OWN + "int8 once\n" + RULE + HEADER, "Once x\n"):
        for _ in range(3):
            with pytest.raises(ValueError, match=r"its layout is|is not defined"):
                check_layout(ros1(text), COMPRESSED)
        assert asked.count(text) == 1


def test_bytes_that_are_no_text_are_refused() -> None:
    with pytest.raises(ValueError, match="utf-8"):
        check_layout(Schema(id=1, name="a/B", encoding="ros1msg", data=b"\xff"), COMPRESSED)


@settings(derandomize=True, max_examples=200, deadline=None)
@given(
    st.lists(st.sampled_from(["MSG: p/A", "A x", "B[] y", "MSG: B", "int8 z", "=" * 80, "#", "C=1", "", "x[", "\0"]))
)
def test_any_text_has_a_layout_or_is_refused(lines: list[str]) -> None:
    try:
        found = layout("\n".join(lines))
    except ValueError:
        return
    assert found.replace("(", "").replace(")", "").replace("[]", "").replace("i8", "").strip() == ""
