"""Ways to write a tape, and ways to reach what was written."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from analytic_scene import BASE_CAMERA, CLASSES, COLOURS, Scene
from family_rows import ROS1
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, DataEnd, Footer, Header
from mcap.records import Message as MessageRecord
from mcap.writer import MCAP0_MAGIC
from range_server import Behaviour, serving
from rosbags import rosbag1, rosbag2
from tape import (
    COLOR_LATE_NS,
    DEPTH_LATE_NS,
    INFO_LATE_NS,
    LABELS_LATE_NS,
    POSE_LATE_NS,
    Tape,
    schema_of,
)
from variant import ROS2, Paths, Store, write

from stsem.classes import ClassSet
from stsem.convert.bags import convert_rosbag1, convert_rosbag2
from stsem.convert.recording import Options
from stsem.log.writer import LogWriter


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
