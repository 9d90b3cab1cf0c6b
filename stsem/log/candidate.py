"""An image channel, and what it could be used as."""

from dataclasses import dataclass

from stsem.log import topicnames
from stsem.log.pixels.look import Look
from stsem.log.topicnames import (
    COLOUR_WORDS,
    INFRARED_WORDS,
    INSTANCE_WORDS,
    NO_DEPTH_WORDS,
    OVERLAY_WORDS,
    PAINTED_WORDS,
    RECTIFIED_WORDS,
)
from stsem.log.tracks import Track

DULL_WORDS = INFRARED_WORDS | PAINTED_WORDS | OVERLAY_WORDS | NO_DEPTH_WORDS


@dataclass(frozen=True)
class Candidate:
    """An image channel and what it could be used as."""

    track: Track
    look: Look

    @property
    def topic(self) -> str:
        """Its topic."""
        return self.track.topic

    @property
    def words(self) -> frozenset[str]:
        """Words of the topic, in lower case."""
        return frozenset(topicnames.words(self.topic))

    @property
    def nature(self) -> str:
        """What it looks like: "color", "depth", "labels", "video"; or nothing, as ids of things and overlays are."""
        told, order = topicnames.told(self.topic), self.look.order
        floats = order == "metric" and self.look.bits != 16
        if order == "labels" or (told == "labels" and order not in ("video", "spoilt") and not floats):
            of_things = self.words & INSTANCE_WORDS and "semantic" not in self.words
            return "" if of_things or self.words & OVERLAY_WORDS else "labels"
        if order == "metric":
            return "" if self.words & (INFRARED_WORDS | NO_DEPTH_WORDS) else "depth"
        if order in ("rgb", "bgr", "grey"):
            return "" if told == "depth" else "color"
        if order == "unknown":
            return told or "color"
        return order

    @property
    def base(self) -> tuple[str, ...]:
        """The camera it belongs to: the topic without transport and without image_*."""
        return topicnames.camera(self.topic)

    @property
    def is_dull(self) -> bool:
        """Whether it is infrared, or a picture that was made of others, by its name."""
        return bool(self.words & DULL_WORDS)

    @property
    def in_colour(self) -> bool:
        """Whether its pixels are colours, or the mosaic of a colour sensor."""
        return self.look.order in ("rgb", "bgr")

    @property
    def is_mosaic(self) -> bool:
        """Whether it is what a colour sensor sends before anybody made colours of it."""
        return self.look.name.lower().strip().startswith("bayer")

    @property
    def is_rectified(self) -> bool:
        """Whether it is without lens distortion, by its name."""
        return bool(self.words & RECTIFIED_WORDS)

    @property
    def camera_says_colour(self) -> bool:
        """Whether its camera, and not only its image, is named by a word of colour: `rgb/image`."""
        return bool(topicnames.words("/".join(self.base)) & COLOUR_WORDS)

    @property
    def claim(self) -> tuple[bool, bool, bool]:
        """How much it claims to be THE colour camera."""
        return not self.is_dull, self.in_colour, bool(self.words & COLOUR_WORDS)

    def in_frame_of(self, other: "Candidate") -> bool:
        """Whether both name the same frame."""
        return bool(self.look.frame_id) and self.look.frame_id == other.look.frame_id
