"""Checks of what cameras see: images, intrinsics, depth."""

from collections.abc import Iterator

from stsem.log.container.damage import UNDECODABLE
from stsem.log.doctor.finding import Examined
from stsem.log.doctor.seen import DEPTH_BINS

BAD_SHARE = 0.5
"""Of the images looked at: a camera that sees nothing half of the time is not at work."""
MIN_MEDIAN_M, MAX_MEDIAN_M = 0.1, 100.0
"""No camera on a robot has half of its pixels nearer than 10 cm, and no depth of a camera reaches 100 m. 16 bits of
centimetres or metres read as millimetres lie below, floats of millimetres above."""
FARTHEST_M = (DEPTH_BINS - 1) / 1000
MAX_UNKNOWN = 0.6
"""A Kinect indoors misses 10 to 25 % of its pixels, stereo at plain walls up to 50 %."""
MIN_VIEW_DEG, MAX_VIEW_DEG = 12.0, 140.0
"""Across the image: a tele lens on a gimbal has 12 degrees and more; beyond 140 no lens is a pinhole."""
MAX_ASPECT = 1.2
"""fx / fy: pixels are square; a camera whose width alone was halved has 2."""
MIN_CENTRE, MAX_CENTRE = 0.25, 0.75
"""Where the principal point lies, as a share of the sides: outside the middle, the image was cropped."""


def image_dark(seen: Examined) -> Iterator[str]:
    """Images without light, and images of one colour."""
    frames = seen.frames
    for count, what in ((frames.dark, "are dark"), (frames.flat, "are of one colour only")):
        if count > BAD_SHARE * frames.looked_at:
            yield f"{count} of {frames.looked_at} colour images looked at {what}: is the lens covered?"


def video_codec(seen: Examined) -> Iterator[str]:
    """Channels of video."""
    for channel in seen.info.channels:
        if channel.nature == "video":
            yield f"{channel.topic} holds {channel.content} video, which stsem does not decode: it is not used."


def intrinsics_implausible(seen: Examined) -> Iterator[str]:
    """Intrinsics that no camera has."""
    counts = seen.info.damage.counts.get(UNDECODABLE, {})
    for topic, reason in seen.info.damage.reasons.items():
        if topic in seen.calibration_topics:
            yield f"{counts[topic]} calibrations of {topic} cannot be used; the first: {reason}."
    camera = seen.camera
    if camera is None:
        return
    view = f"fx {camera.fx:.6g}, fy {camera.fy:.6g}, cx {camera.cx:.6g}, cy {camera.cy:.6g}"
    size = f"images of {camera.width}x{camera.height}"
    if not MIN_VIEW_DEG <= camera.across_deg <= MAX_VIEW_DEG:
        yield f"{view} on {size} is a field of view of {camera.across_deg:.1f} degrees across."
    ratio = abs(camera.fx / camera.fy)
    if not 1 / MAX_ASPECT <= ratio <= MAX_ASPECT:
        yield f"{view} means pixels that are {ratio:.2f} times as high as wide."
    centre = (camera.cx + 0.5) / camera.width, (camera.cy + 0.5) / camera.height
    if not all(MIN_CENTRE <= share <= MAX_CENTRE for share in centre):
        yield f"{view} on {size} puts the principal point at {centre[0]:.0%} and {centre[1]:.0%} of the sides."


def depth_unit(seen: Examined) -> Iterator[str]:
    """Depth whose median cannot be metres."""
    if seen.depth is None or not (marks := seen.depth.percentiles_m):
        return
    if MIN_MEDIAN_M <= marks[50] <= MAX_MEDIAN_M:
        return
    yield (
        f"The median depth of {seen.info.choice.depth} ({seen.depth.content}) is {_metres(marks[50])}, 99 % are below "
        f"{_metres(marks[99])}: the unit is another one."
    )


def _metres(value: float) -> str:
    return f"{value:.3f} m" if value < FARTHEST_M else f"{FARTHEST_M:.0f} m or more"


def depth_unknown(seen: Examined) -> Iterator[str]:
    """Depth that is mostly not there."""
    if seen.depth is None or (share := seen.depth.unknown_share) is None or share <= MAX_UNKNOWN:
        return
    yield f"{share:.0%} of the pixels of {seen.info.choice.depth} have no depth."
