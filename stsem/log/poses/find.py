"""Where the poses of a log come from: a chain of transforms to the camera, else odometry, else stamped poses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from stsem.log.choose import choose_pose
from stsem.log.poses.chains import chain_to
from stsem.log.poses.edges import Edge
from stsem.log.poses.jumps import Jump, mark_jumps
from stsem.log.poses.source import MAX_GAP_NS, PoseSource
from stsem.log.poses.topics import topic_poses
from stsem.log.poses.tree import FrameTree
from stsem.log.remark import Remark
from stsem.log.schemas.messages import Kind
from stsem.log.tracks import Int64, Track

FEW_FRAMES, SMALL_SHARE = 2, 0.01
"""So many frames at the ends of a log may lack a pose without a word."""


def find_poses(
    tracks: Sequence[Track], asked: Track | None, camera_frame: str, color_stamps_ns: Int64
) -> tuple[PoseSource | None, list[str]]:
    """(the source of the camera's poses, with its jumps marked, or None; warnings).

    Args:
        tracks: all of the log.
        asked: the channel that was asked for; None to choose.
        camera_frame: frame_id of the colour images.
        color_stamps_ns: (n,) ascending; warnings count times from the first, and frames without a pose.
    """
    transforms = [track for track in tracks if track.kind is Kind.TRANSFORMS and track.transforms]
    tree = FrameTree(transforms)
    source: PoseSource | None = None
    warnings: list[str] = []
    if transforms and (asked is None or asked.kind is Kind.TRANSFORMS):
        source, warnings = chain_to(tree, camera_frame.lstrip("/"))
    if source is None:
        track, said = (asked, "") if asked else choose_pose(tracks)
        if asked and not asked.transforms:
            sentence = f"{asked.topic} was asked for as the pose, but none of its messages can be read."
            warnings.append(Remark("pose-unreadable", sentence))
        if track is not None and track.kind is Kind.POSE and track.transforms:
            source, more = topic_poses(track, tree, camera_frame)
            warnings = ([] if source else warnings) + ([said] if said else []) + more
    if source is None:
        return None, warnings
    edges, jumps = mark_jumps(source.edges)
    source = replace(source, edges=edges)
    return source, warnings + _jump_warning(jumps, color_stamps_ns) + _gap_warning(source, color_stamps_ns)


def _jump_warning(jumps: Sequence[Jump], color_stamps_ns: Int64) -> list[str]:
    if not jumps:
        return []
    far = max(jumps, key=lambda jump: (jump.metres, jump.degrees))
    seconds = (far.stamp_ns - int(color_stamps_ns[0])) / 1e9 if len(color_stamps_ns) else 0.0
    times = "once" if len(jumps) == 1 else f"{len(jumps)} times, the farthest"
    sentence = (
        f"The pose jumps {times} by {far.metres:.2f} m and {far.degrees:.0f} degrees at t = {seconds:.3f} s "
        f"({far.edge}); between the samples around a jump it is unknown."
    )
    return [Remark("pose-jumps", sentence)]


def _gap_warning(source: PoseSource, stamps_ns: Int64) -> list[str]:
    """How many frames have no pose, and why."""
    missing = ~source.times(stamps_ns).known
    count = int(missing.sum())
    if count <= max(FEW_FRAMES, SMALL_SHARE * len(stamps_ns)) and count < len(stamps_ns):
        return []
    if not count:
        return []
    reasons = []
    for edge in source.moving:
        outside, gaps = _reasons(edge, stamps_ns[missing])
        if outside.any():
            reasons.append(f"{int(outside.sum())} lie before the first or behind the last sample of {edge.name}")
        if gaps.any():
            period_ms = float(np.median(np.diff(edge.trajectory.stamps_ns))) / 1e6
            reasons.append(
                f"{int(gaps.sum())} lie between samples of {edge.name} that are more than {MAX_GAP_NS // 10**6} ms "
                f"apart (it comes every {period_ms:.0f} ms)"
            )
    why = "; ".join(reasons) or "they lie where the pose jumps"
    return [Remark("pose-missing", f"{count} of {len(stamps_ns)} frames have no pose: {why}{_slow_edge(source)}.")]


def _slow_edge(source: PoseSource) -> str:
    """What to do where one edge of a chain comes too seldom for all the others."""
    period = {e.name: float(np.median(np.diff(e.trajectory.stamps_ns))) for e in source.moving if len(e.trajectory) > 1}
    slow = [name for name, ns in period.items() if ns > MAX_GAP_NS]
    if not slow or len(slow) == len(period):
        return ""
    quick = min(period, key=period.__getitem__)
    return (
        f"; {quick} comes every {period[quick] / 1e6:.0f} ms, so raise the rate of {' and '.join(slow)}, or record "
        "odometry and take it with --topic pose=TOPIC"
    )


def _reasons(edge: Edge, stamps_ns: Int64) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """((n,) whether outside the edge's samples, (n,) whether in a gap between them)."""
    samples = edge.trajectory.stamps_ns
    outside = (stamps_ns < samples[0]) | (stamps_ns > samples[-1])
    found = edge.trajectory.brackets(stamps_ns, MAX_GAP_NS)
    wide = samples[found.later] - samples[found.earlier] > MAX_GAP_NS
    return outside, ~outside & wide
