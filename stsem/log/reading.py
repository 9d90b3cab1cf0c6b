"""An image channel that can be read by row: its references, its decoder, and what to do with its pixels."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from stsem.errors import DecodeError, LogError
from stsem.log.container.damage import Damage
from stsem.log.container.store import Store
from stsem.log.pixels.look import ImageMessage, Look, look
from stsem.log.schemas.messages import CompressedImage, RawImage
from stsem.log.tracks import Track
from stsem.plain import plain

T = TypeVar("T")


class ImageChannel:
    """Random access to the messages of one image channel, rows in order of (stamp, log time, position in the file)."""

    def __init__(self, track: Track, store: Store, damage: Damage) -> None:
        self.track, self.topic = track, track.topic
        self.rows = track.references()
        self._store, self._damage = store, damage

    def __len__(self) -> int:
        return len(self.rows)

    def read(self, row: int, convert: Callable[[ImageMessage], T]) -> T:
        """`convert` of the message in `row`.

        Raises:
            DecodeError: the message cannot be decoded; counted as damage, once.
        """
        place, offset = int(self.rows.place[row]), int(self.rows.offset[row])
        payload = self._store.payload(place, offset, int(self.rows.length[row]))
        try:
            message = self.track.decode(payload) if self.track.decode else None
            if not isinstance(message, RawImage | CompressedImage):
                raise ValueError(f"{self.track.schema} is no image")
            return convert(message)
        except LogError:
            raise
        except Exception as err:  # bytes of a stranger, read by parsers with errors of their own
            reason = plain(str(err)) or type(err).__name__
            self._damage.undecodable(self.topic, place, offset, reason)
            raise DecodeError(self.topic, int(self.rows.stamp_ns[row]), reason) from err

    def first(self, convert: Callable[[ImageMessage], T]) -> tuple[int, T] | None:
        """(row, `convert` of it) of the first message that can be decoded; None when there is no such message."""
        for row in range(len(self)):
            try:
                return row, self.read(row, convert)
            except DecodeError:
                continue
        return None

    def look(self) -> Look:
        """What the channel holds, told by its first readable message; its frame without the slash of ROS 1."""
        found = self.first(look)
        if found:
            return replace(found[1], frame_id=plain(found[1].frame_id.lstrip("/")), name=plain(found[1].name))
        return Look("unknown", 0, "unreadable", "")
