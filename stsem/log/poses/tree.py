"""The tree of frames that a log's transforms make, and what can be composed along it."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from functools import cached_property, reduce
from itertools import pairwise, takewhile

import numpy as np

from stsem.log.poses.edges import Cleaned, Edge, clean, moving_edge, static_edge
from stsem.log.remark import Remark
from stsem.log.schemas.messages import Kind
from stsem.log.tracks import Samples, Track
from stsem.pose import Pose, inverse

MAX_DEPTH = 100
MAX_STATIC_CHANGES = 10
"""A transform on tf_static that changes more often than this is a moving one on the wrong topic."""
STATIC_SUFFIX = "tf_static"
MAX_PARENTS_NAMED = 5
Pair = tuple[str, str]


def is_static(track: Track) -> bool:
    """Whether the transforms of a channel hold for all times."""
    return track.topic.rstrip("/").endswith(STATIC_SUFFIX)


def static_transform(tracks: Iterable[Track], target_frame: str, source_frame: str) -> Pose | None:
    """T_target_source (4, 4), metres: maps points of `source_frame` into `target_frame`, composed of static edges.

    An edge is static when it is on a tf_static channel, or when all of its samples are equal. None when a frame has no
    name, the frames are not in one tree, or something between them moves. `tracks` may be all of a log; only transforms
    are looked at.
    """
    if not (target_frame and source_frame):
        return None
    transforms = [track for track in tracks if track.kind is Kind.TRANSFORMS]
    return FrameTree(transforms).static_transform(target_frame.lstrip("/"), source_frame.lstrip("/"))


class FrameTree:
    """Parent of each frame, and the edges between them.

    Static transforms hold for all times, whenever they were stamped or logged. A frame with several parents keeps the
    one with the most samples; a pair of frames that is on several channels is that of the channel with most.

    Attributes:
        parents: child -> parent.
    """

    def __init__(self, tracks: Iterable[Track]) -> None:
        self._moving: dict[Pair, Samples] = {}
        self._static: dict[Pair, Samples] = {}
        self._cleaned: dict[Pair, Cleaned] = {}
        self._topics: dict[Pair, str] = {}
        for track in sorted(tracks, key=is_static, reverse=True):
            target = self._static if is_static(track) else self._moving
            for (parent, child), samples in track.transforms.items():
                pair = parent.lstrip("/"), child.lstrip("/")
                if pair[1] and (pair not in target or len(samples) > len(target[pair])):
                    target[pair], self._topics[pair] = samples, track.topic
        self._votes = _vote(self._moving, self._static)
        self.parents = {child: max(sorted(given), key=given.__getitem__) for child, given in self._votes.items()}

    @cached_property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames, sorted."""
        return tuple(sorted({*self.parents, *self.parents.values()}))

    def chain(self, frame: str) -> tuple[tuple[str, ...], bool]:
        """(frames from the root down to `frame`, whether they run in a circle)."""
        frames, seen = [frame], {frame}
        while (parent := self.parents.get(frames[-1])) is not None:
            if parent in seen or len(frames) > MAX_DEPTH:
                return tuple(reversed(frames)), True
            frames.append(parent)
            seen.add(parent)
        return tuple(reversed(frames)), False

    def static_transform(self, target: str, source: str) -> Pose | None:
        """T_target_source as `static_transform` gives it."""
        down, down_loops = self.chain(source)
        up, up_loops = self.chain(target)
        if down_loops or up_loops or down[0] != up[0]:
            return None
        fork = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(up, down, strict=False))) - 1
        to_target, to_source = self._fixed(up[fork:]), self._fixed(down[fork:])
        return None if to_target is None or to_source is None else inverse(to_target) @ to_source

    def edges(self, frames: tuple[str, ...], *, still: bool = False) -> tuple[list[Edge | None], list[str]]:
        """(T_{frames[i]}_{frames[i+1]} along a chain, None where no sample is a transform, warnings).

        A pair is static when its moving samples are all equal, too (many loggers repeat static transforms on tf),
        unless `still`: then they are those of something that does not move while it was recorded.
        """
        edges: list[Edge | None] = []
        warnings: list[str] = []
        for pair in pairwise(frames):
            if len(given := self._votes[pair[1]]) > 1:
                rivals = ", ".join(sorted(given)[:MAX_PARENTS_NAMED])
                sentence = f"The frame {pair[1]!r} has several parents ({rivals}); {pair[0]!r} is used."
                warnings.append(Remark("pose-tree", sentence))
            edge, said = self._edge(pair, still=still)
            edges.append(edge)
            warnings += said
        return edges, warnings

    def topic(self, pair: Pair) -> str:
        """Topic of the channel that gives T_parent_child."""
        return self._topics[pair]

    def count(self, pair: Pair) -> int:
        """How many samples of T_parent_child there are."""
        return len((self._moving if pair in self._moving else self._static)[pair])

    def _fixed(self, frames: tuple[str, ...]) -> Pose | None:
        """T_{frames[0]}_{frames[-1]} when every edge of the chain is static; None otherwise."""
        edges, _ = self.edges(frames)
        poses = [edge.trajectory.poses[0] for edge in edges if edge is not None and edge.static]
        return reduce(np.matmul, poses, np.eye(4)) if len(poses) == len(edges) else None

    def _edge(self, pair: Pair, *, still: bool) -> tuple[Edge | None, list[str]]:
        moving, name = pair in self._moving, f"{pair[0]} -> {pair[1]}"
        what = f"transforms {name}"
        if pair not in self._cleaned:
            self._cleaned[pair] = clean(self._moving[pair] if moving else self._static[pair], what)
        cleaned = self._cleaned[pair]
        changes = cleaned.distinct() - 1
        if changes <= 0 and not (moving and still):
            return static_edge(cleaned, name), list(cleaned.warnings)
        if moving:
            return moving_edge(cleaned, name, what)
        if changes > MAX_STATIC_CHANGES:
            edge, warnings = moving_edge(cleaned, name, what)
            sentence = f"The static transform {name} changes {changes} times: taken as a moving one."
            return edge, [*warnings, Remark("pose-static", sentence)]
        sentence = f"The static transform {name} changes {changes} times; the last one holds for the whole log."
        return static_edge(cleaned, name), [*cleaned.warnings, Remark("pose-static", sentence)]


def _vote(moving: Mapping[Pair, Samples], static: Mapping[Pair, Samples]) -> dict[str, dict[str, int]]:
    """child -> parent -> how many samples say so."""
    votes: dict[str, dict[str, int]] = defaultdict(dict)
    for (parent, child), samples in (*static.items(), *moving.items()):
        votes[child][parent] = votes[child].get(parent, 0) + len(samples)
    return votes
