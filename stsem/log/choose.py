"""Which channel is used as what: by schema, by what the first message holds, and by name."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence

from stsem.errors import ChannelError, UsageError
from stsem.log import topicnames
from stsem.log.cameras import other_owner
from stsem.log.candidate import Candidate
from stsem.log.remark import Remark
from stsem.log.schemas.messages import Kind
from stsem.log.topicnames import (
    ALIGNED_WORDS,
    INFRARED_WORDS,
    INSTANCE_WORDS,
    NO_POSE_WORDS,
    PAINTED_WORDS,
    SIDE_WORDS,
    TRUTH_WORDS,
)
from stsem.log.tracks import Track

ROLES = ("color", "depth", "pose", "labels")
OTHERS_WORDS = INFRARED_WORDS | SIDE_WORDS | frozenset({"depth", "disparity"})
"""In the name of a calibration, and not in that of the image: it is that of another camera."""
RIVALS_NAMED = 5


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


def choose_partner(images: Sequence[Candidate], nature: str, color: Candidate) -> tuple[Candidate | None, str]:
    """(the channel of `nature` "depth" or "labels" nearest to the colour camera, a warning or "").

    Nearest depth: not another camera's, in the colour camera's frame, aligned by name, the longest common beginning of
    the topic, most messages. Labels of classes before those with things, ids before painted ones; another camera's are
    none. At last by name, with a warning. Of one topic's transports with as many messages the one that costs least.
    """
    found = sorted((c for c in images if c.nature == nature and c.track.count), key=lambda c: c.topic)
    if not found:
        return None, _no_depth(images) if nature == "depth" else ""
    owners = {c.topic: other_owner(c, color, images) for c in found}

    def nearness(c: Candidate) -> tuple[int, ...]:
        same_frame = c.in_frame_of(color)
        place = topicnames.common(c.base, color.base), c.track.count
        if nature == "labels":
            of_classes = not c.words & (INSTANCE_WORDS | {"panoptic"})
            ids = not c.words & PAINTED_WORDS, c.look.order in ("grey", "metric")
            return (of_classes, *ids, same_frame, *place)
        return (not owners[c.topic], same_frame, bool(c.words & ALIGNED_WORDS), *place)

    if nature == "labels" and all(owners.values()):
        return None, _others_labels(found[0], owners[found[0].topic], color)
    mine = [c for c in found if nature == "depth" or not owners[c.topic]]
    return _best(_channels(mine, nearness), nearness, nature)


def _others_labels(labels: Candidate, owner: Candidate | None, color: Candidate) -> str:
    whose = owner.topic if owner else "another camera"
    sentence = (
        f"{labels.topic} (frame {labels.look.frame_id!r}) belongs to {whose} and not to {color.topic} (frame "
        f"{color.look.frame_id!r}): these labels are not used (--topic labels={labels.topic} uses them all the same)."
    )
    return Remark("truth-other-camera", sentence)


def _channels(found: Iterable[Candidate], key: Callable[[Candidate], tuple[int, ...]]) -> list[Candidate]:
    """One of each channel: the nearest of its transports, of equal ones raw before compressedDepth before a file."""
    channels: dict[tuple[str, ...], list[Candidate]] = defaultdict(list)
    for c in found:
        channels[topicnames.without_transport(c.topic)].append(c)

    def cheapness(c: Candidate) -> tuple[bool, bool]:
        return c.track.kind is Kind.IMAGE, c.topic.lower().endswith("/compresseddepth")

    return [max(group, key=lambda c: (key(c), cheapness(c))) for group in channels.values()]


def _no_depth(images: Iterable[Candidate]) -> str:
    """A remark when a topic says depth and its pixels cannot be: jpeg, 8 bits, colours; "" otherwise."""
    spoilt = (c for c in images if topicnames.told(c.topic) == "depth" and not c.is_dull)
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
