"""What the first pass leaves: the tracks, where the messages are, and what was wrong."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from stsem.log.container.chunk import Chunk
from stsem.log.container.damage import Damage
from stsem.log.container.files import File
from stsem.log.container.store import CACHE_BYTES
from stsem.log.tracks import Track


@dataclass
class Scan:
    """What the first pass leaves.

    Args:
        files: in order.
        damage: what was wrong.
        sha256: of all bytes of all files, in order.
        tracks: by (topic, encoding, schema name), in order of first appearance.
        chunks: place in the log -> chunk, of the chunks whose messages can be trusted.
        metadata: name -> the content of its last record, of the class table's.
        opened: place in the log -> content of the first chunks, as much as a Store may hold.
        attachments: name -> bytes, of the class table's.
        profile, library: of the first file.
        opened_bytes: of all chunks, kept or not.
        message_bytes: of all payloads.
        unprotected_bytes: of the payloads that no checksum covers.
    """

    files: Sequence[File]
    damage: Damage
    sha256: str = ""
    tracks: dict[tuple[str, str, str], Track] = field(default_factory=dict)
    chunks: dict[int, Chunk] = field(default_factory=dict)
    opened: dict[int, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    profile: str = ""
    library: str = ""
    opened_bytes: int = 0
    message_bytes: int = 0
    unprotected_bytes: int = 0

    @property
    def unprotected(self) -> float:
        """Share 0..1 of the bytes of messages that no checksum covers: a wrong one among them cannot be noticed."""
        return self.unprotected_bytes / self.message_bytes if self.message_bytes else 0.0

    def keep_chunk(self, place: int, chunk: Chunk, records: bytes) -> None:
        """A chunk that has messages; short logs need no second decompression."""
        self.chunks[place] = chunk
        self.opened_bytes += len(records)
        if self.opened_bytes <= CACHE_BYTES:
            self.opened[place] = records
