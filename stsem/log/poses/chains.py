"""Poses by a chain of transforms, from the root of the tree down to the camera's frame."""

from collections.abc import Iterable
from itertools import pairwise

from stsem.log.poses.source import PoseSource
from stsem.log.poses.tree import FrameTree
from stsem.log.remark import Remark
from stsem.log.tracks import Track

MAX_NAMES = 20


def transform_chain(tracks: Iterable[Track], camera_frame: str) -> tuple[PoseSource | None, list[str]]:
    """(source by the chain of transforms from the root of the tree to `camera_frame`, warnings).

    None when the frame is not in the tree, runs in a circle, or nothing in its chain moves.
    """
    return chain_to(FrameTree(tracks), camera_frame.lstrip("/"))


def chain_to(tree: FrameTree, camera_frame: str) -> tuple[PoseSource | None, list[str]]:
    """`transform_chain` of a tree that is already there."""
    frames, loop = tree.chain(camera_frame)
    if loop:
        sentence = f"The transforms run in a circle through {camera_frame!r}: poses are not used."
        return None, [Remark("pose-tree", sentence)]
    edges, warnings = tree.edges(frames)
    if edges and all(edge is not None and edge.static for edge in edges):
        edges, warnings = tree.edges(frames, still=True)
    known = [edge for edge in edges if edge is not None]
    if len(known) < len(edges):
        sentence = f"The chain of transforms to {camera_frame!r} has a link without any transform."
        return None, [*warnings, Remark("pose-tree", sentence)]
    moving = [pair for pair, edge in zip(pairwise(frames), known, strict=True) if not edge.static]
    if not moving:
        sentence = (
            f"No transform moves the camera's frame {camera_frame!r} (frames known: {_names(tree)}): "
            "the transforms give no poses."
        )
        return None, [*warnings, Remark("pose-tree", sentence)]
    topic = tree.topic(max(moving, key=tree.count))
    return PoseSource(topic, frames, tuple(known), by_chain=True), warnings


def _names(tree: FrameTree) -> str:
    names = [*tree.frames[:MAX_NAMES], *(["..."] if len(tree.frames) > MAX_NAMES else [])]
    return ", ".join(names) or "none"
