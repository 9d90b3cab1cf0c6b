"""What the stamps of a log's channels tell when they are set side by side: offsets taken out, and warnings."""

from collections.abc import Mapping, Sequence

import numpy as np

from stsem.errors import LogError
from stsem.log.clocks import RESET_NS, clock_offset_ns, find_resets, out_of_range
from stsem.log.plan import depth_limit_ns, truth_limit_ns
from stsem.log.poses.source import PoseSource
from stsem.log.reading import ImageChannel
from stsem.log.remark import Remark
from stsem.log.tracks import Float64, Int64, References, Track

MIN_GAP_NS = 1_000_000_000
GAP_PERIODS = 10
SKEW_SPREAD_NS = 5_000_000
"""Two channels whose stamps lie evenly apart, to this, are on two clocks."""


def clock_offsets(channels: Sequence[ImageChannel], poses: PoseSource | None) -> dict[str, int]:
    """Topic -> what is taken out of its log times, ns; only those that differ from 0, sorted."""
    offsets = {channel.topic: clock_offset_ns(channel.rows) for channel in channels}
    if poses:
        offsets[poses.topic] = out_of_range(poses.offset_ns())
    return {topic: offset for topic, offset in sorted(offsets.items()) if offset}


def clock_warnings(
    color: ImageChannel, depth: ImageChannel | None, labels: ImageChannel | None, others: Sequence[Track],
    offsets_ns: Mapping[str, int],
) -> list[str]:  # fmt: skip
    """One sentence for each thing that is odd about the stamps of what is used; `others` are its other channels."""
    warnings: list[str] = [
        Remark(
            "clock-offset",
            f"The clock of {topic} is off: its log times are {offset / 1e9:.3f} s behind its stamps or more; "
            "taken out.",
        )
        for topic, offset in offsets_ns.items()
    ]
    warnings += _odd_frames(color)
    for channel, limit_ns in ((depth, depth_limit_ns), (labels, truth_limit_ns)):
        if channel is not None:
            warnings += _set_back(channel)
            warnings += _skewed(color.rows, channel, limit_ns(color.rows, channel.rows))
    images = [channel.track for channel in (color, depth, labels) if channel is not None]
    return warnings + _unstamped([*images, *others])


def refuse_restarted(color: ImageChannel) -> None:
    """Frames go by their stamps; two passes over the same stamps would be shuffled into one.

    Raises:
        LogError: the clock of the colour camera was set back.
    """
    resets = find_resets(*_stamped(color))
    if not resets:
        return
    first = resets[0]
    times = "" if len(resets) == 1 else f", {len(resets)} times in all"
    raise LogError(
        f"The clock of {color.topic} was set back by {first.back_ns / 1e9:.3f} s at log time {first.log_ns} ns{times}, "
        "so its stamps come twice; cut the log there, for example with mcap filter, and give the parts one by one."
    )


def _odd_frames(color: ImageChannel) -> list[str]:
    """Repeated stamps and gaps."""
    stamps = color.rows.stamp_ns
    warnings: list[str] = []
    steps = np.diff(stamps)
    if not len(steps):
        return []
    if repeated := int((steps == 0).sum()):
        sentence = f"{repeated} images of {color.topic} have the stamp of another one; each is a frame."
        warnings.append(Remark("duplicates", sentence))
    gaps = np.flatnonzero(steps > max(MIN_GAP_NS, GAP_PERIODS * int(np.median(steps))))
    if len(gaps):
        longest = int(gaps[steps[gaps].argmax()])
        at = (int(stamps[longest]) - int(stamps[0])) / 1e9
        times = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps, the longest"
        sentence = f"{color.topic} has {times} of {steps[longest] / 1e9:.3f} s at t = {at:.3f} s."
        warnings.append(Remark("gaps", sentence))
    return warnings


def _set_back(channel: ImageChannel) -> list[str]:
    resets = find_resets(*_stamped(channel))
    return [
        Remark(
            "clock-reset",
            f"The clock of {channel.topic} was set back by {reset.back_ns / 1e9:.3f} s at log time {reset.log_ns} ns: "
            "its images may meet the wrong colour images.",
        )
        for reset in resets[:1]
    ]


def _unstamped(tracks: Sequence[Track]) -> list[str]:
    """Channels some or all of whose messages have no capture stamp."""
    warnings: list[str] = []
    for track in tracks:
        if not track.unstamped:
            continue
        offsets = track.stamp_offsets_ns()
        off = np.median(offsets[offsets != 0]) / 1e9 if (offsets != 0).any() else 0.0
        far = f", which is {off:.3f} s off the stamps of the others" if out_of_range(round(off * 1e9)) else ""
        sentence = (
            f"{track.unstamped} of {track.count} messages on {track.topic} have no capture stamp: "
            f"their log time is used{far}."
        )
        warnings.append(Remark("clock-unstamped", sentence))
    return warnings


def _skewed(color: References, channel: ImageChannel, limit_ns: int) -> list[str]:
    """A sentence when the stamps of a channel are on another clock than those of colour, and pairs are lost.

    They are when all of them lie evenly far from the nearest colour stamp, farther than the `limit_ns` of a pair, or
    all lie outside. Nothing is shifted: the log does not say which clock is right, nor by how many frames.
    """
    other = channel.rows
    if len(color) < 2 or not len(other):
        return []
    first, last = int(color.stamp_ns[0]), int(color.stamp_ns[-1])
    outside = (other.stamp_ns < first - RESET_NS) | (other.stamp_ns > last + RESET_NS)
    if outside.all():
        apart = float(np.median(other.stamp_ns - other.log_ns) - np.median(color.stamp_ns - color.log_ns)) / 1e9
        sentence = (
            f"The stamps of {channel.topic} are all outside those of the colour images, on a clock that differs by "
            f"about {apart:.3f} s: no frame has any of them; record both with one clock."
        )
        return [Remark("clock-skew", sentence)]
    distance = _nearest(color.stamp_ns, other.stamp_ns[~outside])
    median, spread = float(np.median(distance)), float(np.ptp(np.percentile(distance, (5, 95))))
    if abs(median) <= limit_ns or spread > SKEW_SPREAD_NS:
        return []
    side = "behind" if median > 0 else "before"
    sentence = (
        f"The stamps of {channel.topic} lie evenly {abs(median) / 1e6:.1f} ms {side} the nearest colour stamps, more "
        f"than the {limit_ns / 1e6:.1f} ms that a pair may be apart: one of the clocks is off, and pairs are lost."
    )
    return [Remark("clock-skew", sentence)]


def _nearest(stamps: Int64, others: Int64) -> Float64:
    """(n,) signed distance of each of `others` from the nearest of `stamps`, ascending."""
    later = np.clip(np.searchsorted(stamps, others), 1, len(stamps) - 1)
    before, behind = others - stamps[later - 1], others - stamps[later]
    return np.where(np.abs(before) <= np.abs(behind), before, behind).astype(np.float64)


def _stamped(channel: ImageChannel) -> tuple[Int64, Int64]:
    """(stamps, log times) of the messages that have a stamp of their own."""
    stamps, logs = channel.rows.stamp_ns, channel.rows.log_ns
    own = stamps != logs if channel.track.unstamped else np.ones(len(stamps), np.bool_)
    return stamps[own], logs[own]
