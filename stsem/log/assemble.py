"""From a scanned log to what is used of it: the channels, the class table, the calibration, the poses, the clocks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from stsem.errors import DecodeError, LogError, UndecodableError, UsageError
from stsem.log.calibration import Optics, color_optics, own_optics, same_shape
from stsem.log.candidate import Candidate
from stsem.log.choose import check_overrides, nearest_track
from stsem.log.classtable import ClassTable, find_table, read_file
from stsem.log.container.files import File
from stsem.log.container.store import Store
from stsem.log.pixels import decode
from stsem.log.poses.find import find_poses
from stsem.log.poses.source import PoseSource
from stsem.log.poses.tree import static_transform
from stsem.log.reading import ImageChannel
from stsem.log.registration import REGISTERED, DepthReader, View, claims_colour_pixels, depth_reader
from stsem.log.remark import Remark
from stsem.log.roles import Roles, choose_roles
from stsem.log.scan import Scan
from stsem.log.schemas.messages import Kind
from stsem.log.sizes import usual_size
from stsem.log.stamps import clock_offsets, clock_warnings, on_one_clock, refuse_restarted
from stsem.log.tracks import Track


@dataclass
class Assembly:
    """What is used of a log.

    Args:
        color, depth, labels: image channels; None when there is none or it cannot be used.
        size: (width, height) of the colour images.
        optics: of the colour camera, for images of `size`.
        depth_reader: brings depth onto the pixels of colour; None without depth.
        poses: where the camera's pose comes from.
        table: class table of the labels.
        clock_offsets_ns: topic -> what is taken out of its log times; only those that differ from 0.
        images: every image channel, and what it holds.
        why_color: why colour is that channel, in a few words.
        asked: roles whose channel was asked for by name.
        warnings: one sentence each.
    """

    color: ImageChannel
    size: tuple[int, int]
    depth: ImageChannel | None = None
    labels: ImageChannel | None = None
    optics: Optics = field(default_factory=Optics)
    depth_reader: DepthReader | None = None
    poses: PoseSource | None = None
    table: ClassTable | None = None
    clock_offsets_ns: dict[str, int] = field(default_factory=dict)
    images: Sequence[Candidate] = ()
    why_color: str = ""
    asked: frozenset[str] = frozenset()
    warnings: list[str] = field(default_factory=list)

    @property
    def pose_topic(self) -> str | None:
        """Topic that the poses come from."""
        return self.poses.topic if self.poses else None


def assemble(
    scan: Scan, store: Store, topics: Mapping[str, str], classes_file: Path | None, depth_registered: str
) -> Assembly:
    """Choose the channels and read what is needed to know how frames are made of them.

    Raises:
        UsageError: a value that cannot be.
        LogError: the files are not parts of one recording.
        ChannelError: no colour images, two cameras with an equal claim, or an asked-for topic that does not fit.
        UndecodableError: no colour image can be decoded.
        ClassTableError: a class table that cannot be used.
    """
    if depth_registered not in REGISTERED:
        raise UsageError(f"--depth-registered is {depth_registered!r}, but it can be {', '.join(REGISTERED)}.")
    tracks = list(scan.tracks.values())
    asked = check_overrides(topics, tracks)
    channels = {id(t): ImageChannel(t, store, scan.damage) for t in tracks if t.is_image and t.count}
    images = [Candidate(channel.track, channel.look()) for channel in channels.values()]
    roles = choose_roles(images, asked, tracks)
    color = roles.color
    result = Assembly(
        channels[id(color.track)], (0, 0), images=images, why_color=roles.why_color, asked=frozenset(asked),
        depth=channels[id(roles.depth.track)] if roles.depth else None,
        labels=channels[id(roles.labels.track)] if roles.labels else None,
        warnings=list(roles.warnings),
    )  # fmt: skip
    _refuse_unrelated(scan.files, result.color)
    refuse_restarted(result.color, scan.files)
    result.size = _size(result.color)
    _check_shape(result, roles.labels)
    _find_classes(result, scan, classes_file)
    _find_optics(result, roles, tracks, depth_registered)
    result.poses, warnings = find_poses(tracks, asked.get("pose"), color.look.frame_id, result.color.rows.stamp_ns)
    result.warnings += warnings
    _check_clocks(result, tracks)
    _note_troubles(result, tracks)
    return result


def _refuse_unrelated(files: Sequence[File], color: ImageChannel) -> None:
    """Parts of one recording follow each other; files whose colour images interleave in log time are several logs.

    Raises:
        LogError: they do.
    """
    of_file = np.searchsorted([file.base for file in files], color.rows.place, side="right") - 1
    spans = [
        (int(times.min()), int(times.max()), file.source.name)
        for k, file in enumerate(files)
        if len(times := color.rows.log_ns[of_file == k])
    ]
    for (_, end, one), (start, _, other) in pairwise(sorted(spans)):
        if start < end:
            raise LogError(
                f"{one} and {other} hold colour images of the same time, so they are not parts of one recording; "
                "give them one by one, each from a folder of its own or as a file."
            )


def _size(color: ImageChannel) -> tuple[int, int]:
    """Size of the colour images.

    Raises:
        UndecodableError: none can be decoded.
    """
    if size := usual_size(color, decode.colour):
        return size
    reason = ""
    try:
        color.read(0, decode.colour)
    except DecodeError as err:
        reason = f": {err.reason}"
    raise UndecodableError(
        f"No image of {color.topic} can be decoded{reason}; choose another with --topic color=TOPIC."
    )


def _find_optics(result: Assembly, roles: Roles, tracks: Sequence[Track], registered: str) -> None:
    """The colour camera's intrinsics, and how depth comes onto its pixels."""
    color, depth, extrinsic = roles.color, roles.depth, partial(static_transform, tracks)
    size = usual_size(result.depth, decode.depth) if result.depth else None
    claimed = depth and size and claims_colour_pixels(
        depth, size, color, result.size, registered, extrinsic, roles.depth_owner
    )  # fmt: skip
    result.optics = color_optics(tracks, result.images, color, result.size, depth if claimed else None)
    result.warnings += result.optics.warnings
    if depth is None:
        return
    if size is None:
        sentence = f"No depth image of {depth.topic} can be decoded ({depth.look.name}): depth is not used."
        result.warnings.append(Remark("depth-undecodable", sentence))
    else:
        views = View(depth, size, own_optics(tracks, depth, size)), View(color, result.size, result.optics)
        result.depth_reader, warnings = depth_reader(*views, registered, extrinsic, roles.depth_owner)
        result.warnings += warnings
    if result.depth_reader is None:
        result.depth = None


