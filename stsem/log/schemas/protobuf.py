"""foxglove messages in protobuf: the wire format to a mapping of fields, bytes as views without a copy.

Field numbers and types are taken from the schema in the file, by name. Readers raise ValueError or IndexError when the
bytes are not such a message.
"""

import struct
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from google.protobuf import descriptor_pb2, message  # type: ignore[import-untyped]
from mcap.records import Schema

from stsem.log.schemas import foxglove
from stsem.log.schemas.cursor import MAX_TEXT
from stsem.log.schemas.foxglove import Fields
from stsem.log.schemas.messages import Decoded

MAX_SCHEMA_BYTES = 1 << 20
MAX_DEPTH = 20
MAX_FIELDS = 100_000
MAX_FIELDS_DESCRIBED = 200
VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
Proto = descriptor_pb2.FieldDescriptorProto
WireValue = int | memoryview
FORMATS = {
    Proto.TYPE_DOUBLE: "d", Proto.TYPE_FIXED64: "Q", Proto.TYPE_SFIXED64: "q",
    Proto.TYPE_FLOAT: "f", Proto.TYPE_FIXED32: "I", Proto.TYPE_SFIXED32: "i",
}  # fmt: skip
"""Numbers of a fixed size, as in struct."""
SIGNED = (Proto.TYPE_INT32, Proto.TYPE_INT64)
WIRE_TYPES = {
    **{number: FIXED64 if form in "dQq" else FIXED32 for number, form in FORMATS.items()},
    **dict.fromkeys((*SIGNED, Proto.TYPE_UINT32, Proto.TYPE_UINT64), VARINT),
    **dict.fromkeys((Proto.TYPE_STRING, Proto.TYPE_BYTES, Proto.TYPE_MESSAGE), BYTES),
}
"""Type of a field that is read -> how the wire holds it."""


