"""The first pass: what is there is found, what is broken is named, and neither the summary nor an index is believed."""

import hashlib
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zstandard
from made_up_logs import BASE_NS, ROS, Recorder, picture, room
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType

from stsem.errors import LogError
from stsem.log.container.damage import Damage
from stsem.log.container.files import find_files
from stsem.log.container.fingerprint import Fingerprint
from stsem.log.container.records import BLOCK, FRAME, MAGIC
from stsem.log.container.store import Store
from stsem.log.filescan import MIN_RECORDS
from stsem.log.scan import Scan, scan

IMAGE = "sensor_msgs/msg/Image"


def scanned(path: Path) -> Scan:
    return scan(find_files([path]))


def counts(result: Scan) -> dict[str, int]:
    return {track.topic: track.count for track in result.tracks.values()}


def records(data: bytes) -> list[tuple[int, int, int]]:
    """(opcode, place, length) of each record of the top level."""
    found, at = [], len(MAGIC)
    while at + FRAME.size <= len(data) - len(MAGIC):
        opcode, length = FRAME.unpack_from(data, at)
        found.append((opcode, at, length))
        at += FRAME.size + length
    return found


CONTAINERS = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "uncompressed": {"compression": CompressionType.NONE},
    "no chunks": {"use_chunking": False},
    "no index": {"index_types": IndexType.NONE},
    "no summary": {"use_statistics": False, "use_summary_offsets": False, "repeat_channels": False},
    "data checksums": {"enable_data_crcs": True},
    "no checksums": {"enable_crcs": False},
    "one chunk": {"chunk_size": 1 << 30},
}  # fmt: skip


@pytest.mark.parametrize("options", CONTAINERS.values(), ids=CONTAINERS.keys())
def test_every_container_gives_the_same_index(tmp_path: Path, options: dict[str, object]) -> None:
    plain, other = scanned(room(tmp_path / "a.mcap")), scanned(room(tmp_path / "b.mcap", **options))
    assert not other.damage.lossy
    assert other.tracks.keys() == plain.tracks.keys()
    for key, track in plain.tracks.items():
        ours, theirs = track.references(), other.tracks[key].references()
        for column in ("stamp_ns", "log_ns", "length"):
            np.testing.assert_array_equal(getattr(ours, column), getattr(theirs, column))
        np.testing.assert_array_equal(track.stamp_offsets_ns(), other.tracks[key].stamp_offsets_ns())


def test_the_sha256_is_that_of_the_file(room_log: Path) -> None:
    assert scanned(room_log).sha256 == hashlib.sha256(room_log.read_bytes()).hexdigest()


def test_progress_ends_at_the_size_of_the_file(room_log: Path) -> None:
    steps: list[tuple[int, int]] = []
    scan(find_files([room_log]), lambda done, total: steps.append((done, total)))
    assert steps == sorted(steps)
    assert steps[-1] == (room_log.stat().st_size, room_log.stat().st_size)


def test_a_split_recording_is_one_log(tmp_path: Path) -> None:
    """Files come in natural order; a channel that is in several is one; the hash is over all bytes."""
    folder = tmp_path / "run"
    folder.mkdir()
    paths = [room(folder / f"run_{i}.mcap", frames=i % 3 + 1) for i in (10, 2, 1)]
    result = scanned(folder)
    assert [file.source.name for file in result.files] == ["run_1.mcap", "run_2.mcap", "run_10.mcap"]
    assert counts(result)["/cam/color/image_raw"] == 2 + 3 + 2
    whole = b"".join(path.read_bytes() for path in reversed(paths))
    assert result.sha256 == hashlib.sha256(whole).hexdigest()
    again = scan(find_files([*paths, folder]))
    assert again.sha256 == result.sha256


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty (0 bytes)"),
        (b"\x89PNG\r\n\x1a\n" + bytes(100), "not an MCAP file but a PNG image"),
        (b"#ROSBAG V2.0\n" + bytes(100), "not an MCAP file but a ROS 1 bag"),
        (b"SQLite format 3\0" + bytes(100), "sqlite3"),
        (b"hello, world", "begins with the bytes 68 65"),
        (MAGIC[:3], "begins with the bytes 89 4d 43"),
    ],
)
def test_what_is_no_log_is_refused_by_name(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(LogError, match="give an MCAP recording") as caught:
        scanned(path)
    assert words in str(caught.value)


def test_missing_files_and_empty_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"There is no file .*nowhere"):
        find_files([tmp_path / "nowhere.mcap"])
    with pytest.raises(LogError, match=r"holds no \.mcap file"):
        find_files([tmp_path])
    with pytest.raises(LogError, match="No log was given"):
        find_files([])


def test_a_cut_anywhere_is_survived_and_named(tmp_path: Path) -> None:
    """Whatever is left of the file, the whole records before the cut are there and the log is `truncated`."""
    data = room(tmp_path / "whole.mcap").read_bytes()
    whole = counts(scanned(tmp_path / "whole.mcap"))
    path, before = tmp_path / "cut.mcap", 0
    for size in range(len(MAGIC), len(data), 211):
        path.write_bytes(data[:size])
        result = scanned(path)
        assert result.damage.counts["truncated"] == {"": 1}
        got = counts(result)
        assert all(got[topic] <= whole[topic] for topic in got)
        assert sum(got.values()) >= before
        before = sum(got.values())
    assert before == sum(whole.values())


