"""foxglove messages in JSON: text to a mapping of fields."""

import json
from collections.abc import Callable
from typing import Any

from mcap.records import Schema

from stsem.log.schemas import foxglove
from stsem.log.schemas.foxglove import Fields
from stsem.log.schemas.messages import Decoded

MAX_VALUES = 100_000
"""Separators in one message: pixels are one text in base64, and thousands of transforms have fewer."""


def reader(convert: Callable[[Fields], Decoded]) -> Callable[[Schema], Callable[[memoryview], Decoded]]:
    """Makes the reader of a message type; the schema in the file says nothing that its name does not."""
    return lambda _: lambda payload: convert(parse(payload))


def stamp_reader(_: Schema) -> Callable[[memoryview], int | None]:
    """Makes the reader of the field `timestamp`; the whole text is parsed for it."""
    return lambda payload: foxglove.stamp(parse(payload))


def parse(payload: memoryview) -> dict[str, Any]:
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
