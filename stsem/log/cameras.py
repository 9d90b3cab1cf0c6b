"""Which image channels are one camera: the choice of the colour camera, and whose depth and labels are."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence

from stsem.errors import ChannelError
from stsem.log import topicnames
from stsem.log.candidate import Candidate
from stsem.log.schemas.messages import Kind
from stsem.log.topicnames import COLOUR_WORDS, INFRARED_WORDS, SIDE_WORDS
from stsem.log.tracks import Track

Criteria = tuple[tuple[str, Callable[[Candidate], int]], ...]
"""(why the one with more of it is used, how much of it a channel has), the first that differs decides."""

WITHIN_CAMERA: Criteria = (
    ("neither infrared nor painted", lambda c: not c.is_dull),
    ("in colour", lambda c: 2 if c.in_colour else c.look.order == "grey"),
    ("most messages", lambda c: c.track.count),
    ("in colour", lambda c: not c.is_mosaic),
    ("rectified", lambda c: c.is_rectified),
    ("compressed", lambda c: c.track.kind is Kind.COMPRESSED),
)
AMONG_CAMERAS: Criteria = (
    ("neither infrared nor painted", lambda c: not c.is_dull),
    ("in colour", lambda c: c.in_colour),
    ("by its name", lambda c: bool(c.words & COLOUR_WORDS)),
)
SEEN_TWICE: Criteria = (
    ("by its name", lambda c: c.camera_says_colour),
    ("rectified", lambda c: c.is_rectified),
    ("by its name", lambda c: "raw" not in c.words),
)


def choose_color(images: Sequence[Candidate], everything: Sequence[Track]) -> tuple[Candidate, str]:
    """(the colour camera's channel, why it is that).

    Raises:
        ChannelError: there is none, or two cameras have an equal claim.
    """
    cameras: dict[tuple[str, ...], list[Candidate]] = defaultdict(list)
    for candidate in sorted(images, key=lambda c: c.topic):
        if candidate.nature == "color":
            cameras[candidate.base].append(candidate)
    if not cameras:
        raise _no_color(images, everything)
    if len(cameras) == 1:
        (group,) = cameras.values()
        return _first(group, WITHIN_CAMERA)
    best = [_first(group, WITHIN_CAMERA)[0] for group in cameras.values()]
    chosen, why = _first(best, AMONG_CAMERAS)
    rivals = [c for c in best if c.claim == chosen.claim]
    left = _without_twins(rivals)
    if len(left) > 1:
        names = ", ".join(f"{c.topic} ({c.track.count} messages)" for c in left)
        raise ChannelError(
            f"{len(left)} cameras could be the colour camera: {names}; choose one with --topic color=TOPIC.",
            "color",
            tuple(c.topic for c in left),
        )
    return left[0], why if len(rivals) == 1 else "by its name"


def _no_color(images: Sequence[Candidate], everything: Sequence[Track]) -> ChannelError:
    videos = [c for c in images if c.nature == "video"]
    if videos:
        return ChannelError(
            f"The only camera {videos[0].topic} holds {videos[0].look.name} video, which stsem does not decode; "
            "record or convert it as jpeg, png or raw images.",
            "color",
        )
    there = ", ".join(f"{t.topic} ({t.schema or t.encoding}, {t.count} messages)" for t in everything)
    return ChannelError(
        f"The log has no colour images; it has {there or 'no channel at all'}; give --topic color=TOPIC if one of them "
        "is.",
        "color",
    )


def _first(candidates: Sequence[Candidate], criteria: Criteria) -> tuple[Candidate, str]:
    """(the first by `criteria`, and by topic where nothing tells; what puts it before the second)."""

    def rank(candidate: Candidate) -> tuple[int, ...]:
        return tuple(of(candidate) for _, of in criteria)

    best, *others = sorted(candidates, key=rank, reverse=True)
    if not others:
        return best, "only one"
    pairs = zip(criteria, rank(best), rank(others[0]), strict=True)
    return best, next((why for (why, _), mine, theirs in pairs if mine != theirs), "by its name")


def _without_twins(rivals: Sequence[Candidate]) -> list[Candidate]:
    """`rivals` without those that show once more what one of them shows, and without the other eye of that pair.

    Topics of one device with images of one frame and size are one camera seen twice. When it is sent as `rgb` too, that
    says which eye of a stereo camera stands for colour.
    """
    left = list(rivals)
    for one in (c for c in rivals if c.camera_says_colour):
        twins = [c for c in left if c is not one and _is_twin(c, one)]
        if one not in left or any(_rank(c) >= _rank(one) for c in twins):
            continue
        has_sides = any(_side(c) for c in twins)
        left = [
            c for c in left
            if c is one or not (c in twins or (has_sides and not _side(one) and _side(c) and _of_one_device(c, one)))
        ]  # fmt: skip
    return left


def _rank(candidate: Candidate) -> tuple[int, ...]:
    return tuple(of(candidate) for _, of in SEEN_TWICE)


def _is_twin(a: Candidate, b: Candidate) -> bool:
    same_size = a.look.size is not None and a.look.size == b.look.size
    return same_size and a.in_frame_of(b) and _of_one_device(a, b)


def _of_one_device(a: Candidate, b: Candidate) -> bool:
    return a.base[:-1] == b.base[:-1]


def _side(candidate: Candidate) -> bool:
    return bool(candidate.words & SIDE_WORDS)


def other_owner(image: Candidate, color: Candidate, images: Iterable[Candidate]) -> Candidate | None:
    """The camera that a channel of depth or labels belongs to, if it is another one than colour's; None otherwise.

    It is another's when it names that one's frame, or stands below its topic or beside it, where colour does not. What
    names colour's frame is colour's. Infrared cameras are part of depth cameras.
    """
    if image.in_frame_of(color):
        return None
    others = [
        c for c in images
        if c.nature in ("color", "video") and c.base != color.base and c is not image and not c.in_frame_of(color)
    ]  # fmt: skip
    others = [c for c in others if image.nature == "labels" or not c.words & INFRARED_WORDS]
    shared = topicnames.common(image.base, color.base)

    def near(c: Candidate) -> int:
        return topicnames.common(image.base, c.base)

    in_frame = [c for c in others if image.in_frame_of(c)]
    by_topic = [c for c in others if not c.is_dull and near(c) > shared and near(c) >= len(c.base) - 1]
    return max(sorted(in_frame or by_topic, key=lambda c: c.topic), key=near, default=None)
