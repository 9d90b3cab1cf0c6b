"""Containers: however the same messages were written, and wherever the file lies."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from analytic_scene import BASE_CAMERA, CLASSES, COLOURS, HALF_NS, PERIOD_NS, START_NS, Scene
from encoders_ros import NS, Encoded, RosMessages
from family_rows import FOX, ROS1
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, DataEnd, Footer, Header
from mcap.records import Message as MessageRecord
from mcap.writer import MCAP0_MAGIC, CompressionType, IndexType
from range_server import Behaviour, serving
from rosbags import rosbag1, rosbag2
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
    schema_of,
)
from variant import ROS2, Equal, Paths, Store, Variant, one_file, write

from stsem.classes import ClassSet
from stsem.convert.bags import convert_rosbag1, convert_rosbag2
from stsem.convert.recording import Options
from stsem.log.writer import LogWriter

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


def split(parts: int, name: str = "run_{}.mcap", *, folder: bool = True) -> Store:
    """One recording in several files, numbered from 8; metadata and attachments stand in the first."""

    def store(tape: Tape, where: Path) -> Paths:
        n = len(tape.messages)
        pieces = [Tape(tape.messages[k * n // parts : (k + 1) * n // parts]) for k in range(parts)]
        pieces[0] += replace(tape, messages=())
        files = [write(piece, where / name.format(k)) for k, piece in enumerate(pieces, start=8)]
        return [where] if folder else files[::-1]

    return store


def by_hand(*, repeat: bool = False, restart: bool = False) -> Store:
    """Records one after the other, without chunks and summary.

    Args:
        repeat: schema and channel stand before every message.
        restart: the second half of every topic has a channel and a schema of other numbers.
    """

    def store(tape: Tape, folder: Path) -> Paths:
        builder, known, counts, done = RecordBuilder(), dict[tuple[str, bool], int](), Counter(), Counter()
        counts.update(message.topic for message in tape.messages)
        Header(profile="ros2", library="by hand").write(builder)
        for message in tape.messages:
            topic, content = message.topic, message.content
            key = topic, restart and 2 * done[topic] >= counts[topic]
            done[topic] += 1
            if key not in known or repeat:
                number = known.setdefault(key, len(known) + 1)
                schema_of(content, number).write(builder)
                Channel(number, topic, content.encoding, {}, number).write(builder)
            MessageRecord(known[key], message.log_ns, content.payload, message.log_ns, 0).write(builder)
        DataEnd(data_section_crc=0).write(builder)
        Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(builder)
        path = folder / "log.mcap"
        path.write_bytes(MCAP0_MAGIC + builder.end() + MCAP0_MAGIC)
        return [path]

    return store


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


@contextmanager
def over_http(paths: Paths) -> Iterator[Paths]:
    """A server with the files."""
    pytest.importorskip("aiohttp", reason="needs the extra 'remote'")
    content = {f"/{Path(path).name}": Path(path).read_bytes() for path in paths}
    with serving(Behaviour(content)) as address:
        yield [f"{address}{name}" for name in content]


@contextmanager
def in_memory(paths: Paths) -> Iterator[Paths]:
    """A folder of fsspec's memory."""
    system = pytest.importorskip("fsspec", reason="needs the extra 'remote'").filesystem("memory")
    for path in paths:
        system.pipe(f"/variants/{Path(path).name}", Path(path).read_bytes())
    yield ["memory://variants/"]
    system.rm("/variants", recursive=True)


def as_bag(version: int) -> Store:
    """A bag by rosbags, then `stsem convert`."""
    bags = {1: (rosbag1, convert_rosbag1, ROS1, {}), 2: (rosbag2, convert_rosbag2, ROS2, {"version": 9})}
    rosbag, convert, make, options = bags[version]

    def store(tape: Tape, folder: Path) -> Paths:
        with rosbag.Writer(folder / "bag", **options) as writer:
            known: dict[str, Any] = {}
            for message in tape.messages:
                kind = "/msg/".join(message.content.schema.replace("/msg/", "/").split("/"))
                if message.topic not in known:
                    known[message.topic] = writer.add_connection(message.topic, kind, typestore=make.types)
                writer.write(known[message.topic], message.log_ns, message.content.payload)
        summary = convert(folder / "bag", folder / "log.mcap", Options(), lambda done, total: None)
        assert not summary.losses
        return [folder / "log.mcap"]

    return store


def by_stsem(tape: Tape, folder: Path) -> Paths:
    """The scene by stsem's own writer, at the same times."""
    scene, classes = Scene(), ClassSet(CLASSES, COLOURS)
    events: list[tuple[int, Callable[[LogWriter, int], None]]] = [
        (t + POSE_LATE_NS, partial(LogWriter.pose, stamp_ns=t, T_WC=pose @ BASE_CAMERA)) for t, pose in scene.samples
    ]
    for i, view in enumerate(scene.views):
        t = scene.stamp_ns(i)
        events += [
            (t + INFO_LATE_NS, partial(LogWriter.calibration, stamp_ns=t, camera=scene.camera)),
            (t + COLOR_LATE_NS, partial(LogWriter.color_pixels, stamp_ns=t, image=view.rgb)),
            (t + DEPTH_LATE_NS, partial(LogWriter.depth, stamp_ns=t, millimetres=view.mm)),
            (t + LABELS_LATE_NS, partial(LogWriter.labels, stamp_ns=t, labels=view.labels)),
        ]
    with LogWriter(folder / "log.mcap", classes) as log:
        for log_ns, write_one in sorted(events, key=lambda event: event[0]):
            write_one(log, log_ns=log_ns)
    return [folder / "log.mcap"]


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
