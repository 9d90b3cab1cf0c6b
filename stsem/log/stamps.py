"""What the stamps of a log's channels tell when they are set side by side: offsets taken out, and warnings."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from stsem.errors import LogError
from stsem.log.clocks import (
    AHEAD_NS,
    RESET_NS,
    Reset,
    clock_offset_ns,
    find_resets,
    find_resets_in_file,
    foreign_clock_ns,
    out_of_range,
    smallest_offset_ns,
)
from stsem.log.container.files import File
from stsem.log.plan import depth_limit_ns, truth_limit_ns
from stsem.log.poses.source import PoseSource
from stsem.log.reading import ImageChannel
from stsem.log.remark import Remark
from stsem.log.tracks import Float64, Int64, References, Track

MIN_GAP_NS = 1_000_000_000
GAP_PERIODS = 10
LONG_GAP_NS = 60_000_000_000
"""No disk or queue holds a recorder up for longer."""
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
            f"taken out{_dated_ahead(topic, color, others, offsets_ns)}.",
        )
        for topic, offset in offsets_ns.items()
    ]
    if depth is not None:
        warnings += _late(color, depth)
    images = [channel.track for channel in (depth, labels) if channel is not None]
    warnings += _odd_frames(color, [*images, *others])
    for channel, limit_ns in ((depth, depth_limit_ns), (labels, truth_limit_ns)):
        if channel is not None:
            warnings += _set_back(channel)
            warnings += _skewed(color.rows, channel, limit_ns(color.rows, channel.rows))
    return warnings + _unstamped([color.track, *images, *others])


def _dated_ahead(topic: str, color: ImageChannel, poses: Sequence[Track], offsets_ns: Mapping[str, int]) -> str:
    """What poses from the future mean, when the images are not from there."""
    if not any(track.topic == topic for track in poses) or color.topic in offsets_ns or offsets_ns[topic] > -AHEAD_NS:
        return ""
    return "; unless poses are dated ahead on purpose, they are that far off the images"


def _late(color: ImageChannel, depth: ImageChannel) -> list[str]:
    """Depth that always comes later than colour by as much as a computation may take: it, or another clock."""
    if not len(depth) or np.isin(depth.rows.stamp_ns, color.rows.stamp_ns).any():
        return []
    later = smallest_offset_ns(depth.rows) - smallest_offset_ns(color.rows)
    spread = float(np.ptp(np.percentile(depth.rows.log_ns - depth.rows.stamp_ns, (5, 95))))
    if later <= AHEAD_NS or spread > SKEW_SPREAD_NS or clock_offset_ns(depth.rows) or clock_offset_ns(color.rows):
        return []
    sentence = (
        f"{depth.topic} is logged {later / 1e9:.3f} s later behind its stamps than {color.topic}, evenly: if nothing "
        "computes for so long, its clock is behind, and pairs are of images that far apart."
    )
    return [Remark("clock-skew", sentence)]


def on_one_clock(color: ImageChannel, other: ImageChannel | None) -> tuple[ImageChannel | None, list[str]]:
    """(a channel with its stamps on the clock of colour, or None if it cannot be used; a sentence if they were not).

    They meet colour by stamps, so that is where the difference is taken out; its log times stay. When it is colour that
    is not in step with the recorder, poses are on another clock, too, and nothing can be made of both.
    """
    shift_ns = foreign_clock_ns(color.rows, other.rows) if other is not None else 0
    if other is None or not shift_ns:
        return other, []
    own, foreign = (smallest_offset_ns(channel.rows) for channel in (color, other))
    sentence = (
        f"{other.topic} and {color.topic} are on two clocks: log times are {foreign / 1e9:.3f} s and {own / 1e9:.3f} s "
        "behind their stamps or more; "
    )
    if own < -AHEAD_NS:
        sentence += "the second is ahead of the recorder, so no pair can be trusted, and the first is not used."
        return None, [Remark("clock-skew", sentence)]
    other.rows = replace(other.rows, stamp_ns=other.rows.stamp_ns + shift_ns)
    sentence += f"{shift_ns / 1e9:+.3f} s is added to the stamps of the first, to within what transport differs."
    return other, [Remark("clock-skew", sentence)]


def refuse_restarted(color: ImageChannel, files: Sequence[File]) -> None:
    """Frames go by their stamps; two passes over the same stamps would be shuffled into one.

    Raises:
        LogError: the clock of the colour camera was set back.
    """
    resets = find_resets(*_stamped(color)) or _resets_in_files(color, files)
    if not resets:
        return
    first = resets[0]
    times = "" if len(resets) == 1 else f", {len(resets)} times in all"
    raise LogError(
        f"The clock of {color.topic} was set back by {first.back_ns / 1e9:.3f} s at log time {first.log_ns} ns{times}, "
        f"{_how_to_cut(first)}"
    )


def _how_to_cut(reset: Reset) -> str:
    if reset.twice_ns is None:
        return (
            "so its stamps come twice; cut the log there, for example with mcap filter, and give the parts one by one."
        )
    since, until = reset.twice_ns
    if since > until:
        return (
            f"and the recorder's with it; cut the log at {since} ns, for example with mcap filter, and give the parts "
            "one by one: the later one was recorded first."
        )
    return (
        f"and the recorder's with it, so log times from {since} to {until} ns come twice; cut them out, for example "
        "with mcap filter, and give what is before and what is behind them one by one."
    )


def _resets_in_files(channel: ImageChannel, files: Sequence[File]) -> tuple[Reset, ...]:
    """Steps back in the order of each file: a recorder writes as time goes on, whatever its clock says."""
    rows = channel.rows
    order = np.lexsort((rows.offset, rows.place))
    borders = np.searchsorted(rows.place[order], [file.base for file in files])
    parts = np.split(order, borders[1:])
    return tuple(reset for part in parts for reset in find_resets_in_file(rows.stamp_ns[part], rows.log_ns[part]))


def _odd_frames(color: ImageChannel, others: Sequence[Track]) -> list[str]:
    """Repeated stamps and gaps."""
    stamps, logs = color.rows.stamp_ns, color.rows.log_ns
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
        why = _why_gap(int(steps[longest]), int(logs[longest + 1] - logs[longest]), others)
        sentence = f"{color.topic} has {times} of {steps[longest] / 1e9:.3f} s at t = {at:.3f} s{why}."
        warnings.append(Remark("gaps", sentence))
    return warnings


def _why_gap(gap_ns: int, log_gap_ns: int, others: Sequence[Track]) -> str:
    """What stopped, as far as the other channels tell: the camera, the recorder, or only the clock."""
    if 2 * log_gap_ns < gap_ns:
        return f", in {log_gap_ns / 1e9:.3f} s of log time: its clock was set forward"
    gaps = [track.largest_gap_ns for track in others if track.count > 1]
    if not gaps:
        return ""
    if 2 * min(gaps) < log_gap_ns:
        return ", while other channels went on: the camera, its driver or its connection stopped"
    if log_gap_ns > LONG_GAP_NS:
        return ", as have the other channels: recording was paused, or the clock was set forward"
    return ", as have the other channels: recording was paused, or the disk or the queue of the recorder held it up"


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
        sentence = (
            f"{track.unstamped} of {track.count} messages on {track.topic} have no capture stamp: {track.stand_in}."
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
