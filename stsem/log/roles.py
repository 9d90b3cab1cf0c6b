"""The image channels that play a role: asked for by name, or chosen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from stsem.errors import ChannelError
from stsem.log.cameras import choose_color, other_owner
from stsem.log.candidate import Candidate
from stsem.log.choose import choose_partner
from stsem.log.pixels.formats import JPEG, WEBP
from stsem.log.pixels.look import Look
from stsem.log.tracks import Track


@dataclass(frozen=True)
class Roles:
    """Which image channel is what.

    Args:
        color: the colour camera's.
        why_color: why it is that channel, in a few words.
        depth, labels: None when there is none.
        depth_owner: the other camera whose depth it is; None when it is colour's, nobody's, or was asked for.
        warnings: one sentence each.
    """

    color: Candidate
    why_color: str
    depth: Candidate | None
    labels: Candidate | None
    depth_owner: Candidate | None
    warnings: tuple[str, ...]


def choose_roles(images: Sequence[Candidate], asked: Mapping[str, Track], tracks: Sequence[Track]) -> Roles:
    """The channels of colour, depth and labels among `images`.

    Raises:
        ChannelError: no colour images, two cameras with an equal claim, or a channel that cannot be what it was given
            for.
    """
    given = {role: _find(images, role, track) for role, track in asked.items() if track.is_image}
    free = [image for image in images if not any(image is taken for taken in given.values())]
    _check_given(given, free)
    color, why = (given["color"], "asked for") if "color" in given else choose_color(free, tracks)
    others = [image for image in images if image is not color]
    free = [image for image in free if image is not color]
    depth, warning = (given["depth"], "") if "depth" in given else choose_partner(free, "depth", color)
    labels, more = (given["labels"], "") if "labels" in given else choose_partner(free, "labels", color)
    owner = other_owner(depth, color, others) if depth and "depth" not in given else None
    return Roles(color, why, depth, labels, owner, tuple(text for text in (warning, more) if text))


def _find(images: Sequence[Candidate], role: str, track: Track) -> Candidate:
    found = next((c for c in images if c.track is track), None)
    if found is None:
        raise ChannelError(f"{track.topic} was given for {role}, but it has no message; choose another topic.", role)
    return found


def _check_given(given: Mapping[str, Candidate], free: Sequence[Candidate]) -> None:
    """Refuse the colour camera as depth or labels when no other is as good, and pixels that cannot be either."""
    rivals = [c for c in free if c.nature == "color"]
    for role, taken in given.items():
        best = all(taken.claim[:2] > c.claim[:2] for c in rivals)
        if "color" not in given and taken.nature == "color" and best:
            raise ChannelError(
                f"{taken.topic} was given for {role}, but it is the colour camera ({taken.look.name}), and a channel "
                f"can be only one of them; choose another topic, or give --topic color=TOPIC, too.",
                role,
            )
        if needed := _unfit(role, taken.look):
            raise ChannelError(
                f"{taken.topic} was given for {role}, but it holds {taken.look.name}: {needed}; choose another topic.",
                role,
            )


def _unfit(role: str, look: Look) -> str:
    """What a role needs that an image is not; "" where it may fit."""
    if role == "depth" and look.order not in ("metric", "unknown"):
        return "depth needs 16 bits or floats of one channel"
    if role == "labels" and look.name in (JPEG, WEBP):
        return "labels need a lossless image (raw or png)"
    return ""
