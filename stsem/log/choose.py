"""Which channel is used as what: by schema, by what the first message holds, and by name."""

import difflib
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from stsem.errors import ChannelError, UsageError
from stsem.log.pixels.look import Look
from stsem.log.schemas.messages import Kind
from stsem.log.tracks import IMAGES, Track

ROLES = ("color", "depth", "pose", "labels")
TRANSPORTS = frozenset({"compressed", "compresseddepth", "raw", "theora", "ffmpeg", "zstd", "draco"})
LABEL_WORDS = ("label", "semantic", "segment", "seg", "class", "annotation", "mask", "groundtruth")
DEPTH_WORDS = ("depth", "disparity")
COLOUR_WORDS = frozenset({"color", "colour", "rgb", "bgr"})
DULL_WORDS = frozenset(
    {"infra", "infra1", "infra2", "ir", "thermal", "confidence", "debug", "overlay", "visualization"}
)
REGISTERED_WORDS = frozenset({"aligned", "registered", "rect"})
POSE_EXCLUDED = frozenset({"goal", "target", "initial", "initialpose", "setpoint", "waypoint"})


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
        return frozenset(re.findall(r"[a-z]+\d*|\d+", re.sub(r"([a-z])([A-Z])", r"\1_\2", self.topic).lower()))

    @property
    def nature(self) -> str:
        """What it looks like: "color", "depth", "labels", "video" or ""."""
        named_labels = any(word.startswith(LABEL_WORDS) for word in self.words)
        named_depth = any(word.startswith(DEPTH_WORDS) for word in self.words)
        order = self.look.order
        if order == "metric":
            return "labels" if named_labels and self.look.bits == 16 else "depth"
        if order in ("rgb", "bgr", "grey"):
            return "labels" if named_labels else "" if named_depth else "color"
        if order == "unknown":
            return "labels" if named_labels else "depth" if named_depth else "color"
        return order

    @property
    def base(self) -> tuple[str, ...]:
        """The camera it belongs to: the topic without transport and without image_*."""
        parts = [part for part in self.topic.split("/") if part]
        while len(parts) > 1 and parts[-1].lower() in TRANSPORTS:
            parts.pop()
        if len(parts) > 1 and parts[-1].lower().startswith("image"):
            parts.pop()
        return tuple(parts)

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
            raise ChannelError(f"The log has no topic {topic!r} for {role}; it has {_nearest_first(topic, tracks)}.")
        kinds = (Kind.POSE, Kind.TRANSFORMS) if role == "pose" else IMAGES
        track = max(fitting, key=lambda t: (t.kind in kinds, t.count))
        if track.kind not in kinds:
            what = "poses or transforms" if role == "pose" else "images"
            raise ChannelError(
                f"{topic} was given for {role}, which needs {what}, but it holds {track.schema or 'no schema'} "
                f"({track.encoding}); {track.trouble or 'choose another topic'}."
            )
        chosen[role] = track
    return chosen


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
                "record or convert it as jpeg, png or raw images."
            )
        there = (
            ", ".join(f"{t.topic} ({t.schema or t.encoding}, {t.count} messages)" for t in everything)
            or "no channel at all"
        )
        raise ChannelError(f"The log has no colour images; it has {there}; give --topic color=TOPIC if one of them is.")
    best = [max(group, key=_within_camera) for group in cameras.values()]
    claim = max(candidate.claim for candidate in best)
    rivals = sorted((c for c in best if c.claim == claim), key=lambda c: c.topic)
    if len(rivals) > 1:
        names = ", ".join(f"{c.topic} ({c.track.count} messages)" for c in rivals)
        raise ChannelError(
            f"{len(rivals)} cameras could be the colour camera: {names}; choose one with --topic color=TOPIC."
        )
    return rivals[0]


def _within_camera(candidate: Candidate) -> tuple[int, bool, str]:
    return candidate.track.count, candidate.track.kind is Kind.COMPRESSED, candidate.topic


def choose_partner(images: Iterable[Candidate], nature: str, color: Candidate) -> tuple[Candidate | None, str]:
    """(the channel of `nature` "depth" or "labels" nearest to the colour camera, a warning or "").

    Nearest: in the colour camera's frame, registered by name, the longest common beginning of the topic, the same
    base, most messages; at last by name, with a warning.
    """
    found = [c for c in images if c.nature == nature and c.track.count]
    if not found:
        return None, ""

    def nearness(c: Candidate) -> tuple[bool, bool, int, int]:
        same_frame = bool(c.look.frame_id) and c.look.frame_id == color.look.frame_id
        return same_frame, bool(c.words & REGISTERED_WORDS), _common(c.base, color.base), c.track.count

    return _best(found, nearness, nature)


def _best(
    found: Sequence[Candidate], key: Callable[[Candidate], tuple[int, ...]], nature: str
) -> tuple[Candidate, str]:
    ordered = sorted(found, key=lambda c: c.topic)
    best = max(ordered, key=key)
    rivals = [c.topic for c in ordered if key(c) == key(best)]
    warning = ""
    if len(rivals) > 1:
        warning = (
            f"{', '.join(rivals)} could all be the {nature} channel; {best.topic} is used (--topic {nature}=TOPIC)."
        )
    return best, warning


def choose_calibration(tracks: Iterable[Track], color: Candidate) -> Track | None:
    """The calibration that belongs to the colour camera: same frame, longest common topic, not another image's."""
    found = [track for track in tracks if track.kind is Kind.CALIBRATION and track.calibrations]
    color_is_depth = any(word.startswith(DEPTH_WORDS) for word in color.words)

    def nearness(track: Track) -> tuple[bool, bool, int, int]:
        same_frame = track.calibrations[0].frame_id == color.look.frame_id
        other = any(word in track.topic.lower() for word in DEPTH_WORDS) and not color_is_depth
        parts = tuple(part for part in track.topic.split("/") if part)
        return not other, same_frame, _common(parts, color.base), track.count

    return max(sorted(found, key=lambda t: t.topic), key=nearness, default=None)


def choose_pose(tracks: Iterable[Track]) -> tuple[Track | None, str]:
    """(the channel of stamped poses with most messages, a warning or ""); goals and the like are none."""
    found = sorted(
        (t for t in tracks if t.kind is Kind.POSE and t.transforms and not _words(t.topic) & POSE_EXCLUDED),
        key=lambda t: (-t.count, t.topic),
    )
    if not found:
        return None, ""
    if len(found) > 1 and found[1].count == found[0].count:
        return found[
            0
        ], f"{found[0].topic} and {found[1].topic} could both be the pose; the first is used (--topic pose=TOPIC)."
    return found[0], ""


def _words(topic: str) -> frozenset[str]:
    return frozenset(re.findall(r"[a-z]+", topic.lower()))


def _common(a: Sequence[str], b: Sequence[str]) -> int:
    """Length of the common beginning."""
    same = 0
    for x, y in zip(a, b, strict=False):
        if x != y:
            break
        same += 1
    return same


def _nearest_first(topic: str, tracks: Sequence[Track]) -> str:
    names = sorted({track.topic for track in tracks})
    names.sort(key=lambda name: -difflib.SequenceMatcher(None, topic, name).ratio())
    return ", ".join(names) or "no topic at all"


def nearest_track(tracks: Iterable[Track], topic: str) -> Track | None:
    """The one of `tracks` whose topic has most in common with `topic`; None of none."""
    parts = topic.split("/")
    return max(sorted(tracks, key=lambda t: t.topic), key=lambda t: _common(t.topic.split("/"), parts), default=None)