def _check_shape(result: Assembly, labels: Candidate | None) -> None:
    """Labels of another shape than colour show another part of the scene, or a distorted one."""
    size = labels.look.size if labels else None
    if labels is None or size is None or min(size) <= 0 or same_shape(size, result.size):
        return
    sentence = (
        f"{labels.topic} is {size[0]}x{size[1]} and {result.color.topic} {result.size[0]}x{result.size[1]}, which is "
        "another shape: answers are stretched to the labels to be scored, which is wrong if the labels were cropped."
    )
    result.warnings.append(Remark("truth-shape", sentence))


def _find_classes(result: Assembly, scan: Scan, classes_file: Path | None) -> None:
    if result.labels is None:
        if classes_file is not None:
            read_file(classes_file)  # what was given is checked, used or not; what the log holds may be broken
        return
    tables = [t for t in scan.tracks.values() if t.kind is Kind.CLASS_TABLE and t.class_names]
    topic = result.labels.topic
    nearest = nearest_track(tables, topic)
    messages = nearest.class_names[-1].names if nearest else None
    if nearest and nearest.changes:
        sentence = f"{nearest.topic} changes its class table {nearest.changes} times; the last one is used."
        result.warnings.append(Remark("truth-two-tables", sentence))
    table, warnings = find_table(classes_file, messages, scan.metadata, scan.attachments)
    result.warnings += warnings
    result.table = table
    if table is None:
        sentence = (
            f"{topic} holds labels, but no class table names them: accuracy cannot be measured (give --classes FILE)."
        )
        result.warnings.append(Remark("truth-no-table", sentence))


def _note_troubles(result: Assembly, tracks: Sequence[Track]) -> None:
    for track in tracks:
        if track.trouble:
            sentence = f"{track.trouble[0].upper()}{track.trouble[1:]}; its messages are not used."
            result.warnings.append(Remark("not-read", sentence))


def _check_clocks(result: Assembly, tracks: Sequence[Track]) -> None:
    result.depth, of_depth = on_one_clock(result.color, result.depth)
    result.labels, of_labels = on_one_clock(result.color, result.labels)
    result.warnings += of_depth + of_labels
    channels = [channel for channel in (result.color, result.depth, result.labels) if channel]
    posing = [track for track in tracks if track.topic == result.pose_topic]
    result.clock_offsets_ns = clock_offsets(channels, result.poses)
    result.warnings += clock_warnings(result.color, result.depth, result.labels, posing, result.clock_offsets_ns)
