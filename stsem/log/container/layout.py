"""The shape of every record, as a table: so that no length inside a record is believed unless all of them fit."""

import struct

from mcap.opcode import Opcode

FRAME = struct.Struct("<BQ")
"""Opcode and length, in front of every record."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence, log time, publish time, in front of the payload."""
FIRST_PRIVATE = 0x80
"""Opcodes from here on belong to applications; those below that the table does not have are reserved."""

Part = int | str
TEXT, LONG = "<I", "<Q"
"""A stretch of bytes behind its length, in 4 or in 8 bytes."""

LAYOUT: dict[int, tuple[Part, ...]] = {
    Opcode.HEADER: (TEXT, TEXT),
    Opcode.FOOTER: (20,),
    Opcode.SCHEMA: (2, TEXT, TEXT, TEXT),
    Opcode.CHANNEL: (4, TEXT, TEXT, TEXT),
    Opcode.MESSAGE: (MESSAGE_HEAD.size,),
    Opcode.CHUNK: (28, TEXT, LONG),
    Opcode.MESSAGE_INDEX: (2, TEXT),
    Opcode.CHUNK_INDEX: (32, TEXT, 8, TEXT, 16),
    Opcode.ATTACHMENT: (16, TEXT, TEXT, LONG, 4),
    Opcode.ATTACHMENT_INDEX: (40, TEXT, TEXT),
    Opcode.STATISTICS: (42, TEXT),
    Opcode.METADATA: (TEXT, TEXT),
    Opcode.METADATA_INDEX: (16, TEXT),
    Opcode.SUMMARY_OFFSET: (17,),
    Opcode.DATA_END: (4,),
}
FIXED = frozenset((Opcode.FOOTER, Opcode.SUMMARY_OFFSET, Opcode.DATA_END))
SHORTEST = {
    opcode: sum(part if isinstance(part, int) else struct.calcsize(part) for part in parts)
    for opcode, parts in LAYOUT.items()
}


def split(opcode: int, body: bytes | memoryview) -> tuple[list[memoryview], int]:
    """(the parts of a record in the order of its row of LAYOUT, where the last one ends); bytes behind it are allowed.

    Raises:
        ValueError: a part would reach behind the end.
    """
    view, parts, at = memoryview(body), [], 0
    for part in LAYOUT[opcode]:
        length = part
        if isinstance(part, str):
            behind = at + struct.calcsize(part)
            if behind > len(view):
                break
            length, at = struct.unpack_from(part, view, at)[0], behind
        if not isinstance(length, int) or length > len(view) - at:
            break
        parts.append(view[at : at + length])
        at += length
    if len(parts) < len(LAYOUT[opcode]):
        raise ValueError(f"the parts of a record of {len(view)} bytes do not fit into it")
    return parts, at


def is_whole(opcode: int, body: bytes | memoryview) -> bool:
    """Whether the parts fill the record exactly; a message has none that could tell."""
    try:
        return opcode != Opcode.MESSAGE and split(opcode, body)[1] == len(body)
    except ValueError:
        return False


def is_head(opcode: int, length: int, room: int) -> bool:
    """Whether a record with this head can stand where `room` bytes follow its head."""
    if not (opcode in LAYOUT or opcode >= FIRST_PRIVATE) or length > room:
        return False
    return length == SHORTEST[opcode] if opcode in FIXED else length >= SHORTEST.get(opcode, 0)


def string_map(block: memoryview) -> dict[str, str]:
    """Keys and values of a map of texts.

    Raises:
        ValueError: they do not fill the block, or are no UTF-8.
    """
    texts, at = [], 0
    while at < len(block):
        if len(block) - at < 4:
            raise ValueError("a map ends inside a length")
        (length,) = struct.unpack_from(TEXT, block, at)
        if length > len(block) - at - 4:
            raise ValueError("a map ends inside a text")
        texts.append(str(block[at + 4 : at + 4 + length], "utf-8"))
        at += 4 + length
    if len(texts) % 2:
        raise ValueError("a map has a key without a value")
    return dict(zip(texts[::2], texts[1::2], strict=True))
