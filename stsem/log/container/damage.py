"""What is wrong with a log: named, counted by kind and channel, survivable.

| kind | what happened | what is lost |
|---|---|---|
| `truncated` | the file ends early | everything behind that place |
| `bad_record` | a record whose length or content cannot be | that record, or the rest of its chunk or file |
| `chunk_crc` | a chunk does not have its checksum | the chunk |
| `chunk_unreadable` | a chunk cannot be decompressed, or not to its stated size | the chunk |
| `lost_message` | a message of a lost chunk, as the index behind the chunk states | the message |
| `unknown_channel` | a message whose channel is described nowhere | the message |
| `undecodable` | a message that cannot be decoded | the message |
| `data_crc`, `summary_crc`, `attachment_crc` | a section does not have its checksum | nothing |
| `unread_byte` | bytes that were not understood | unknown |
"""

import threading
from collections import defaultdict

KINDS = (
    "truncated", "bad_record", "chunk_crc", "chunk_unreadable", "lost_message", "unknown_channel", "undecodable",
    "data_crc", "summary_crc", "attachment_crc", "unread_byte",
)  # fmt: skip


class Damage:
    """Counts of damage by kind and channel; the channel is "" where none can be named.

    Counting is safe from several threads, and a message that is met twice counts once: so the counts do not depend
    on how often, or in which order, frames were asked for.
    """

    def __init__(self) -> None:
        self._counts: dict[str, dict[str, int]] = defaultdict(lambda: defaultdict(int))
        self._undecodable: set[tuple[str, int, int]] = set()
        self._lock = threading.Lock()

    def count(self, kind: str, channel: str = "", n: int = 1) -> None:
        """Add `n` cases of `kind` on `channel`."""
        if n > 0:
            with self._lock:
                self._counts[kind][channel] += n

    def undecodable(self, channel: str, place: int, offset: int) -> None:
        """Add the message at (`place`, `offset`) of `channel`, once."""
        with self._lock:
            self._undecodable.add((channel, place, offset))

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

    def __str__(self) -> str:
        parts = (
            f"{kind} {sum(channels.values())}" + (f" ({', '.join(filter(None, channels))})" if any(channels) else "")
            for kind, channels in self.counts.items()
        )
        return ", ".join(parts) or "none"
