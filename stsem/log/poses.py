"""Where the camera was: stamped poses, or a chain of transforms up to the root of the tree.

Everything is interpolated (linear, slerp) between samples at most MAX_GAP_NS apart and never extrapolated; a chain is
composed of its edges, each looked up at the stamp, as tf2 does it.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise

import numpy as np

from stsem.log.tracks import Float64, Int64, Samples, Track
from stsem.pose import Pose, Trajectory, rotation

MAX_GAP_NS = 150_000_000
MAX_DEPTH = 100
MIN_QUATERNION = 1e-9
STATIC_SUFFIX = "tf_static"


@dataclass(frozen=True)
class Edge:
    """T_parent_child over time.

    Args:
        trajectory: its samples; a static edge has one, which holds always.
        log_ns: (n,) log times of the samples.
        static: whether it holds always.
    """

    trajectory: Trajectory
    log_ns: Int64
    static: bool = False


@dataclass(frozen=True)
class PoseLookup:
    """A pose and the log time of the latest message that it needs."""

    T_WC: Pose
    log_ns: int


@dataclass(frozen=True)
class PoseSource:
    """The camera's pose as a chain of edges from the world to the camera's optical frame; one edge for stamped poses.

    Args:
        topic: of the channel that the moving edges come from.
        frames: names of the frames along the chain, the world first.
        edges: T_{frames[i]}_{frames[i+1]}.
        by_chain: whether it is a chain of transforms.
    """

    topic: str
    frames: tuple[str, ...]
    edges: tuple[Edge, ...]
    by_chain: bool

    def at(self, stamp_ns: int) -> PoseLookup | None:
        """T_WC at `stamp_ns`; None when an edge has no two samples close enough around it."""
        poses: list[Pose] = []
        latest: int | None = None
        for edge in self.edges:
            if edge.static:
                poses.append(edge.trajectory.poses[0])
                continue
            sample = edge.trajectory.at(stamp_ns, MAX_GAP_NS)
            if sample is None:
                return None
            poses.append(sample.T_WC)
            log_ns = int(edge.log_ns[sample.later])
            latest = log_ns if latest is None else max(latest, log_ns)
        return None if latest is None else PoseLookup(reduce(np.matmul, poses), latest)

    def stamps_ns(self) -> Int64:
        """Ascending union of the stamps of the moving edges."""
        return np.unique(np.concatenate([e.trajectory.stamps_ns for e in self.edges if not e.static]))

    def trajectory(self) -> Trajectory:
        """T_WC at every stamp of `stamps_ns` at which the whole chain is known."""
        moving = [edge for edge in self.edges if not edge.static]
        if len(moving) == 1:
            factors = [e.trajectory.poses[0] if e.static else e.trajectory.poses for e in self.edges]
            return Trajectory(moving[0].trajectory.stamps_ns, reduce(np.matmul, factors))
        known = [(int(stamp), found.T_WC) for stamp in self.stamps_ns() if (found := self.at(int(stamp)))]
        stamps = np.array([stamp for stamp, _ in known], np.int64)
        return Trajectory(stamps, np.array([pose for _, pose in known], np.float64).reshape(-1, 4, 4))

    def offset_ns(self) -> int:
        """Smallest (log time - stamp) of the moving edges' samples."""
        return min(int((e.log_ns - e.trajectory.stamps_ns).min()) for e in self.edges if not e.static)


def stamped_poses(track: Track) -> tuple[PoseSource | None, list[str]]:
    """(source of a channel of poses, warnings); the pose is taken as that of the camera's optical frame.

    Of poses in several frames, those in the frame with the most count.
    """
    warnings: list[str] = []
    (parent, _), samples = max(track.transforms.items(), key=lambda item: (len(item[1]), item[0]))
    if len(track.transforms) > 1:
        frames = ", ".join(sorted(repr(frame) for frame, _ in track.transforms))
        warnings.append(f"The poses of {track.topic} are in several frames ({frames}); those in {parent!r} are used.")
    edge, bad = _edge(samples)
    if bad:
        warnings.append(f"{bad} poses of {track.topic} are no poses (not finite, or a zero quaternion): left out.")
    if edge is None:
        return None, warnings
    return PoseSource(track.topic, (parent, "camera"), (edge,), by_chain=False), warnings


