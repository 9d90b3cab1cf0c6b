"""What a data set is to stsem: its events in order of time, and what holds for all of them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

from stsem.camera import Camera
from stsem.classes import ClassSet, Labels
from stsem.frame import Depth, Image
from stsem.pose import Pose

Progress = Callable[[int, int], None]
"""Called with (done, total), in whatever unit."""

FIRST_STAMP_NS = 1_000_000_000
"""Stamp of the first image of a set without stamps: a stamp of zero means "not set" in every message format."""


@dataclass(frozen=True, eq=False)
class ColorEvent:
    """A colour image: the bytes of a jpeg, png or webp file as they are, or (H, W, 3) uint8 RGB pixels."""

    stamp_ns: int
    image: bytes | Image


@dataclass(frozen=True, eq=False)
class DepthEvent:
    """Depth along z in metres, (H, W) float32, NaN unknown, in the depth camera's pixels."""

    stamp_ns: int
    depth: Depth


@dataclass(frozen=True, eq=False)
class TruthEvent:
    """Truth (H, W) uint8 in the ids of `Recording.classes`, 255 ignored."""

    stamp_ns: int
    labels: Labels


@dataclass(frozen=True, eq=False)
class PoseEvent:
    """T_WC (4, 4): pose of the colour camera's optical frame in the world, metres."""

    stamp_ns: int
    T_WC: Pose


@dataclass(frozen=True)
class Loss:
    """Something that should have been an event but cannot be read: counted, and the result is lossy.

    Args:
        what: the kind of thing, in the plural, and why: "colour images that cannot be decoded".
        stamp_ns: where it would have stood; None when that is not known.
        count: how many.
    """

    what: str
    stamp_ns: int | None = None
    count: int = 1


Event = ColorEvent | DepthEvent | TruthEvent | PoseEvent | Loss


@dataclass(frozen=True)
class Options:
    """What a user may state where the data set does not.

    Args:
        rate_hz: of images without stamps; None: what the data set says about itself, else 30.
        depth_scale: units of a 16-bit depth image per metre; None: the data set's own.
        classes_file: class table instead of the data set's own.
        sequence: which one, where a data set holds several recordings; None: the only one.
    """

    rate_hz: float | None = None
    depth_scale: float | None = None
    classes_file: Path | None = None
    sequence: str | None = None


@dataclass(frozen=True)
class Recording:
    """A data set, opened.

    Args:
        events: in ascending order of stamps; read one by one, so that memory stays bounded.
        count: how many events there will be, for the progress bar.
        classes: of the truth; None without truth.
        camera: intrinsics of the colour images; None when unknown.
        depth_camera: intrinsics of the depth images when they are not pixel for pixel those of colour, else None.
        T_color_depth: (4, 4) colour camera from depth camera, metres; None with `depth_camera` None.
        notes: one sentence each, on what was assumed; read after the events. What was lost is a `Loss`.
    """

    events: Iterator[Event]
    count: int
    classes: ClassSet | None = None
    camera: Camera | None = None
    depth_camera: Camera | None = None
    T_color_depth: Pose | None = None
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Summary:
    """What a conversion wrote.

    Args:
        messages: topic -> messages written.
        losses: what was left out -> how often; anything in it makes the conversion lossy (exit code 3).
        notes: one sentence each, on what was assumed.
    """

    messages: Mapping[str, int]
    losses: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def even_stamp_ns(index: int, rate_hz: float) -> int:
    """Stamp of image `index` of a set without stamps, at a constant rate: rounded once, so that nothing adds up."""
    return FIRST_STAMP_NS + round(Fraction(index * 10**9) / Fraction(rate_hz))