def varint(data: memoryview, at: int) -> tuple[int, int]:
    """(value, place behind it) of the base-128 number at `at`."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("a number is longer than 10 bytes")


def walk(data: memoryview) -> Iterator[tuple[int, int, WireValue]]:
    """(number, wire type, value) of each field of one message: int for varints, a view for everything else."""
    at, end = 0, len(data)
    for _ in range(MAX_FIELDS):
        if at >= end:
            return
        tag, at = varint(data, at)
        wire = tag & 7
        if wire == VARINT:
            value, at = varint(data, at)
            yield tag >> 3, wire, value
            continue
        if wire == BYTES:
            length, at = varint(data, at)
        elif wire in (FIXED64, FIXED32):
            length = 8 if wire == FIXED64 else 4
        else:
            raise ValueError(f"wire type {wire} is unknown")
        if length > end - at:
            raise ValueError(f"{length} bytes are announced but {end - at} are there")
        yield tag >> 3, wire, data[at : at + length]
        at += length
    raise ValueError(f"the message has more than {MAX_FIELDS} fields")


Types = dict[str, Any]
"""Full name of a message type, with a leading dot -> its descriptor."""


def message_types(schema: Schema) -> Types:
    """The types that `schema` describes.

    Raises:
        ValueError: it is no set of descriptors, a huge one, or does not describe its own message.
    """
    if schema.encoding != "protobuf":
        raise ValueError(f"a schema in {schema.encoding!r} cannot be read, only 'protobuf'")
    if len(schema.data) > MAX_SCHEMA_BYTES:
        raise ValueError(f"it has {len(schema.data)} bytes, more than any message definition")
    types = _described(schema.data)
    if types is None:
        raise ValueError("it is no set of protobuf descriptors")
    if f".{schema.name}" not in types:
        raise ValueError(f"it does not describe {schema.name}")
    return types


@lru_cache(maxsize=16)
def _described(data: bytes) -> Types | None:
    """The types in a schema, None when it is none; thousands of channels may share a schema."""
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(data).file
    except message.DecodeError:
        return None
    return {
        f".{file.package}.{one.name}" if file.package else f".{one.name}": one
        for file in files
        for one in file.message_type
    }


class _Field(NamedTuple):
    """One field of a message type, as its descriptor says; `type_name` is "" unless it is a message."""

    name: str
    type: int
    type_name: str
    repeated: bool


class Messages:
    """Reads messages of the types that `schema` describes; raises ValueError as `message_types` does."""

    def __init__(self, schema: Schema) -> None:
        self._types = message_types(schema)
        self._fields: dict[str, dict[int, _Field]] = {}

    def read(self, type_name: str, payload: memoryview, depth: int = 0) -> dict[str, Any]:
        """Field name -> int, float, str, view, mapping, or a list of them; fields nobody knows are passed over."""
        if depth > MAX_DEPTH:
            raise ValueError("the message is nested too deeply")
        fields, found = self.fields(type_name), dict[str, Any]()
        for number, wire, value in walk(payload):
            field = fields.get(number)
            if field is None:
                continue
            if field.repeated:
                found.setdefault(field.name, []).extend(self._items(field, wire, value, depth))
            else:
                found[field.name] = self._value(field, wire, value, depth)
        return found

    def fields(self, type_name: str) -> dict[int, _Field]:
        """Number -> field of one type, those with a type that is read."""
        if type_name not in self._fields:
            if type_name not in self._types:
                raise ValueError(f"{type_name[1:80]} is not described by the schema")
            described = self._types[type_name].field
            if len(described) > MAX_FIELDS_DESCRIBED:
                raise ValueError(f"{type_name[1:80]} is described with {len(described)} fields")
            if len({field.name for field in described}) < len(described):
                raise ValueError(f"{type_name[1:80]} is described with two fields of one name")
            self._fields[type_name] = {
                field.number: _Field(field.name, field.type, field.type_name, field.label == Proto.LABEL_REPEATED)
                for field in described
                if field.type in WIRE_TYPES
            }
        return self._fields[type_name]

    def _items(self, field: _Field, wire: int, value: WireValue, depth: int) -> Sequence[Any]:
        form = FORMATS.get(field.type)
        if form is None or isinstance(value, int) or wire != BYTES:
            return (self._value(field, wire, value, depth),)
        count, rest = divmod(len(value), struct.calcsize("<" + form))
        if rest or count > MAX_FIELDS:
            raise ValueError(f"{field.name} has {len(value)} bytes, which is no list of numbers")
        return struct.unpack(f"<{count}{form}", value)

    def _value(self, field: _Field, wire: int, value: WireValue, depth: int) -> Any:
        if wire != WIRE_TYPES[field.type]:
            raise ValueError(f"{field.name} is of wire type {wire} instead of {WIRE_TYPES[field.type]}")
        if isinstance(value, int):
            return value - (1 << 64) if value >> 63 and field.type in SIGNED else value
        if field.type == Proto.TYPE_MESSAGE:
            return self.read(field.type_name, value, depth + 1)
        if field.type == Proto.TYPE_STRING:
            return _text(field.name, value)
        return value if field.type == Proto.TYPE_BYTES else struct.unpack("<" + FORMATS[field.type], value)[0]


def reader(convert: Callable[[Fields], Decoded]) -> Callable[[Schema], Callable[[memoryview], Decoded]]:
    """Makes the reader of a message type from the schema in the file."""

    def make(schema: Schema) -> Callable[[memoryview], Decoded]:
        messages, name = Messages(schema), f".{schema.name}"
        return lambda payload: convert(messages.read(name, payload))

    return make


def stamp_reader(schema: Schema) -> Callable[[memoryview], int | None]:
    """Makes the reader of the field `timestamp` alone, which walks no further than it."""
    messages = Messages(schema)
    found = {field.name: (number, field.type_name) for number, field in messages.fields(f".{schema.name}").items()}
    if "timestamp" not in found:
        raise ValueError(f"{schema.name} has no timestamp")
    wanted, type_name = found["timestamp"]

    def read(payload: memoryview) -> int | None:
        for number, _, value in walk(payload):
            if number == wanted:
                if isinstance(value, int):
                    raise ValueError("timestamp is not a message")
                return foxglove.stamp({"timestamp": messages.read(type_name, value)})
        return None

    return read


def _text(name: str, value: memoryview) -> str:
    if len(value) > MAX_TEXT:
        raise ValueError(f"{name} has {len(value)} bytes")
    return bytes(value).decode()
