"""A table that fits the terminal: columns are shortened, then left out, then cut, and it is said so."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tabulate import tabulate

from stsem.log.info import ChannelInfo
from stsem.plain import plain

NONE = "–"
MIN_TOPIC = 12


@dataclass(frozen=True)
class Column:
    """One column of the table of channels: its head, and what stands in it."""

    head: str
    cell: Callable[[ChannelInfo], str]
    align: str = "left"


def number(value: float | None, form: str) -> str:
    """`value` as `form` says; a dash for nothing."""
    return NONE if value is None else form.format(value)


def _delays(channel: ChannelInfo) -> str:
    if channel.offset_min_ns is None or channel.offset_median_ns is None:
        return NONE
    return f"{channel.offset_min_ns / 1e6:.1f} / {channel.offset_median_ns / 1e6:.1f}"


_TOPIC = Column("topic", lambda c: plain(c.topic))
_SCHEMA = Column("schema", lambda c: plain(c.schema) or NONE)
_TYPE = Column("type", lambda c: plain(c.schema).replace(".", "/").split("/")[-1] or NONE)
_ENCODING = Column("encoding", lambda c: plain(c.encoding) or NONE)
_CONTENT = Column("content", lambda c: plain(c.content, 24) or NONE)
_COUNT = Column("messages", lambda c: str(c.count), "right")
_RATE = Column("Hz", lambda c: number(c.rate_hz, "{:.2f}"), "right")
_GAP = Column("gap s", lambda c: number(c.largest_gap_s, "{:.3f}"), "right")
_DELAY = Column("delay ms", _delays, "right")
_ROLE = Column("used as", lambda c: c.role or NONE)

_LAYOUTS = (
    ((_TOPIC, _SCHEMA, _ENCODING, _CONTENT, _COUNT, _RATE, _GAP, _DELAY, _ROLE), ""),
    ((_TOPIC, _TYPE, _ENCODING, _CONTENT, _COUNT, _RATE, _GAP, _DELAY, _ROLE), "schemas are shortened"),
    ((_TOPIC, _TYPE, _CONTENT, _COUNT, _RATE, _GAP, _DELAY, _ROLE), "columns are left out"),
    ((_TOPIC, _TYPE, _COUNT, _RATE, _DELAY, _ROLE), "columns are left out"),
    ((_TOPIC, _TYPE, _COUNT, _RATE, _ROLE), "columns are left out"),
)
"""From wide to narrow, and what was done."""


def channel_table(channels: Sequence[ChannelInfo], width: int) -> str:
    """The channels in at most `width` columns, as far as that goes; `delay` is log time - stamp, smallest / median."""
    empty = () if any(channel.content for channel in channels) else (_CONTENT,)
    table, notes = "", [""]
    for layout, note in _LAYOUTS:
        columns = [column for column in layout if column not in empty]
        table, notes = _table(channels, columns, 0), [note] if note else []
        if _width(table) <= width:
            break
    if (excess := _width(table) - width) > 0:
        longest = max(len(_TOPIC.cell(channel)) for channel in channels)
        table = _table(channels, columns, max(MIN_TOPIC, longest - excess))
        notes.append("topics are cut")
    return table + (f"\n({' and '.join(notes)} to fit {width} columns; --json has all)" if notes else "")


def _table(channels: Sequence[ChannelInfo], layout: Sequence[Column], topic: int) -> str:
    rows = [[column.cell(channel) for column in layout] for channel in channels]
    if topic:
        rows = [[_cut(row[0], topic), *row[1:]] for row in rows]
    heads, aligns = [column.head for column in layout], [column.align for column in layout]
    return tabulate(rows, heads, disable_numparse=True, colalign=aligns if rows else None)


def _cut(text: str, length: int) -> str:
    """At most `length` characters; the end of a topic tells most."""
    return text if len(text) <= length else f"…{text[-length + 1 :]}"


def _width(table: str) -> int:
    return max(map(len, table.splitlines()), default=0)