def test_a_flip_anywhere_in_a_chunk_is_caught(tmp_path: Path) -> None:
    """One bit anywhere in the body of a chunk record: the chunk is lost, its messages are counted, the rest is kept."""
    data = room(tmp_path / "whole.mcap").read_bytes()
    whole = counts(scanned(tmp_path / "whole.mcap"))
    place, length = next((p, n) for opcode, p, n in records(data) if opcode == Opcode.CHUNK and p > len(data) // 3)
    path = tmp_path / "flipped.mcap"
    start = place + FRAME.size + 16  # behind the two times, which nothing is read from
    for at in range(start, place + FRAME.size + length, 37):
        flipped = bytearray(data)
        flipped[at] ^= 1 << at % 8
        path.write_bytes(flipped)
        result = scanned(path)
        kinds = result.damage.counts
        assert kinds.get("chunk_crc", kinds.get("chunk_unreadable")) == {"": 1}
        got, lost = counts(result), kinds["lost_message"]
        assert {topic: got.get(topic, 0) + lost.get(topic, 0) for topic in whole} == whole


@pytest.mark.parametrize("chunked", [True, False])
def test_a_flip_outside_chunks_is_caught_by_the_data_checksum(tmp_path: Path, chunked: bool) -> None:
    path = room(tmp_path / "whole.mcap", enable_data_crcs=True, use_chunking=chunked)
    data = bytearray(path.read_bytes())
    wanted = Opcode.MESSAGE_INDEX if chunked else Opcode.MESSAGE
    place, length = next((p, n) for opcode, p, n in records(data) if opcode == wanted)
    data[place + FRAME.size + length - 1] ^= 1
    path.write_bytes(data)
    others = {"contradiction": {"/gt/label_info": 1}} if chunked else {}
    assert scanned(path).damage.counts == {"data_crc": {"": 1}} | others


def test_a_flip_in_the_summary_is_caught_by_its_checksum(room_log: Path) -> None:
    data = bytearray(room_log.read_bytes())
    place = next(p for opcode, p, _ in records(data) if opcode == Opcode.STATISTICS)
    data[place + FRAME.size] ^= 1
    room_log.write_bytes(data)
    result = scanned(room_log)
    assert result.damage.counts == {"summary_crc": {"": 1}, "contradiction": {"": 1}}
    assert counts(result)["/tf"] == 12


def test_a_flip_in_an_attachment_is_caught(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    for name in ("classes.json", "notes.txt"):
        log.writer.add_attachment(0, 0, name, "text/plain", b"some words that are checked")
    path = log.close()
    assert scanned(path).attachments == {"classes.json": b"some words that are checked"}
    data = path.read_bytes()
    path.write_bytes(data.replace(b"checked", b"chucked"))
    result = scanned(path)
    assert result.damage.counts["attachment_crc"] == {"": 2}
    assert result.attachments == {}


@pytest.mark.parametrize("length", [1 << 60, 1, 40, 1 << 13])
def test_a_false_length_costs_no_more_than_its_record(room_log: Path, length: int) -> None:
    """Reading goes on at the next record; a chunk whose own lengths agree is whole again, checksum and all."""
    whole = counts(scanned(room_log))
    data = bytearray(room_log.read_bytes())
    place = next(p for opcode, p, n in records(data) if opcode == Opcode.CHUNK and p > len(data) // 3)
    data[place + 1 : place + 9] = struct.pack("<Q", length)
    room_log.write_bytes(data)
    result = scanned(room_log)
    assert result.damage.counts == {"bad_record": {"": 1}}
    assert counts(result) == whole
    assert result.sha256 == hashlib.sha256(data).hexdigest()


def test_a_chunk_that_states_a_monstrous_size_is_not_believed(room_log: Path) -> None:
    for size in (1 << 62, 1 << 34, 1 << 20, 1):
        data = bytearray(room_log.read_bytes())
        place = next(p for opcode, p, _ in records(data) if opcode == Opcode.CHUNK)
        data[place + FRAME.size + 16 : place + FRAME.size + 24] = struct.pack("<Q", size)
        path = room_log.with_name("bomb.mcap")
        path.write_bytes(data)
        assert scanned(path).damage.counts["chunk_unreadable"] == {"": 1}


@pytest.mark.parametrize(
    ("record", "kind"),
    [
        (bytes(FRAME.size), "bad_record"),
        (FRAME.pack(Opcode.SCHEMA, 14) + bytes(14), "bad_record"),
        (FRAME.pack(Opcode.MESSAGE, 22) + bytes(22), "unknown_channel"),
    ],
    ids=["nothing", "schemas", "messages"],
)
def test_a_chunk_of_some_kilobytes_is_not_a_million_records(tmp_path: Path, record: bytes, kind: str) -> None:
    """What is looked at is in proportion to the bytes in the file, not to what they unpack to."""
    content = record * 400_000
    packed = zstandard.ZstdCompressor().compress(content)
    body = struct.pack("<QQQI", 0, 0, len(content), 0) + struct.pack("<I4sQ", 4, b"zstd", len(packed)) + packed
    path = tmp_path / "bomb.mcap"
    path.write_bytes(MAGIC + FRAME.pack(Opcode.HEADER, 8) + bytes(8) + FRAME.pack(Opcode.CHUNK, len(body)) + body)
    found = scanned(path).damage.counts
    assert 0 < sum(found[kind].values()) <= MIN_RECORDS + len(packed) + 2
    assert found["bad_record"]


def test_channels_lost_with_their_chunk_are_taken_from_the_summary(room_log: Path) -> None:
    """A recorder writes schemas and channels into the first chunk only; losing it must not lose all others."""
    whole = counts(scanned(room_log))
    data = bytearray(room_log.read_bytes())
    place, length = next((p, n) for opcode, p, n in records(data) if opcode == Opcode.CHUNK)
    data[place + FRAME.size + length - 3] ^= 16
    room_log.write_bytes(data)
    result = scanned(room_log)
    lost = sum(result.damage.counts["lost_message"].values())
    assert sum(counts(result).values()) == sum(whole.values()) - lost
    assert "unknown_channel" not in result.damage.counts
    color = result.tracks["/cam/color/image_raw", "cdr", IMAGE]
    assert len(color.references()) == color.count >= 4


def test_messages_of_a_channel_described_nowhere_are_counted(recorder: Callable[..., Recorder]) -> None:
    log = recorder(use_chunking=False, repeat_channels=False)
    log.ros("/cam/image", IMAGE, ROS.image(BASE_NS, picture(0), "rgb8"), BASE_NS)
    path = log.close()
    data = path.read_bytes()
    place, length = next((p, n) for opcode, p, n in records(data) if opcode == Opcode.CHANNEL)
    path.write_bytes(data[:place] + data[place + FRAME.size + length :])
    assert scanned(path).damage.counts["unknown_channel"] == {"channel 1": 1}


def test_an_unreadable_message_of_a_small_kind_is_counted_once(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    log.ros("/tf", "tf2_msgs/msg/TFMessage", b"\0\1\0\0\xff\xff\xff\x0f", BASE_NS)
    log.ros("/cam", IMAGE, b"", BASE_NS)
    result = scanned(log.close())
    assert result.damage.counts == {"undecodable": {"/cam": 1, "/tf": 1}}


def test_a_schema_that_cannot_be_read_is_said_and_its_channel_left_alone(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    log.add("/cam", "foxglove.RawImage", "protobuf", b"\xff\xff\xff", "protobuf", b"", BASE_NS)
    (track,) = scanned(log.close()).tracks.values()
    assert track.kind is None
    assert "schema of /cam cannot be read" in track.trouble


def test_foreign_channels_are_counted_but_cost_no_memory(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    for i in range(50):
        log.add("/imu", "sensor_msgs/msg/Imu", "ros2msg", b"", "cdr", b"whatever", BASE_NS + i * i)
    (track,) = scanned(log.close()).tracks.values()
    assert (track.count, track.largest_gap_ns, len(track.references())) == (50, 97, 0)


def test_equal_log_times_are_ordered_by_position(recorder: Callable[..., Recorder]) -> None:
    """(stamp, log time, position): the order of the file decides where times do not."""
    log = recorder(chunk_size=1)
    for value in (3, 1, 2):
        log.ros("/cam", IMAGE, ROS.image(BASE_NS, np.full((2, 2, 3), value, np.uint8), "rgb8"), BASE_NS)
    result = scanned(log.close())
    rows = result.tracks["/cam", "cdr", IMAGE].references()
    with Store(result.files, result.chunks) as store:
        last = [store.payload(*map(int, row))[-1] for row in zip(rows.place, rows.offset, rows.length, strict=True)]
    assert last == [3, 1, 2]


def test_the_fingerprint_keeps_sections_apart() -> None:
    with Fingerprint() as fingerprint:
        fingerprint.feed(b"abc")
        fingerprint.restart_section()
        fingerprint.feed(b"1234" * BLOCK)
        fingerprint.feed(b"56789")
        whole = b"abc" + b"1234" * BLOCK + b"56789"
        assert fingerprint.hexdigest() == hashlib.sha256(whole).hexdigest()
        fingerprint.restart_section()
        fingerprint.feed(b"123456789")
        assert fingerprint.crc() == 0xCBF43926  # the check value of CRC-32


def test_damage_counts_a_message_once() -> None:
    damage = Damage()
    assert (damage.lossy, str(damage)) == (False, "none")
    damage.undecodable("/cam", 30, 20, "the jpeg ends early")
    for _ in range(3):
        damage.undecodable("/cam", 10, 20, "it is\nno jpeg")
    damage.count("truncated")
    damage.count("lost_message", "/cam", 0)
    assert damage.as_dict() == {"lossy": True, "counts": {"truncated": {"": 1}, "undecodable": {"/cam": 2}}}
    assert str(damage) == "truncated 1, undecodable 2 (/cam); the first of /cam: it is\\nno jpeg"
