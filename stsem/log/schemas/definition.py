"""The text of a ROS message definition, turned into the order of its numbers and strings: its layout.

Readers of messages have the standard layouts built in. The text in the file serves to notice a namesake that is laid
out in another way; nothing is ever generated from it.
"""

import re
from functools import lru_cache

from mcap.records import Schema

MAX_BYTES = 1 << 20
MAX_LAYOUT = 2000
MAX_DEPTH = 20
TRUSTED = ("", "ros2idl", "omgidl")
"""Languages that are not read: the name of the type stands for its standard layout."""

HEADER = {"ros2msg": "i32 i32 string", "ros1msg": "i32 i32 i32 string"}
TIME = "i32 i32"
PRIMITIVES = {
    **dict.fromkeys(("bool", "byte", "char", "int8", "uint8"), "i8"),
    **{f"{sign}int{bits}": f"i{bits}" for bits in (16, 32, 64) for sign in ("", "u")},
    "float32": "f32", "float64": "f64", "string": "string", "wstring": "wstring",
    **dict.fromkeys(("time", "duration", "builtin_interfaces/Time", "builtin_interfaces/Duration"), TIME),
}  # fmt: skip
CONSTANT = re.compile(r"\S+\s+\w+\s*=")
FIELD = re.compile(r"(?P<type>[\w/]+)(<=\d+)?(\[(?P<count>(<=)?\d*)\])?\s+\w+")


def check_layout(schema: Schema, expected: str) -> None:
    """ValueError unless the message that `schema` describes is laid out as `expected`; an empty schema is trusted.

    Args:
        schema: of a channel, in ros1msg or ros2msg.
        expected: as `layout` gives it, with `{header}` for a std_msgs/Header.
    """
    if len(schema.data) > MAX_BYTES:
        raise ValueError(f"it has {len(schema.data)} bytes, more than any message definition")
    if not schema.data or schema.encoding in TRUSTED:
        return
    if schema.encoding not in HEADER:
        raise ValueError(f"a schema in {schema.encoding!r} cannot be read, only {' or '.join(HEADER)}")
    found, reason = _layout_or_reason(schema.data)
    if reason:
        raise ValueError(reason)
    wanted = expected.format(header=HEADER[schema.encoding])
    if found != wanted:
        raise ValueError(f"its layout is '{found[:200] or 'empty'}', but '{wanted}' was expected")


@lru_cache(maxsize=16)
def _layout_or_reason(data: bytes) -> tuple[str, str]:
    """(layout, why there is none); thousands of channels may share a schema."""
    try:
        return layout(data.decode()), ""
    except ValueError as err:
        return "", str(err)


def layout(text: str) -> str:
    """Order of the primitive fields of a definition and of those below it, e.g. `i32 string f64[9] (i16 string)[]`.

    Signs do not matter and are left out; time and duration are two numbers.

    Raises:
        ValueError: a type without a definition, one that contains itself, or a message of thousands of fields.
    """
    return _Definitions(text).layout("", ())


class _Definitions:
    """The sections of a definition by type, "" for the first; each is flattened once."""

    def __init__(self, text: str) -> None:
        self._lines: dict[str, list[str]] = {"": []}
        self._layouts: dict[str, str] = {}
        name = ""
        for line in text.splitlines():
            if line.startswith("MSG:"):
                name = _short(line[4:].strip())
                self._lines.setdefault(name, [])
            elif not line.startswith("===="):
                self._lines[name].append(line.partition("#")[0].strip())
        self._full = {name.rpartition("/")[2]: name for name in self._lines}

    def layout(self, name: str, above: tuple[str, ...]) -> str:
        """Flattened fields of one type; `above` are the types that contain it."""
        if name in above or len(above) > MAX_DEPTH:
            raise ValueError(f"the type {name[:80]} contains itself")
        if name not in self._layouts:
            found, size = [], 0
            for line in self._lines[name]:
                if line and not CONSTANT.match(line):
                    found.append(self._field(line, (*above, name)))
                    size += len(found[-1]) + 1
                if size > MAX_LAYOUT:
                    raise ValueError("it has thousands of fields")
            self._layouts[name] = " ".join(found)
        return self._layouts[name]

    def _field(self, line: str, above: tuple[str, ...]) -> str:
        match = FIELD.match(line)
        if match is None:
            raise ValueError(f"the line {line[:80]!r} is no field")
        inner, count = self._type(_short(match["type"]), above), match["count"]
        if count is None:
            return inner
        inner = f"({inner})" if " " in inner else inner
        return f"{inner}[{count if count.isdigit() else ''}]"

    def _type(self, name: str, above: tuple[str, ...]) -> str:
        if name in PRIMITIVES:
            return PRIMITIVES[name]
        known = name if name in self._lines else self._full.get(name.rpartition("/")[2])
        if known is None:
            raise ValueError(f"the type {name[:80]} is not defined")
        return self.layout(known, above)


def _short(name: str) -> str:
    """package/msg/Type as package/Type."""
    return name.replace("/msg/", "/")
