"""foxglove messages in JSON: text to a mapping of fields."""

import json
import re
from collections.abc import Callable
from typing import Any

from mcap.records import Schema

from stsem.log.schemas import foxglove
from stsem.log.schemas.foxglove import Fields
from stsem.log.schemas.messages import Decoded

DATA = re.compile(rb'"data"\s*:\s*"')
MAX_VALUES = 100_000
"""Separators in one message: pixels are one text in base64, and thousands of transforms have fewer."""


def reader(convert: Callable[[Fields], Decoded]) -> Callable[[Schema], Callable[[memoryview], Decoded]]:
    """Makes the reader of a message type; the schema in the file says nothing that its name does not."""
    return lambda _: lambda payload: convert(parse(payload))


def stamp_reader(_: Schema) -> Callable[[memoryview], int | None]:
    """Makes the reader of the field `timestamp`; everything but the pixels is parsed for it."""
    return lambda payload: foxglove.stamp(parse(without_data(bytes(payload))))


def without_data(raw: bytes) -> bytes:
    """`raw` with an empty text in the field `data`, if it is plainly one; as it is otherwise."""
    begin = DATA.search(raw)
    if begin is None:
        return raw
    end = raw.find(b'"', begin.end())
    return raw if end < 0 or raw[end - 1] == ord("\\") else raw[: begin.end()] + raw[end:]


def parse(payload: memoryview | bytes) -> dict[str, Any]:
    """The object that `payload` holds.

    Raises:
        ValueError: it is no JSON, no object, or has more values or depth than a message.
    """
    raw = bytes(payload)
    values = sum(raw.count(mark) for mark in (b",", b"[", b"{"))
    if values > MAX_VALUES:
        raise ValueError(f"the message has {values} values")
    try:
        found = json.loads(raw)
    except RecursionError as err:
        raise ValueError("the message is nested too deeply") from err
    if not isinstance(found, dict):
        raise ValueError(f"a {type(found).__name__} came where an object was expected")
    return found
