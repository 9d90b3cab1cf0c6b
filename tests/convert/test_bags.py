"""ROS bags: every message byte by byte as rosbags wrote it, also out of damaged bags; definitions that are complete."""

import os
import shutil
import sqlite3
import struct
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_up_images import contents, encoded, rgb
from mcap.reader import make_reader

from stsem.convert import definitions
from stsem.convert import rosbag2 as rosbag2_reader
from stsem.convert.bags import convert_rosbag1, convert_rosbag2
from stsem.convert.recording import Options, Summary
from stsem.errors import ConversionError, MissingExtraError
from stsem.log.log import open_log

rosbag1 = pytest.importorskip("rosbags.rosbag1")
rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

START_NS, PERIOD_NS, FRAMES = 1_700_000_000_000_000_000, 100_000_000, 6
Stored = list[tuple[str, int, bytes]]


def quietly(done: int, total: int) -> None:
    assert 0 <= done <= total


def image_messages(store: Any, *, ros1: bool) -> Stored:
    """(topic, log time, payload) of a compressed camera and a moving transform."""
    types = store.types
    header_type, stamp_type = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    found: Stored = []
    for k in range(FRAMES):
        stamp = START_NS + k * PERIOD_NS
        told = {"stamp": stamp_type(*divmod(stamp, 10**9)), "frame_id": "camera"}
        header = header_type(seq=k, **told) if ros1 else header_type(**told)
        data = np.frombuffer(encoded(rgb(k)), np.uint8)
        image = types["sensor_msgs/msg/CompressedImage"](header=header, format="png", data=data)
        pose_type, point_type = types["geometry_msgs/msg/Pose"], types["geometry_msgs/msg/Point"]
        pose = pose_type(point_type(0.1 * k, 0.0, 0.0), types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0))
        stamped = types["geometry_msgs/msg/PoseStamped"](header=header, pose=pose)
        found.append(("/cam/image/compressed", stamp + 7, bytes(serialize(image, image.__msgtype__))))
        found.append(("/pose", stamp + 9, bytes(serialize(stamped, stamped.__msgtype__))))
    return found


TYPES = {"/cam/image/compressed": "sensor_msgs/msg/CompressedImage", "/pose": "geometry_msgs/msg/PoseStamped"}


def write_rosbag1(path: Path, compression: str | None = None, chunk_bytes: int = 1 << 20) -> Stored:
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    stored = image_messages(store, ros1=True)
    writer = rosbag1.Writer(path)
    writer.chunk_threshold = chunk_bytes
    if compression:
        writer.set_compression(rosbag1.Writer.CompressionFormat[compression])
    with writer:
        topics = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in TYPES.items()}
        for topic, log_ns, data in stored:
            writer.write(topics[topic], log_ns, data)
    return stored


def write_rosbag2(path: Path, mode: Literal["none", "file", "message"] = "none") -> Stored:
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    stored = image_messages(store, ros1=False)
    writer = rosbag2.Writer(path, version=9)
    if mode != "none":
        writer.set_compression(rosbag2.CompressionMode[mode.upper()], rosbag2.CompressionFormat.ZSTD)
    with writer:
        topics = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in TYPES.items()}
        for topic, log_ns, data in stored:
            writer.write(topics[topic], log_ns, data)
    return stored


def read_back(log: Path) -> Stored:
    with log.open("rb") as stream:
        messages = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in messages]


def check_frames(log_path: Path) -> None:
    """The reader sees the images and poses that went into the bag."""
    with open_log([log_path]) as log:
        assert [plan.stamp_ns for plan in log.plans] == [START_NS + k * PERIOD_NS for k in range(FRAMES)]
        for k in range(FRAMES):
            frame = log.frame(k, depth=False, previous=False)
            np.testing.assert_array_equal(frame.image, rgb(k))
            assert frame.T_WC is not None
            assert frame.T_WC[0, 3] == pytest.approx(0.1 * k)


def lost(summary: Summary) -> int:
    return sum(summary.losses.values())


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
def test_a_ros1_bag_is_copied_byte_by_byte(tmp_path: Path, compression: str | None) -> None:
    stored = write_rosbag1(tmp_path / "drive.bag", compression)
    before = contents(tmp_path)
    summary = convert_rosbag1(tmp_path / "drive.bag", tmp_path / "out.mcap", Options(), quietly)
    assert summary == Summary({"/cam/image/compressed": FRAMES, "/pose": FRAMES})
    assert read_back(tmp_path / "out.mcap") == stored
    assert {**contents(tmp_path), **before} == contents(tmp_path)
    check_frames(tmp_path / "out.mcap")


