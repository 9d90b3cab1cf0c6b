"""Containers: however the same messages were written, and wherever the file lies."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import zip_longest
from typing import Any

import numpy as np
from analytic_scene import HALF_NS, PERIOD_NS, START_NS, Scene
from container_stores import as_bag, by_hand, by_stsem, in_memory, over_http, split
from encoders_ros import NS, Encoded, RosMessages
from family_rows import FOX, ROS1
from mcap.writer import CompressionType, IndexType
from tape import (
    COLOR,
    COLOR_LATE_NS,
    DEPTH,
    DEPTH_LATE_NS,
    INFO,
    INFO_LATE_NS,
    LABELS,
    LABELS_LATE_NS,
    POSE_LATE_NS,
    TF,
    Message,
    Tape,
    calibration,
    color,
    depth,
    ids,
    labels,
    millimetres,
    rgb8,
)
from variant import Equal, Variant, one_file

BARE = {
    "index_types": IndexType.NONE, "repeat_channels": False, "repeat_schemas": False, "use_statistics": False,
    "use_summary_offsets": False,
}  # fmt: skip
"""What mcap's writer must be told to write no summary."""
OFF = ("The clock of /cam/color/image_raw is off", "The clock of /cam/depth/image_raw is off",
       "The clock of /gt/labels is off", "The clock of /tf is off")  # fmt: skip


def at(log_ns: Callable[[Message], int]) -> Callable[[Tape], Tape]:
    """A change of log times; the order in the file stays."""

    def change(tape: Tape) -> Tape:
        return replace(tape, messages=tuple(replace(m, log_ns=log_ns(m)) for m in tape.messages))

    return change


def reordered(order: Callable[[int], Iterable[int]]) -> Callable[[Tape], Tape]:
    """A change of the order in the file; log times stay."""
    return lambda tape: replace(tape, messages=tuple(tape.messages[k] for k in order(len(tape.messages))))


