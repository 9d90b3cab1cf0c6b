"""Poses of a topic of their own: odometry, whose child frame is named, and stamped poses, whose child is not."""

from collections.abc import Iterable, Sequence

import numpy as np

from stsem.log.poses.body import BODY_OPTICAL, is_body_name, looks_like_body_frame
from stsem.log.poses.edges import Edge, clean, moving_edge
from stsem.log.poses.source import PoseSource
from stsem.log.poses.tree import FrameTree
from stsem.log.remark import Remark
from stsem.log.tracks import Track
from stsem.pose import Pose, Trajectory


def topic_poses(track: Track, tree: FrameTree, camera_frame: str) -> tuple[PoseSource | None, list[str]]:
    """(source of a channel of poses, warnings); of poses of several pairs of frames, those of the pair with most.

    A pose of a named frame is brought to the camera by the transforms below that frame; one of no name is taken as that
    of the camera's optical frame.
    """
    warnings: list[str] = []
    (parent, child), samples = max(track.transforms.items(), key=lambda item: (len(item[1]), item[0]))
    if len(track.transforms) > 1:
        names = ", ".join(sorted({repr(frame) for frame, _ in track.transforms}))
        sentence = f"The poses of {track.topic} are in several frames ({names}); those in {parent!r} are used."
        warnings.append(Remark("pose-frames", sentence))
    what = f"poses of {track.topic}"
    edge, said = moving_edge(clean(samples, what), track.topic, what)
    warnings += said
    if edge is None:
        return None, warnings
    child, camera_frame = child.lstrip("/"), camera_frame.lstrip("/")
    if not child:
        if looks_like_body_frame(edge.trajectory):
            sentence = (
                f"The poses of {track.topic} move along their own x axis with z upright, as a robot's body does and a "
                "camera's optical frame (z forward) does not; they are used as they are: log the transform from the "
                "body to the camera, and odometry that names its child frame."
            )
            warnings.append(Remark("pose-body-frame", sentence))
        return PoseSource(track.topic, (parent, "camera"), (edge,), by_chain=False), warnings
    frames, edges, said = _down_to_camera(tree, child, camera_frame, track.topic)
    return PoseSource(track.topic, (parent, *frames), (edge, *edges), by_chain=False), warnings + said


def _down_to_camera(
    tree: FrameTree, child: str, camera_frame: str, topic: str
) -> tuple[tuple[str, ...], list[Edge], list[str]]:
    """(frames from `child` on, edges between them, warnings)."""
    if child == camera_frame:
        return (child,), [], []
    frames, loop = tree.chain(camera_frame)
    if child in frames and not loop:
        below = frames[frames.index(child) :]
        edges, warnings = tree.edges(below)
        if known := _all(edges):
            return below, known, warnings
    elif (aside := tree.static_transform(child, camera_frame)) is not None:
        return (child, camera_frame), [_constant(aside, f"{child} -> {camera_frame}")], []
    begin = f"{topic} gives the pose of {child!r}, and no transform leads from there to the camera's frame "
    if is_body_name(child):
        sentence = f"{begin}{camera_frame!r}: the camera is taken to sit in {child!r} and to look along its x axis."
        forward = _constant(BODY_OPTICAL, "body -> optical")
        return (child, "camera"), [forward], [Remark("pose-body-frame", sentence)]
    sentence = f"{begin}{camera_frame!r}: {child!r} is taken as the camera's optical frame."
    return (child,), [], [Remark("pose-body-frame", sentence)]


def _all(edges: Iterable[Edge | None]) -> list[Edge] | None:
    """The edges if none of them is missing."""
    every: Sequence[Edge | None] = list(edges)
    known = [edge for edge in every if edge is not None]
    return known if len(known) == len(every) else None


def _constant(pose: Pose, name: str) -> Edge:
    zero = np.zeros(1, np.int64)
    return Edge(Trajectory(zero, pose[None]), zero, static=True, name=name)