@pytest.mark.parametrize("mode", ["none", "file", "message"])
def test_a_ros2_bag_is_copied_byte_by_byte(tmp_path: Path, mode: Literal["none", "file", "message"]) -> None:
    """Nothing is left in the bag's folder or beside the log, also of a bag that had to be unpacked."""
    stored = write_rosbag2(tmp_path / "drive", mode)
    before = contents(tmp_path / "drive")
    summary = convert_rosbag2(tmp_path / "drive", tmp_path / "out.mcap", Options(), quietly)
    assert summary == Summary({"/cam/image/compressed": FRAMES, "/pose": FRAMES})
    assert read_back(tmp_path / "out.mcap") == stored
    assert contents(tmp_path / "drive") == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drive", "out.mcap"]
    check_frames(tmp_path / "out.mcap")


def test_schemas_are_complete(tmp_path: Path) -> None:
    """All that a type is made of, one behind the other, as MCAP wants it."""
    write_rosbag1(tmp_path / "drive.bag")
    convert_rosbag1(tmp_path / "drive.bag", tmp_path / "1.mcap", Options(), quietly)
    write_rosbag2(tmp_path / "drive")
    convert_rosbag2(tmp_path / "drive", tmp_path / "2.mcap", Options(), quietly)
    expected = {
        "1.mcap": ("ros1msg", "ros1", "sensor_msgs/CompressedImage"),
        "2.mcap": ("ros2msg", "cdr", "sensor_msgs/msg/CompressedImage"),
    }
    for name, (language, encoding, type_name) in expected.items():
        with (tmp_path / name).open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        assert {schema.encoding for schema in summary.schemas.values()} == {language}
        assert {channel.message_encoding for channel in summary.channels.values()} == {encoding}
        (image,) = (schema for schema in summary.schemas.values() if schema.name == type_name)
        assert b"=" * 80 + b"\nMSG: std_msgs/Header\n" in image.data


def test_a_bag_in_several_files_is_one_log(tmp_path: Path) -> None:
    """In natural order: file 10 comes behind file 9; a file that metadata.yaml names and that is gone is a loss."""
    stored = write_rosbag2(tmp_path / "drive")
    whole = tmp_path / "drive/drive.db3"
    for part in (9, 10):
        copy = tmp_path / f"drive/drive_{part}.db3"
        copy.write_bytes(whole.read_bytes())
        with sqlite3.connect(copy) as db:
            db.execute(f"DELETE FROM messages WHERE id {'>' if part == 9 else '<='} 6")
    whole.unlink()
    summary = convert_rosbag2(tmp_path / "drive", tmp_path / "out.mcap", Options(), quietly)
    assert read_back(tmp_path / "out.mcap") == stored
    assert summary.losses == {"files that metadata.yaml names and that are not there": 1}


def without_definitions(bag: Path) -> Path:
    """As ROS 2 Humble and older recorded it."""
    with sqlite3.connect(bag / "drive.db3") as db:
        db.execute("DROP TABLE message_definitions")
    return bag


def test_definitions_that_the_bag_lacks_are_looked_up(tmp_path: Path) -> None:
    """Those of one type nobody knows: its messages are left out, counted."""
    stored = write_rosbag2(tmp_path / "drive")
    with sqlite3.connect(without_definitions(tmp_path / "drive") / "drive.db3") as db:
        db.execute("UPDATE topics SET type = 'my_msgs/msg/Secret' WHERE name = '/pose'")
    summary = convert_rosbag2(tmp_path / "drive", tmp_path / "out.mcap", Options(), quietly)
    assert read_back(tmp_path / "out.mcap") == [row for row in stored if row[0] != "/pose"]
    assert summary.losses == {"messages of /pose, as nobody knows the definition of my_msgs/msg/Secret": FRAMES}
    with open_log([tmp_path / "out.mcap"]) as log:
        np.testing.assert_array_equal(log.frame(2, depth=False, previous=False).image, rgb(2))


