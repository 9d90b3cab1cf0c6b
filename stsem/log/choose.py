"""Which channel is used as what: by schema, by what the first message holds, and by name."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from stsem.errors import ChannelError, UsageError
from stsem.log import topicnames
from stsem.log.pixels.look import Look
from stsem.log.remark import Remark
from stsem.log.schemas.messages import Kind
from stsem.log.topicnames import (
    ALIGNED_WORDS,
    COLOUR_WORDS,
    INFRARED_WORDS,
    INSTANCE_WORDS,
    NO_DEPTH_WORDS,
    NO_POSE_WORDS,
    OVERLAY_WORDS,
    PAINTED_WORDS,
    SIDE_WORDS,
    TRUTH_WORDS,
)
from stsem.log.tracks import Track

ROLES = ("color", "depth", "pose", "labels")
DULL_WORDS = INFRARED_WORDS | PAINTED_WORDS | OVERLAY_WORDS | NO_DEPTH_WORDS
OTHERS_WORDS = INFRARED_WORDS | SIDE_WORDS | frozenset({"depth", "disparity"})
"""In the name of a calibration, and not in that of the image: it is that of another camera."""
RIVALS_NAMED = 5


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
    def claim(self) -> tuple[bool, bool, bool]:
        """How much it claims to be THE colour camera."""
        known_colour = self.look.order in ("rgb", "bgr")
        return not self.words & DULL_WORDS, known_colour, bool(self.words & COLOUR_WORDS)


def check_overrides(topics: Mapping[str, str], tracks: Sequence[Track]) -> dict[str, Track]:
    """The tracks that were asked for by name, by role.

    Raises:
        UsageError: a role that does not exist.
        ChannelError: a topic that does not exist, or that cannot play the role.
    """
    chosen: dict[str, Track] = {}
    for role, topic in topics.items():
        if role not in ROLES:
            raise UsageError(f"--topic names the role {role!r}, but the roles are {', '.join(ROLES)}.")
        fitting = [track for track in tracks if track.topic == topic]
        if not fitting:
            near = topicnames.nearest_first(topic, (track.topic for track in tracks))
            raise ChannelError(
                f"The log has no topic {topic!r} for {role}; it has {', '.join(near) or 'no topic at all'}.", role
            )
        track = max(fitting, key=lambda t: (_can_be(role, t), t.count))
        if not _can_be(role, track):
            what = "poses or transforms" if role == "pose" else "images"
            raise ChannelError(
                f"{topic} was given for {role}, which needs {what}, but it holds {track.schema or 'no schema'} "
                f"({track.encoding}); {track.trouble or 'choose another topic'}.",
                role,
            )
        if rival := next((other for other in chosen if chosen[other] is track), None):
            raise ChannelError(
                f"{topic} was given for {rival} and for {role}; a channel can be only one of them.", role
            )
        chosen[role] = track
    return chosen


def _can_be(role: str, track: Track) -> bool:
    return track.kind in (Kind.POSE, Kind.TRANSFORMS) if role == "pose" else track.is_image


def choose_color(images: Sequence[Candidate], everything: Sequence[Track]) -> Candidate:
    """The colour camera's channel: most messages within the camera, then the compressed one.

    Raises:
        ChannelError: there is none, or two cameras have an equal claim.
    """
    cameras: dict[tuple[str, ...], list[Candidate]] = defaultdict(list)
    for candidate in images:
        if candidate.nature == "color":
            cameras[candidate.base].append(candidate)
    if not cameras:
        videos = [c for c in images if c.nature == "video"]
        if videos:
            raise ChannelError(
                f"The only camera {videos[0].topic} holds {videos[0].look.name} video, which stsem does not decode; "
                "record or convert it as jpeg, png or raw images.",
                "color",
            )
        there = (
            ", ".join(f"{t.topic} ({t.schema or t.encoding}, {t.count} messages)" for t in everything)
            or "no channel at all"
        )
        raise ChannelError(
            f"The log has no colour images; it has {there}; give --topic color=TOPIC if one of them is.", "color"
        )
    best = [max(group, key=_within_camera) for group in cameras.values()]
    claim = max(candidate.claim for candidate in best)
    rivals = sorted((c for c in best if c.claim == claim), key=lambda c: c.topic)
    if len(rivals) > 1:
        names = ", ".join(f"{c.topic} ({c.track.count} messages)" for c in rivals)
        raise ChannelError(
            f"{len(rivals)} cameras could be the colour camera: {names}; choose one with --topic color=TOPIC.",
            "color",
            tuple(c.topic for c in rivals),
        )
    return rivals[0]


def _within_camera(candidate: Candidate) -> tuple[int, bool, str]:
    return candidate.track.count, candidate.track.kind is Kind.COMPRESSED, candidate.topic


def choose_partner(images: Iterable[Candidate], nature: str, color: Candidate) -> tuple[Candidate | None, str]:
    """(the channel of `nature` "depth" or "labels" nearest to the colour camera, a warning or "").

    Nearest depth: in the colour camera's frame, aligned by name, the longest common beginning of the topic, most
    messages. Labels of classes before those with things, ids before painted ones. At last by name, with a warning.
    """
    found = sorted((c for c in images if c.nature == nature and c.track.count), key=lambda c: c.topic)
    if not found:
        return None, _no_depth(images) if nature == "depth" else ""

    def nearness(c: Candidate) -> tuple[int, ...]:
        same_frame = bool(c.look.frame_id) and c.look.frame_id == color.look.frame_id
        place = topicnames.common(c.base, color.base), c.track.count
        if nature == "labels":
            of_classes = not c.words & (INSTANCE_WORDS | {"panoptic"})
            ids = not c.words & PAINTED_WORDS, c.look.order in ("grey", "metric")
            return (of_classes, *ids, same_frame, *place)
        return (same_frame, bool(c.words & ALIGNED_WORDS), *place)

    return _best(found, nearness, nature)


def _no_depth(images: Iterable[Candidate]) -> str:
    """A remark when a topic says depth and its pixels cannot be: jpeg, 8 bits, colours; "" otherwise."""
    spoilt = (c for c in images if topicnames.told(c.topic) == "depth" and not c.words & DULL_WORDS)
    for c in sorted(spoilt, key=lambda c: c.topic):
        if c.look.order in ("rgb", "bgr", "grey", "spoilt"):
            needed = "depth needs 16 bits or floats of one channel, and is not used"
            return Remark("depth-undecodable", f"{c.topic} says depth, but holds {c.look.name}: {needed}.")
    return ""


def _best(
    found: Sequence[Candidate], key: Callable[[Candidate], tuple[int, ...]], nature: str
) -> tuple[Candidate, str]:
    best = max(found, key=key)
    rivals = [c.topic for c in found if key(c) == key(best)]
    if len(rivals) == 1:
        return best, ""
    return (
        best,
        Remark(
            "choice-unclear",
            f"{', '.join(rivals)} could all be the {nature} channel; {best.topic} is used (--topic {nature}=TOPIC).",
        ),
    )


def choose_calibration(tracks: Iterable[Track], image: Candidate) -> Track | None:
    """The calibration that belongs to an image channel: not another camera's by its name, in the same frame, with the
    longest common beginning of the topic, most messages.

    None when there is none but another camera's: one that names a depth, infrared, left or right camera which the image
    is not, in another frame.
    """

    def foreign(track: Track) -> bool:
        return bool((topicnames.words(track.topic) - image.words) & OTHERS_WORDS)

    def same_frame(track: Track) -> bool:
        return bool(image.look.frame_id) and track.calibrations[0].frame_id == image.look.frame_id

    def nearness(track: Track) -> tuple[bool, bool, int, int]:
        place = topicnames.common(topicnames.parts(track.topic), image.base)
        return not foreign(track), same_frame(track), place, track.count

    found = [track for track in tracks if track.kind is Kind.CALIBRATION and track.calibrations]
    fitting = [track for track in found if same_frame(track) or not foreign(track)]
    return max(sorted(fitting, key=lambda t: t.topic), key=nearness, default=None)


def choose_pose(tracks: Iterable[Track]) -> tuple[Track | None, str]:
    """(the channel of poses to use, a warning that lists its rivals or ""); goals and the like are none.

    Those named as the truth come first, then odometry (which names its child frame), then most messages.
    """

    def claim(track: Track) -> tuple[bool, bool, int]:
        named = any(child for _, child in track.transforms)
        return bool(topicnames.words(track.topic) & TRUTH_WORDS), named, track.count

    found = [
        track for track in tracks
        if track.kind is Kind.POSE and track.transforms and not topicnames.words(track.topic) & NO_POSE_WORDS
    ]  # fmt: skip
    if not found:
        return None, ""
    best, *rivals = sorted(sorted(found, key=lambda t: t.topic), key=claim, reverse=True)
    if not rivals:
        return best, ""
    names = ", ".join(f"{track.topic} ({track.count})" for track in rivals[:RIVALS_NAMED])
    more = f" and {len(rivals) - RIVALS_NAMED} more" if len(rivals) > RIVALS_NAMED else ""
    sentence = f"{best.topic} ({best.count} messages) is used for the pose, not {names}{more} (--topic pose=TOPIC)."
    return best, Remark("choice-unclear", sentence)


def nearest_track(tracks: Iterable[Track], topic: str) -> Track | None:
    """The one of `tracks` whose topic has most in common with `topic`; None of none."""
    names = topicnames.parts(topic)
    return max(
        sorted(tracks, key=lambda t: t.topic),
        key=lambda t: topicnames.common(topicnames.parts(t.topic), names), default=None,
    )  # fmt: skip
