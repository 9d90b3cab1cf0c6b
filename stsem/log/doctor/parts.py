"""Checks of what is there at all, and of how complete it is: depth, poses, truth, bytes."""

from collections.abc import Iterator

from stsem.log.container.damage import OF_BYTES, UNDECODABLE
from stsem.log.doctor.finding import Examined
from stsem.log.poses.body import has_body_axes

MIN_PAIRED = 0.9
"""Of the frames: one in ten without a partner is more than what a recorder drops at its ends."""
MAX_IGNORED = 0.5
ONE_CLASS = 0.995
"""Of the labelled pixels: a constant answer would score as much."""
STILL_M, STILL_DEG = 0.001, 0.05
"""A robot at rest has more noise in its pose than this."""
MIN_STILL_S = 1.0


def map_impossible(seen: Examined) -> Iterator[str]:
    """What a map needs and the log does not have, unless it was said why."""
    choice, missing = seen.info.choice, []
    if choice.depth is None and not seen.said("depth-unregistered", "depth-undecodable"):
        missing.append("depth")
    if choice.pose is None and not seen.said("pose-tree", "pose-unreadable", "pose-values"):
        missing.append("poses")
    if seen.camera is None and not seen.said("intrinsics-zero", "intrinsics-missing", "distortion-unknown"):
        missing.append("calibration")
    if missing:
        yield f"No map can be made, and nothing be predicted by depth: the log has no {' and no '.join(missing)}."


def depth_sparse(seen: Examined) -> Iterator[str]:
    """Frames without depth."""
    with_depth, count = seen.frames.with_depth, seen.frames.count
    if seen.depth is None or with_depth >= MIN_PAIRED * count or _on_another_clock(seen, seen.info.choice.depth):
        return
    yield f"{with_depth} of {count} frames ({with_depth / count:.0%}) have a depth image of their time."


def truth_missing(seen: Examined) -> Iterator[str]:
    """No labels."""
    if seen.info.choice.labels is None and not seen.said("truth-other-camera"):
        yield "The log has no label images: accuracy cannot be measured, timing can."


def truth_sparse(seen: Examined) -> Iterator[str]:
    """Frames without truth."""
    with_truth, count = seen.frames.with_truth, seen.frames.count
    if seen.truth is None or with_truth >= MIN_PAIRED * count or _on_another_clock(seen, seen.info.choice.labels):
        return
    yield f"{with_truth} of {count} frames ({with_truth / count:.0%}) have truth; only those are scored."


def truth_ignored(seen: Examined) -> Iterator[str]:
    """Truth that says ignore."""
    if seen.truth is None or (share := seen.truth.ignored_share) is None or share <= MAX_IGNORED:
        return
    yield f"{share:.0%} of the pixels of {seen.info.choice.labels} are to be ignored."


def truth_one_class(seen: Examined) -> Iterator[str]:
    """Truth of one class."""
    if seen.truth is None or len(seen.truth.classes) < 2:
        return
    most = max(seen.truth.classes, key=lambda row: row.pixels)
    if most.share is not None and most.share > ONE_CLASS:
        yield f"{most.share:.1%} of the labelled pixels looked at are {most.name!r}."


def pose_still(seen: Examined) -> Iterator[str]:
    """Poses that do not change."""
    pose = seen.pose
    if pose is None or pose.span_s < MIN_STILL_S or pose.extent_m > STILL_M or pose.turn_deg > STILL_DEG:
        return
    yield (
        f"The pose does not change: {pose.samples} samples in {pose.span_s:.1f} s lie within "
        f"{pose.extent_m * 1000:.2f} mm and {pose.turn_deg:.2f} degrees."
    )


def pose_body_frame(seen: Examined) -> Iterator[str]:
    """Images that are stamped with a frame of body axes."""
    frames = seen.info.pose_frames
    if seen.path is None or not frames or seen.said("pose-body-frame") or not has_body_axes(frames[-1], seen.path):
        return
    yield (
        f"The colour images are in frame {frames[-1]!r}, whose z axis points up in {frames[0]!r} as a body's does; a "
        "camera looks along z of its optical frame (z forward, y down): the map is turned by 90 degrees."
    )


def unprotected(seen: Examined) -> Iterator[str]:
    """Bytes without a checksum."""
    if share := seen.info.unprotected:
        yield f"{share:.0%} of the bytes of messages stand under no checksum: a wrong one cannot be noticed."


def damage(seen: Examined) -> Iterator[str]:
    """Bytes that are broken."""
    if seen.info.damage.counts.keys() & set(OF_BYTES):
        yield f"The log is damaged: {seen.info.damage.summary(OF_BYTES)}."


def undecodable(seen: Examined) -> Iterator[str]:
    """Messages that are there and cannot be used, but for calibrations, which have a finding of their own."""
    counts, calibrations = seen.info.damage.counts.get(UNDECODABLE, {}), seen.calibration_topics
    for topic, reason in seen.info.damage.reasons.items():
        if topic not in calibrations:
            yield f"{counts[topic]} messages of {topic} cannot be used; the first: {reason}."


def _on_another_clock(seen: Examined, topic: str | None) -> bool:
    """Whether it was said that a channel is skewed, so that its pairs are lost for that reason."""
    return any(f"of {topic} " in text for text in seen.said("clock-skew"))