def test_without_the_extra_a_sentence_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only for bags without definitions, and nothing is left behind."""
    write_rosbag2(tmp_path / "drive")
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    definitions._stores.cache_clear()
    convert_rosbag2(tmp_path / "drive", tmp_path / "out.mcap", Options(), quietly)
    (tmp_path / "out.mcap").unlink()
    with pytest.raises(MissingExtraError, match=r"pip install 'stsem\[convert\]'"):
        convert_rosbag2(without_definitions(tmp_path / "drive"), tmp_path / "out.mcap", Options(), quietly)
    definitions._stores.cache_clear()
    assert [path.name for path in tmp_path.iterdir()] == ["drive"]


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
def test_a_cut_ros1_bag_gives_what_it_holds(tmp_path: Path, compression: str | None) -> None:
    """Wherever it is cut: never a traceback, the messages are a beginning of the originals, and the loss is said."""
    bag = tmp_path / "drive.bag"
    stored = write_rosbag1(bag, compression, chunk_bytes=1)
    data = bag.read_bytes()
    seen: Counter[int] = Counter()
    for length in range(13, len(data), max(1, len(data) // 60)):
        bag.write_bytes(data[:length])
        try:
            summary = convert_rosbag1(bag, tmp_path / "out.mcap", Options(), quietly)
        except ConversionError as err:
            assert "no log was written" in str(err)  # noqa: PT017 - either outcome is fine, both are checked
            continue
        found = read_back(tmp_path / "out.mcap")
        assert found == stored[: len(found)]
        assert len(found) == len(stored) or lost(summary)
        seen[len(found)] += 1
    assert len(seen) > 3


def test_a_flipped_byte_costs_one_chunk(tmp_path: Path) -> None:
    """The index says how many messages are gone."""
    bag = tmp_path / "drive.bag"
    stored = write_rosbag1(bag, "BZ2", chunk_bytes=1)
    data = bytearray(bag.read_bytes())
    at = data.index(b"BZh9", data.index(b"BZh9") + 4)
    data[at + 40] ^= 0x55
    bag.write_bytes(data)
    summary = convert_rosbag1(bag, tmp_path / "out.mcap", Options(), quietly)
    found = read_back(tmp_path / "out.mcap")
    assert [row for row in stored if row in found] == found
    gone = summary.losses["messages that the bag's index names and that cannot be read"]
    assert 0 < gone == len(stored) - len(found) < len(stored)


def long_rosbag2(folder: Path) -> Stored:
    """A bag of many pages: rows of one, and rows that go over several."""
    stored = write_rosbag2(folder)
    more = [("/pose", START_NS + k, os.urandom(300 if k % 3 else 9000)) for k in range(150)]
    with closing(sqlite3.connect(folder / "drive.db3")) as db, db:
        (topic,) = db.execute("SELECT id FROM topics WHERE name = '/pose'").fetchone()
        rows = [(topic, log_ns, data) for _, log_ns, data in more]
        db.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    return stored + more


def test_a_damaged_ros2_bag_gives_what_it_holds(tmp_path: Path) -> None:
    """Pages overwritten in the middle of the file: what stands before and behind them, and how many are gone."""
    stored = long_rosbag2(tmp_path / "drive")
    (tmp_path / "drive/metadata.yaml").unlink()
    path = tmp_path / "drive/drive.db3"
    data = bytearray(path.read_bytes())
    middle = len(data) // 8192 * 4096
    data[middle : middle + 16384] = b"\xaa" * 16384
    path.write_bytes(data)
    summary = convert_rosbag2(tmp_path / "drive", tmp_path / "out.mcap", Options(), quietly)
    found = read_back(tmp_path / "out.mcap")
    assert found[-1] == stored[-1]
    gone = [row for row in stored if row not in found]
    assert summary.losses == {rosbag2_reader.MISSING: len(gone)}
    assert 0 < len(gone) < 20
    assert found == [row for row in stored if row not in gone]


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8, 0.95, 0.99])
@pytest.mark.parametrize("packed", [False, True])
def test_a_cut_ros2_bag_gives_what_it_holds(tmp_path: Path, share: float, packed: bool) -> None:
    """Whole messages only, and about as many as there are bytes; nothing is written beside the bag."""
    bag = tmp_path / "drive"
    stored = long_rosbag2(bag)
    (bag / "metadata.yaml").unlink()
    whole = (bag / "drive.db3").read_bytes()
    cut = whole[: int(len(whole) * share)]
    (bag / "drive.db3").write_bytes(cut)
    if packed:
        (bag / "drive.db3").unlink()
        (bag / "drive.db3.zstd").write_bytes(zstandard.compress(cut))
    summary = convert_rosbag2(bag, tmp_path / "out.mcap", Options(), quietly)
    found = read_back(tmp_path / "out.mcap")
    assert found == [row for row in stored if row in found]
    assert len(found) > (share - 0.1) * len(stored)
    assert summary.losses[rosbag2_reader.NO_END] == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drive", "out.mcap"]
    assert len(list(bag.iterdir())) == 1


def left_open(path: Path, mode: str, *, commit: bool) -> Stored:
    """What a recorder leaves that loses its power: the file, and what was to be written to it."""
    more = [("/pose", START_NS + k, os.urandom(9000)) for k in range(40)]
    with closing(sqlite3.connect(path)) as db:
        (topic,) = db.execute("SELECT id FROM topics WHERE name = '/pose'").fetchone()
        db.execute(f"PRAGMA journal_mode = {mode}")
        db.execute("PRAGMA cache_size = 4")
        db.execute("PRAGMA wal_autocheckpoint = 0")
        rows = [(topic, log_ns, data) for _, log_ns, data in more]
        db.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
        if commit:
            db.commit()
        kept = {part: part.read_bytes() for part in path.parent.iterdir() if part.name[-4:] in (".db3", "-wal", "rnal")}
    for part, data in kept.items():
        part.write_bytes(data)
    assert len(kept) == 2
    return more


@pytest.mark.parametrize(("mode", "commit"), [("wal", True), ("wal", False), ("delete", False)])
def test_a_bag_that_was_not_closed_gives_what_was_finished(tmp_path: Path, mode: str, commit: bool) -> None:
    """What stands in the write-ahead file only is there, a half-written change is not; the bag stays as it is."""
    bag = tmp_path / "drive"
    stored = write_rosbag2(bag)
    more = left_open(bag / "drive.db3", mode, commit=commit)
    before = contents(bag)
    summary = convert_rosbag2(bag, tmp_path / "out.mcap", Options(), quietly)
    assert read_back(tmp_path / "out.mcap") == stored + (more if commit else [])
    assert summary.losses == {rosbag2_reader.UNCLOSED: 1}
    assert contents(bag) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drive", "out.mcap"]


def test_a_journal_that_names_another_file_does_no_harm(tmp_path: Path) -> None:
    """sqlite deletes a file that a journal calls its super-journal."""
    bag, victim = tmp_path / "drive", tmp_path / "victim"
    write_rosbag2(bag)
    left_open(bag / "drive.db3", "delete", commit=False)
    victim.write_bytes(b"dear to somebody")
    name = str(victim).encode()
    tail = struct.pack(">I", 0x40000000 // 4096 + 1) + name + struct.pack(">II", len(name), sum(name))
    with (bag / "drive.db3-journal").open("ab") as journal:
        journal.write(tail + bytes.fromhex("d9d505f920a163d7"))
    shutil.copytree(bag, tmp_path / "opened")
    convert_rosbag2(bag, tmp_path / "out.mcap", Options(), quietly)
    assert victim.exists()
    with closing(sqlite3.connect(tmp_path / "opened/drive.db3")) as db:
        db.execute("SELECT count(*) FROM messages").fetchall()
    assert not victim.exists(), "the danger is not there any more"


def test_a_bag_with_a_broken_write_ahead_file_is_read_without(tmp_path: Path) -> None:
    """It is not touched, and it is said that messages may be missing."""
    stored = write_rosbag2(tmp_path / "drive")
    (tmp_path / "drive/drive.db3-wal").write_bytes(b"late messages")
    before = contents(tmp_path / "drive")
    summary = convert_rosbag2(tmp_path / "drive", tmp_path / "out.mcap", Options(), quietly)
    assert read_back(tmp_path / "out.mcap") == stored
    assert summary.losses == {rosbag2_reader.UNCLOSED: 1}
    assert contents(tmp_path / "drive") == before


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"#ROSBAG V1.2\n", "not a ROS bag of version 2.0"),
        (b"#ROSBAG V2.0\n", "no log was written"),
        (b"#ROSBAG V2.0\n" + b"\0" * 4096, "no log was written"),
        (b"#ROSBAG V2.0\n" + b"\xff" * 4096, "no log was written"),
        (b"#ROSBAG V2.0\n\x1f\0\0\0\x04\0\0\0op=\x03\x13\0\0\0encryptor=rosbag/Aes\0\0\0\0", "is encrypted"),
    ],
)
def test_what_is_no_ros1_bag_is_a_sentence(tmp_path: Path, content: bytes, sentence: str) -> None:
    (tmp_path / "x.bag").write_bytes(content)
    with pytest.raises(ConversionError, match=sentence):
        convert_rosbag1(tmp_path / "x.bag", tmp_path / "out.mcap", Options(), quietly)
    assert [path.name for path in tmp_path.iterdir()] == ["x.bag"]


@pytest.mark.parametrize("name", ["x.db3", "x.db3.zstd"])
@pytest.mark.parametrize("content", [b"", b"SQLite format 3\0" + b"\1" * 4000, b"\x28\xb5\x2f\xfd\x04\x00"])
def test_what_is_no_ros2_bag_is_a_sentence(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ConversionError):
        convert_rosbag2(tmp_path / name, tmp_path / "out.mcap", Options(), quietly)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_message_that_unpacks_to_too_much_is_left_out(tmp_path: Path) -> None:
    """A frame that announces 2^60 bytes costs no memory."""
    write_rosbag2(tmp_path / "drive", "message")
    huge = b"\x28\xb5\x2f\xfd\xe0" + (1 << 60).to_bytes(8, "little") + b"\x01\0\0"
    with sqlite3.connect(tmp_path / "drive/drive.db3") as db:
        db.execute("UPDATE messages SET data = ? WHERE id = 3", (huge,))
    summary = convert_rosbag2(tmp_path / "drive", tmp_path / "out.mcap", Options(), quietly)
    assert summary.losses == {
        "compressed messages that do not state a size that can be": 1,
        "messages that metadata.yaml counts and that cannot be read": 1,
    }
    assert sum(summary.messages.values()) == 2 * FRAMES - 1


@pytest.mark.parametrize("made_up", ["messages", "topics"])
def test_a_bag_whose_columns_are_formulas_has_no_end_of_content(tmp_path: Path, made_up: str) -> None:
    """Hundreds of rows of a million bytes each in a file of some kilobytes."""
    topic, data = ("hex(zeroblob(500000))", "x'00'") if made_up == "topics" else ("'/a'", "zeroblob(1000000)")
    path = tmp_path / "drive.db3"
    with sqlite3.connect(path) as db:
        db.execute(
            "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT AS ("
            f"{topic}), type TEXT DEFAULT 'std_msgs/msg/Empty', serialization_format TEXT DEFAULT 'cdr')"
        )
        db.execute(f"CREATE TABLE messages (topic_id INTEGER, timestamp INTEGER, data BLOB AS ({data}))")
        db.executemany("INSERT INTO topics (id) VALUES (?)", [(k,) for k in range(500)])
        db.executemany("INSERT INTO messages (topic_id, timestamp) VALUES (1, ?)", [(k,) for k in range(500)])
    with pytest.raises(ConversionError, match=r"it holds more than its bytes|damaged from some message on"):
        convert_rosbag2(path, tmp_path / "out.mcap", Options(), quietly)
    assert [found.name for found in tmp_path.iterdir()] == ["drive.db3"]


def mutated(data: st.DataObject, content: bytes) -> bytes:
    """Bytes replaced, and perhaps the end cut off."""
    changed = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(changed) - 1))
        piece = data.draw(st.sampled_from([b"\0", b"\xff" * 4, b"\x7f", b"\0" * 64]))
        changed[at : at + len(piece)] = piece
    return bytes(changed[: data.draw(st.sampled_from([len(changed), len(changed) // 2, len(changed) - 1]))])


@pytest.mark.parametrize("kind", ["LZ4", "BZ2", "plain", "sqlite3"])
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_damage_is_a_traceback(tmp_path: Path, kind: str, data: st.DataObject) -> None:
    """A log or a sentence, and in both cases nothing else is left behind."""
    original = tmp_path / "original"
    if kind == "sqlite3":
        if not original.exists():
            write_rosbag2(original)
        source, content, convert = tmp_path / "x.db3", (original / "original.db3").read_bytes(), convert_rosbag2
    else:
        if not original.exists():
            write_rosbag1(original, None if kind == "plain" else kind, chunk_bytes=2000)
        source, content, convert = tmp_path / "x.bag", original.read_bytes(), convert_rosbag1
    source.write_bytes(mutated(data, content))
    out = tmp_path / "out.mcap"
    out.unlink(missing_ok=True)
    try:
        summary = convert(source, out, Options(), lambda done, total: None)
    except ConversionError:
        assert not out.exists()
    else:
        assert sum(summary.messages.values()) == len(read_back(out))
    assert {path.name for path in tmp_path.iterdir()} <= {"original", source.name, out.name}
