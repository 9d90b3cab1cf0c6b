"""What is wrong with a log: named, counted by kind and channel, survivable.

| kind | what happened | what is lost |
|---|---|---|
| `missing_file` | a file of a split recording that its metadata.yaml lists is not there | the file |
| `truncated` | the file ends early | everything behind that place |
| `bad_record` | a record whose length, kind or content cannot be | that record, or the rest of its chunk |
| `chunk_crc` | a chunk does not have its checksum | the chunk |
| `chunk_unreadable` | a chunk cannot be decompressed, or not to its stated size | the chunk |
| `lost_message` | a message of a lost part, as the index behind a chunk or the statistics state | the message |
| `unknown_channel` | a message whose channel is described nowhere | the message |
| `undecodable` | a message that cannot be decoded | the message |
| `data_crc`, `summary_crc` | a section does not have its checksum | nothing |
| `attachment_crc` | an attachment does not have its checksum | the attachment |
| `contradiction` | an index, the statistics, a chunk's times or a repeated definition say otherwise | unknown |
| `unread_byte` | bytes that were not understood, or that stand behind the end of the recording | unknown |

Behind a place that is no record, reading goes on at the next one that is (`unread_byte` counts the gap). Of the last
chunk of a cut file nothing is used: its checksum cannot be checked. Two recordings in one file are not read as one:
what stands behind the closing magic of the first is `unread_byte`; give them as two files. Where no checksum stands
(`Scan.unprotected`), a wrong byte in a payload cannot be noticed.
"""

import threading
from collections import defaultdict
from collections.abc import Collection, Iterator
from contextlib import contextmanager

from stsem.plain import plain

MAX_REMEMBERED = 1 << 20
KINDS = (
    "missing_file", "truncated", "bad_record", "chunk_crc", "chunk_unreadable", "lost_message", "unknown_channel",
    "undecodable", "data_crc", "summary_crc", "attachment_crc", "contradiction", "unread_byte",
)  # fmt: skip


UNDECODABLE = "undecodable"
OF_BYTES = tuple(kind for kind in KINDS if kind != UNDECODABLE)
"""What is wrong with the file; a message that cannot be decoded may well be as it was recorded."""


class Damage:
    """Counts of damage by kind and channel; where none can be named it is the file of a split recording, or "".

    Counting is safe from several threads, and a message that is met twice counts once: so the counts do not depend
    on how often, or in which order, frames were asked for.
    """

    def __init__(self) -> None:
        self._counts: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
        self._undecodable: set[tuple[str, int, int]] = set()
        self._reasons: dict[str, tuple[int, int, str]] = {}
        self._lock = threading.Lock()
        self._file = ""

    def count(self, kind: str, channel: str = "", n: int = 1) -> None:
        """Add `n` cases of `kind` on `channel`."""
        if n > 0:
            with self._lock:
                self._counts[kind][channel or self._file] += n

    @contextmanager
    def within(self, file: str) -> Iterator[None]:
        """What is counted inside without a channel is of `file`; one file is walked over at a time."""
        self._file = file
        try:
            yield
        finally:
            self._file = ""

    def undecodable(self, channel: str, place: int, offset: int, reason: str) -> None:
        """Add the message at (`place`, `offset`) of `channel`, once; from the millionth on they are not told apart."""
        with self._lock:
            self._reasons[channel] = min(self._reasons.get(channel, (place, offset, reason)), (place, offset, reason))
            if len(self._undecodable) < MAX_REMEMBERED:
                self._undecodable.add((channel, place, offset))
            else:
                self._counts["undecodable"][channel] += (channel, place, offset) not in self._undecodable

    @property
    def counts(self) -> dict[str, dict[str, int]]:
        """kind -> channel -> count, in the order of KINDS and of the names; kinds without a case are absent."""
        with self._lock:
            merged = {kind: dict(channels) for kind, channels in self._counts.items()}
            for channel, _, _ in self._undecodable:
                row = merged.setdefault("undecodable", {})
                row[channel] = row.get(channel, 0) + 1
        return {kind: dict(sorted(merged[kind].items())) for kind in KINDS if kind in merged}

    @property
    def lossy(self) -> bool:
        """Whether anything at all was damaged."""
        return bool(self.counts)

    def as_dict(self) -> dict[str, object]:
        """Plain data for the report: {"lossy": bool, "counts": {kind: {channel: n}}}."""
        return {"lossy": self.lossy, "counts": self.counts}

    @property
    def reasons(self) -> dict[str, str]:
        """channel -> why the first of its undecodable messages cannot be decoded."""
        with self._lock:
            return {channel: plain(reason) for channel, (_, _, reason) in sorted(self._reasons.items())}

    def __str__(self) -> str:
        reasons = "".join(f"; the first of {channel}: {reason}" for channel, reason in self.reasons.items())
        return self.summary(KINDS) + reasons

    def summary(self, kinds: Collection[str]) -> str:
        """The counts of these kinds with their channels, for people; "none" when there is no case."""
        parts = (
            f"{kind} {sum(channels.values())}" + (f" ({', '.join(filter(None, channels))})" if any(channels) else "")
            for kind, channels in self.counts.items()
            if kind in kinds
        )
        return ", ".join(parts) or "none"
