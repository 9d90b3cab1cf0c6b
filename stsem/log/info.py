"""What a log is, in plain words and numbers."""

from dataclasses import dataclass

from stsem.log.container.damage import Damage
from stsem.log.container.source import Source


@dataclass(frozen=True)
class ChannelInfo:
    """One channel.

    Args:
        topic, schema, encoding: as in the file; `encoding` is that of the messages.
        count: messages that could be counted.
        rate_hz: (count - 1) / (last - first log time); None below two messages.
        first_log_ns, last_log_ns: smallest and largest log time; None without a message.
        offset_min_ns, offset_median_ns, offset_max_ns: of (log time - stamp); None where stsem reads no stamp.
        unstamped: messages without a capture stamp, of those that are read.
        largest_gap_s: between the log times of two messages in a row; None below two messages.
        content: encoding or format of its images; "" where there are none, or none was looked at.
        nature: what its images could be used as: "color", "depth", "labels", or "video"; "" otherwise.
        role: "color", "depth", "pose", "labels", "calibration", "tf", "tf_static", "classes", or "" when unused.
    """

    topic: str
    schema: str
    encoding: str
    count: int
    rate_hz: float | None
    first_log_ns: int | None
    last_log_ns: int | None
    offset_min_ns: int | None
    offset_median_ns: int | None
    offset_max_ns: int | None
    unstamped: int
    largest_gap_s: float | None
    content: str
    nature: str
    role: str


@dataclass(frozen=True)
class Choice:
    """The topics that are used as what; None where there is none."""

    color: str | None
    depth: str | None
    pose: str | None
    labels: str | None
    calibration: str | None


@dataclass(frozen=True)
class LogInfo:
    """A log as a whole.

    Args:
        name: of the file without its extension, or of the folder; of several files, of the first in order of names.
        sources: its files, in order.
        sha256: of all bytes of all files, in order; for one file the file's own.
        size_bytes: of all files.
        duration_s: from the first to the last colour stamp of the whole log.
        channels: in order of topic.
        choice: what is used as what.
        reasons: role -> why it is that channel, in a few words; roles without a channel are absent.
        pose_frames: frames along the chain from the world to the camera, which poses are composed of.
        damage: counts; grows when a frame turns out to be undecodable.
        unprotected: share 0..1 of the bytes of messages that no checksum covers.
        warnings: one sentence each; those that were said while it was opened are Remarks.
        clock_offsets_ns: topic -> offset that was taken out of its log times (below 0 or above 1 s).
        library, profile: as the recorder named them.
    """

    name: str
    sources: tuple[Source, ...]
    sha256: str
    size_bytes: int
    duration_s: float
    channels: tuple[ChannelInfo, ...]
    choice: Choice
    reasons: dict[str, str]
    pose_frames: tuple[str, ...]
    damage: Damage
    unprotected: float
    warnings: tuple[str, ...]
    clock_offsets_ns: dict[str, int]
    library: str
    profile: str