def _overlapping(n: int) -> list[int]:
    """Two writers, the second one sixteen messages behind, take turns of eight messages."""
    writers = [[list(range(start, n, 2))[k : k + 8] for k in range(0, n // 2 + 1, 8)] for start in (0, 1)]
    pairs = zip_longest(writers[0], [[], []] + writers[1], fillvalue=[])
    return [k for pair in pairs for turn in pair for k in turn]


def _frame_end(message: Message) -> int:
    """When the last message of its frame was logged: the later pose."""
    first = START_NS - HALF_NS + POSE_LATE_NS
    periods = max(0, -((first - message.log_ns) // PERIOD_NS))
    return first + periods * PERIOD_NS


class Unstamped(RosMessages):
    """ROS messages of a driver that leaves the stamp at zero."""

    def header(self, stamp_ns: int, frame_id: str) -> Any:
        return super().header(0, frame_id)


class FarFuture(RosMessages):
    """ROS 1, whose seconds are unsigned; rosbags writes them as signed ones of the same bits."""

    def header(self, stamp_ns: int, frame_id: str) -> Any:
        return super().header(stamp_ns - (NS << 32), frame_id)


def _at_capture(message: Message) -> int:
    """The log time without its delay."""
    late = {COLOR: COLOR_LATE_NS, DEPTH: DEPTH_LATE_NS, LABELS: LABELS_LATE_NS, INFO: INFO_LATE_NS}
    return message.log_ns - late.get(message.topic, POSE_LATE_NS)


def foreign(_make: Any, scene: Scene) -> Tape:
    """3000 messages on 300 channels that stsem does not read, some on topics of ours."""
    kinds = (
        Encoded("acme.Blob", "cddl", b"blob = bstr", "cbor", b"\x41\x00"),
        Encoded("acme/msg/Custom", "ros2msg", b"float64 x\n", "cdr", b"\x00\x01\x00\x00" + bytes(8)),
        Encoded("acme.Proto", "protobuf", b"\xff not a descriptor", "protobuf", b"\x08\x96\x01"),
        Encoded("", "", b"", "", b""),
        Encoded("acme.Flat", "flatbuffer", bytes(100), "flatbuffer", bytes(20)),
    )
    topics = [*(f"/foreign/{k}" for k in range(298)), COLOR, TF]
    end = scene.frames * PERIOD_NS
    return Tape(tuple(
        Message(topics[k % 300], kinds[k % 5], scene.start_ns + k * end // 3000) for k in range(3000)
    ))  # fmt: skip


def named(prefix: str) -> dict[str, Any]:
    """Parts on topics below `prefix`."""
    return {
        "color": color(rgb8, f"{prefix}/color/image_raw"), "depth": depth(millimetres, f"{prefix}/depth/image_raw"),
        "labels": labels(ids, f"{prefix}/labels"), "calibration": calibration(f"{prefix}/color/camera_info"),
    }  # fmt: skip


HOUR = at(lambda message: message.log_ns + 3600 * NS)
PAST = at(lambda message: message.log_ns - 3 * NS)
YEAR_2100 = Scene(start_ns=4_102_444_800 * NS)
WRITTEN = (
    Variant("zstd", "chunks packed with zstd", store=one_file(compression=CompressionType.ZSTD)),
    Variant("lz4", "chunks packed with lz4", store=one_file(compression=CompressionType.LZ4)),
    Variant("unpacked", "chunks that are not packed", store=one_file(compression=CompressionType.NONE)),
    Variant("one-chunk", "one chunk", store=one_file(chunk_size=1 << 30)),
    Variant("tiny-chunks", "a chunk for every message", store=one_file(chunk_size=1)),
    Variant("unchunked", "no chunks", store=one_file(use_chunking=False)),
    Variant("no-index", "no indexes of chunks and messages", store=one_file(index_types=IndexType.NONE)),
    Variant("no-message-index", "chunk indexes alone", store=one_file(index_types=IndexType.CHUNK)),
    Variant("no-summary", "nothing behind the data", store=one_file(**BARE)),
    Variant("unchunked-no-summary", "neither chunks nor summary", store=one_file(use_chunking=False, **BARE)),
    Variant("no-crcs", "no checksums", store=one_file(enable_crcs=False)),
    Variant("data-crcs", "a checksum of the data section, too", store=one_file(enable_data_crcs=True)),
    Variant("repeated-definitions", "schema and channel before every message", store=by_hand(repeat=True)),
    Variant("restarted-channels", "every channel comes back under another number", store=by_hand(restart=True)),
    Variant("own-writer", "what stsem itself writes", make=FOX, store=by_stsem),
)
ORDERED = (
    Variant("overlapping-chunks", "two writers in turns: chunks overlap in time", change=reordered(_overlapping)),
    Variant("reversed", "the last message first", change=reordered(lambda n: range(n)[::-1])),
    Variant("shuffled", "messages in any order", change=reordered(
        lambda n: np.random.default_rng(5).permutation(n).tolist())),
    Variant("equal-log-times", "all messages of a frame have one log time", change=at(_frame_end)),
    Variant("one-log-time", "all messages have one log time", change=at(lambda _: START_NS + 3 * NS // 2),
            equal=Equal(timing="other", map=False)),
    Variant("no-stamps", "all stamps are zero: the log time counts, and said", make=Unstamped(2),
            change=at(_at_capture), equal=Equal(timing="shifted", warns=tuple(
                f"{n} of {n} messages on {topic}" for n, topic in ((12, COLOR), (12, DEPTH), (12, LABELS), (13, TF))))),
    Variant("year-2100-ros1", "stamps of the year 2100 in ROS 1", make=FarFuture(1), scene=YEAR_2100),
    Variant("year-2100-protobuf", "stamps of the year 2100 in protobuf", make=FOX, scene=YEAR_2100),
    Variant("skew-forward", "the recorder's clock is an hour ahead: taken out, and said", change=HOUR,
            equal=Equal(timing="shifted", warns=OFF)),
    Variant("skew-back", "the recorder's clock is 3 s behind: taken out, and said", change=PAST,
            equal=Equal(timing="shifted", warns=OFF)),
    Variant("gap", "20 s without anything, in the middle: said", scene=Scene(pause_ns=20 * NS),
            equal=Equal(timing="other", warns=(f"{COLOR} has a gap of 20.100 s",))),
)  # fmt: skip
PLACES = (
    Variant("split-folder", "three files in a folder, `run_8` to `run_10`; tf_static only in the first",
            store=split(3)),
    Variant("split-files", "the same files, given in any order", store=split(3, folder=False)),
    Variant("split-metadata", "class table only in the first file", make=FOX, store=split(4)),
    Variant("foreign-messages", "3000 messages of unknown kinds on 300 channels, some on the same topics",
            more=foreign),
    Variant("topic-names-unicode", "topics in other scripts",
            **named("/\u76f8\u6a5f/\u043a\u0430\u043c\u0435\u0440\u0430")),
    Variant("topic-names-hostile", "topics with control characters, paths and markup",
            **named("/../../\x1b[31m\u202e<script>|`$(x)`\n")),
    Variant("file-name-unicode", "a file name in other scripts, with blanks and `#%`",
            store=one_file("\u30ed\u30b0 #1 %20 [x] \u00e9.mcap")),
    Variant("file-name-hostile", "a file name with a line break, an escape and markup",
            store=one_file("a\n\x1b[31m<b>$(x).mcap")),
    Variant("http", "over http, in ranges", reach=over_http),
    Variant("fsspec-folder", "a folder of another file system (`memory://`)", store=split(2, folder=False),
            reach=in_memory),
    Variant("rosbag2", "a ROS 2 bag in sqlite3, through `stsem convert`", store=as_bag(2)),
    Variant("rosbag1", "a ROS 1 bag, through `stsem convert`", make=ROS1, store=as_bag(1)),
)  # fmt: skip
CONTAINER_ROWS = (*WRITTEN, *ORDERED, *PLACES)