def transform_chain(tracks: Iterable[Track], camera_frame: str) -> tuple[PoseSource | None, list[str]]:
    """(source by the chain of transforms from the root of the tree to `camera_frame`, warnings).

    Static transforms hold for all times, whenever they were stamped or logged. A frame with several parents keeps the
    one with the most samples. None when the frame is not in the tree or nothing in its chain moves.
    """
    moving, static = _collect(tracks)
    parents, warnings = _parents(moving, static)
    frames, loop = _chain(parents, camera_frame.lstrip("/"))
    if loop:
        return None, [f"The transforms run in a circle through {camera_frame!r}: poses are not used."]
    edges: list[Edge] = []
    for pair in pairwise(frames):
        edge, bad = _edge(moving[pair]) if pair in moving else _static_edge(static[pair])
        if bad:
            warnings.append(f"{bad} transforms {pair[0]} -> {pair[1]} are no transforms and are left out.")
        if edge is None:
            return None, warnings
        edges.append(edge)
    if all(edge.static for edge in edges):
        known = ", ".join(sorted(parents)) or "none"
        return None, [
            *warnings,
            f"No transform moves the camera's frame {camera_frame!r} (frames known: {known}): no poses.",
        ]
    topic = max((t for t in tracks if not is_static(t)), key=lambda t: t.count).topic
    return PoseSource(topic, frames, tuple(edges), by_chain=True), warnings


def is_static(track: Track) -> bool:
    """Whether the transforms of a channel hold for all times."""
    return track.topic.rstrip("/").endswith(STATIC_SUFFIX)


Pair = tuple[str, str]


def _collect(tracks: Iterable[Track]) -> tuple[dict[Pair, Samples], dict[Pair, Samples]]:
    """(moving, static) samples by pair; a pair that is on several channels is that of the one with most."""
    moving: dict[Pair, Samples] = {}
    static: dict[Pair, Samples] = {}
    for track in tracks:
        target = static if is_static(track) else moving
        for pair, samples in track.transforms.items():
            if pair not in target or len(samples) > len(target[pair]):
                target[pair] = samples
    return moving, static


def _parents(moving: Mapping[Pair, Samples], static: Mapping[Pair, Samples]) -> tuple[dict[str, str], list[str]]:
    votes: dict[str, dict[str, int]] = defaultdict(dict)
    for (parent, child), samples in (*static.items(), *moving.items()):
        votes[child][parent] = votes[child].get(parent, 0) + len(samples)
    parents = {child: max(sorted(given), key=given.__getitem__) for child, given in votes.items()}
    warnings = [
        f"The frame {child!r} has several parents ({', '.join(sorted(given))}); {parents[child]!r} is used."
        for child, given in sorted(votes.items()) if len(given) > 1
    ]  # fmt: skip
    return parents, warnings


def _chain(parents: Mapping[str, str], frame: str) -> tuple[tuple[str, ...], bool]:
    """(frames from the root down to `frame`, whether they run in a circle)."""
    frames = [frame]
    while (parent := parents.get(frames[-1])) is not None:
        if parent in frames or len(frames) > MAX_DEPTH:
            return tuple(reversed(frames)), True
        frames.append(parent)
    return tuple(reversed(frames)), False


def _static_edge(samples: Samples) -> tuple[Edge | None, int]:
    """The last static transform of a pair holds."""
    stamps, logs, poses, bad = _good(samples)
    if not len(stamps):
        return None, bad
    return Edge(Trajectory(stamps[-1:], poses[-1:]), logs[-1:], static=True), bad


def _edge(samples: Samples) -> tuple[Edge | None, int]:
    """(edge with strictly ascending stamps, samples that are no transforms); of equal stamps the first counts."""
    stamps, logs, poses, bad = _good(samples)
    if not len(stamps):
        return None, bad
    unique, first = np.unique(stamps, return_index=True)
    return Edge(Trajectory(unique, poses[first]), logs[first]), bad


def _good(samples: Samples) -> tuple[Int64, Int64, Float64, int]:
    """(stamps, log times, (n, 4, 4) poses, how many were left out): finite ones with a quaternion of some length."""
    stamps, logs, t, q = samples.arrays()
    norm = np.linalg.norm(q, axis=1)
    good = np.isfinite(t).all(axis=1) & np.isfinite(norm) & (norm >= MIN_QUATERNION)
    poses = np.tile(np.eye(4), (int(good.sum()), 1, 1))
    poses[:, :3, :3] = rotation(q[good] / norm[good, None])
    poses[:, :3, 3] = t[good]
    return stamps[good], logs[good], poses, int((~good).sum())
