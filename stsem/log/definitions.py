"""The schemas and channels of one file, and the tracks that its channels belong to."""

import struct
from collections import Counter

from mcap.opcode import Opcode
from mcap.records import Schema

from stsem.log.container.damage import Damage
from stsem.log.container.layout import split
from stsem.log.tracks import Track

Key = tuple[str, str, str]
"""(topic, message encoding, schema name) of a track."""

MAX_BYTES = 1 << 26
MAX_TRACKS = 1 << 16
NO_SCHEMA = Schema(id=0, data=b"", encoding="", name="")
CHANNEL_HEAD = struct.Struct("<HH")


class Definitions:
    """What the ids in one file mean.

    A definition that is repeated unchanged says nothing new. One that differs is a `contradiction`: in the data section
    it holds from there on, as for a channel that restarts; in the summary the first one stays.

    Args:
        tracks: of the log, across its files; grows.
        damage: to be counted in.
    """

    def __init__(self, tracks: dict[Key, Track], damage: Damage) -> None:
        self._tracks, self._damage = tracks, damage
        self._bodies: dict[tuple[int, int], bytes] = {}
        self._schemas: dict[int, Schema] = {0: NO_SCHEMA}
        self._bytes = 0
        self.channels: dict[int, Track] = {}

    @property
    def counts(self) -> dict[int, int]:
        """Opcode -> how many ids of that kind are defined."""
        return Counter(opcode for opcode, _ in self._bodies)

    def name(self, channel: int) -> str:
        """The topic of a channel, or what stands in for it."""
        track = self.channels.get(channel)
        return track.topic if track else f"channel {channel}"

    def schema(self, body: bytes, *, in_summary: bool) -> None:
        """A schema record. Raises ValueError when it is none."""
        (number, name, encoding, data), _ = split(Opcode.SCHEMA, body)
        schema = Schema(int.from_bytes(number, "little"), bytes(data), str(encoding, "utf-8"), str(name, "utf-8"))
        if schema.id == 0:
            raise ValueError("a schema has the id 0, which means none")
        if self._is_new(Opcode.SCHEMA, schema.id, body, in_summary):
            self._schemas[schema.id] = schema

    def channel(self, body: bytes, *, in_summary: bool) -> None:
        """A channel record; without its schema it is left out. Raises ValueError when it is none."""
        (ids, topic, encoding, metadata), end = split(Opcode.CHANNEL, body)
        channel, schema_id = CHANNEL_HEAD.unpack(ids)
        schema = self._schemas.get(schema_id)
        key = str(topic, "utf-8"), str(encoding, "utf-8"), schema.name if schema else ""
        front = body[: end - len(metadata)]  # nothing reads the metadata, whose order is free
        if schema is not None and self._is_new(Opcode.CHANNEL, channel, front, in_summary):
            self.channels[channel] = self._track(key, schema)

    def _is_new(self, opcode: int, number: int, body: bytes, in_summary: bool) -> bool:
        """Whether to take a definition in; a differing one is counted.

        Raises:
            ValueError: the definitions are larger than those of any recorder.
        """
        known = self._bodies.get((opcode, number))
        if known == body:
            return False
        if known is not None:
            self._damage.count("contradiction", self.name(number) if opcode == Opcode.CHANNEL else "")
            if in_summary:
                return False
        self._bytes += len(body) - len(known or b"")
        if self._bytes > MAX_BYTES:
            raise ValueError(f"schemas and channels of more than {MAX_BYTES} bytes")
        self._bodies[opcode, number] = body
        return True

    def _track(self, key: Key, schema: Schema) -> Track:
        track = self._tracks.get(key)
        if track is None:
            if len(self._tracks) >= MAX_TRACKS:
                raise ValueError(f"more than {MAX_TRACKS} channels")
            track = self._tracks[key] = Track(key[0], schema, key[1], self._damage)
        elif track.row is not None and track.definition != schema.data:
            self._damage.count("contradiction", track.topic)
        return track
