"""The container in detail: where reading goes on, what is noticed by what, and what hostile numbers cost."""

import hashlib
import struct
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import pytest
import zstandard
from made_up_logs import BASE_NS, ROS, Recorder, picture, room
from mcap.opcode import Opcode

from stsem.log.container.chunk import MAX_CHUNK_BYTES
from stsem.log.container.files import find_files
from stsem.log.container.layout import FRAME, is_whole, string_map
from stsem.log.container.records import MAGIC
from stsem.log.scan import Scan, scan

IMAGE = "sensor_msgs/msg/Image"


def record(opcode: int, body: bytes) -> bytes:
    return FRAME.pack(opcode, len(body)) + body


def text(content: bytes) -> bytes:
    return struct.pack("<I", len(content)) + content


def schema(number: int, name: str, data: bytes = b"") -> bytes:
    return record(Opcode.SCHEMA, struct.pack("<H", number) + text(name.encode()) + text(b"ros2msg") + text(data))


def channel(number: int, schema_id: int, topic: str) -> bytes:
    ids = struct.pack("<HH", number, schema_id)
    return record(Opcode.CHANNEL, ids + text(topic.encode()) + text(b"cdr") + text(b""))


def message(number: int, log_ns: int, payload: bytes = b"") -> bytes:
    return record(Opcode.MESSAGE, struct.pack("<HIQQ", number, 0, log_ns, log_ns) + payload)


def chunk(
    records: bytes, compression: str = "", data: bytes | None = None, size: int | None = None, crc: int | None = None
) -> bytes:
    data, size = records if data is None else data, len(records) if size is None else size
    head = struct.pack("<QQQI", 1, 1, size, zlib.crc32(records) if crc is None else crc)
    return record(Opcode.CHUNK, head + text(compression.encode()) + struct.pack("<Q", len(data)) + data)


def index(number: int, entries: Iterable[tuple[int, int]]) -> bytes:
    return record(
        Opcode.MESSAGE_INDEX, struct.pack("<H", number) + text(b"".join(struct.pack("<QQ", *e) for e in entries))
    )


HEADER = MAGIC + record(Opcode.HEADER, text(b"") + text(b""))
END = record(Opcode.DATA_END, bytes(4)) + record(Opcode.FOOTER, bytes(20)) + MAGIC
A = schema(1, "x/msg/Foreign") + channel(1, 1, "/a")


def scanned(path: Path, data: bytes) -> Scan:
    path.write_bytes(data)
    result = scan(find_files([path]))
    assert result.sha256 == hashlib.sha256(data).hexdigest()
    return result


def counts(result: Scan) -> dict[str, int]:
    return {track.topic: track.count for track in result.tracks.values()}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "x.mcap"


def test_a_file_made_by_hand_is_whole(path: Path) -> None:
    """The pieces of this test file are a conformant recording; else nothing below would mean anything."""
    one = chunk(A + message(1, 1, b"abc"))
    result = scanned(path, HEADER + one + index(1, [(1, len(A))]) + END)
    assert (counts(result), str(result.damage), result.unprotected) == ({"/a": 1}, "none", 0)


@pytest.mark.parametrize("length", [1 << 60, 0, 10, 300])
def test_in_a_file_without_chunks_reading_goes_on_at_the_next_messages(path: Path, length: int) -> None:
    """A false length costs that message, and at most those that it claims."""
    front = HEADER + A + b"".join(message(1, t, b"payload %d" % t) for t in range(100))
    broken = struct.pack("<BQ", Opcode.MESSAGE, length) + message(1, 100, b"is lost")[FRAME.size :]
    back = b"".join(message(1, t, b"payload %d" % t) for t in range(101, 200)) + END
    result = scanned(path, front + broken + back)
    assert result.damage.counts["bad_record"] == {"": 1}
    assert result.damage.counts["unread_byte"][""] < 400
    assert 190 <= counts(result)["/a"] <= 200


def test_the_insides_of_a_lost_chunk_are_not_taken_for_messages(path: Path) -> None:
    """Its checksum can no longer be checked: no message of it is used, and its index says what was lost."""
    one = chunk(A + message(1, 1, b"abc")) + index(1, [(1, len(A))])
    lost = chunk(b"".join(message(1, 1, b"abc") for _ in range(9))) + index(1, [(1, 34 * i) for i in range(9)])
    broken = lost[:3] + b"\xff" + lost[4:9] + b"\xff" + lost[10:]
    broken = broken.replace(struct.pack("<Q", 9 * 34), struct.pack("<Q", 8 * 34))
    result = scanned(path, HEADER + one + broken + one + END)
    assert counts(result) == {"/a": 2}
    assert result.damage.counts["lost_message"] == {"/a": 9}


@pytest.mark.parametrize("wrong", [0x02, 0x04, 0x05, 0x0F, 0x16, 0x86])
def test_a_chunk_whose_kind_is_wrong_is_missed(room_log: Path, wrong: int) -> None:
    """Another known kind, a reserved or a private one: its messages are counted as lost, by channel."""
    data = room_log.read_bytes()
    whole = counts(scanned(room_log, data))
    places, at = [], len(MAGIC)
    while at < len(data) - len(MAGIC):
        places += [at] if data[at] == Opcode.CHUNK else []
        at += FRAME.size + FRAME.unpack_from(data, at)[1]
    changed = bytearray(data)
    changed[places[3]] = wrong
    result = scanned(room_log, bytes(changed))
    lost = result.damage.counts["lost_message"]
    assert {topic: n + lost.get(topic, 0) for topic, n in counts(result).items()} == whole


def test_a_channel_of_the_summary_is_never_a_message(room_log: Path) -> None:
    data = bytearray(room_log.read_bytes())
    whole = counts(scanned(room_log, bytes(data)))
    at = len(data) - len(MAGIC)
    while data[at] != Opcode.CHANNEL or FRAME.unpack_from(data, at)[1] > 200:
        at -= 1
    data[at] = Opcode.MESSAGE
    result = scanned(room_log, bytes(data))
    assert counts(result) == whole
    assert result.damage.counts == {"summary_crc": {"": 1}, "contradiction": {"": 1}}


def test_what_stands_behind_the_closing_magic_is_counted_and_not_read(room_log: Path) -> None:
    data = room_log.read_bytes()
    whole = counts(scanned(room_log, data))
    result = scanned(room_log, data + data)
    assert result.damage.counts == {"unread_byte": {"": len(data)}}
    assert counts(result) == whole


def test_a_chunk_that_was_cut_out_or_doubled_is_noticed(room_log: Path) -> None:
    """Every record is whole, but the statistics and the indexes of the summary say otherwise."""
    data = room_log.read_bytes()
    whole = counts(scanned(room_log, data))
    chunks, at = [], len(MAGIC)
    while at < len(data) - len(MAGIC):
        chunks += [at] if data[at] == Opcode.CHUNK else []
        at += FRAME.size + FRAME.unpack_from(data, at)[1]
    first, last = chunks[2], chunks[3]
    less = scanned(room_log, data[:first] + data[last:])
    lost = less.damage.counts["lost_message"]
    assert {topic: n + lost.get(topic, 0) for topic, n in counts(less).items()} == whole
    more = scanned(room_log, data[:last] + data[first:last] + data[last:])
    assert "lost_message" not in more.damage.counts
    assert more.damage.counts["contradiction"].keys() > {""}


def test_a_part_of_a_chunk_without_checksum_is_kept(path: Path) -> None:
    """The whole records before the broken one; the index tells what is missing."""
    inside = A + message(1, 1, b"abc") + message(1, 1, b"abc")[:-1]
    entries = [(1, len(A)), (1, len(A) + 34)]
    result = scanned(path, HEADER + chunk(inside, crc=0) + index(1, entries) + END)
    assert counts(result) == {"/a": 1}
    assert result.damage.counts == {"bad_record": {"": 1}, "lost_message": {"/a": 1}}
    assert result.unprotected == 1


def test_a_chunk_without_checksum_among_others_is_suspect(path: Path) -> None:
    one = HEADER + chunk(A + message(1, 1, b"abc"))
    result = scanned(path, one + chunk(message(1, 1, b"abc"), crc=0) + END)
    assert (result.damage.counts, result.unprotected) == ({"contradiction": {"": 1}}, 0.5)


@pytest.mark.parametrize(("options", "share"), [({}, 0), ({"enable_data_crcs": True}, 0), ({"enable_crcs": False}, 1)])
def test_what_no_checksum_covers_is_told(tmp_path: Path, options: dict[str, bool], share: float) -> None:
    log = room(tmp_path / "log.mcap", use_chunking="enable_data_crcs" not in options, **options)
    assert scan(find_files([log])).unprotected == share


def test_a_channel_that_means_something_else_later_is_counted_and_holds_from_there_on(path: Path) -> None:
    records = A + message(1, 1) + channel(1, 1, "/b") + message(1, 1) * 2 + channel(1, 1, "/b")
    result = scanned(path, HEADER + records + END)
    assert counts(result) == {"/a": 1, "/b": 2}
    assert result.damage.counts == {"contradiction": {"/a": 1}}


def test_a_topic_that_restarts_is_one_track_and_with_another_schema_two(path: Path) -> None:
    again = channel(2, 1, "/a") + schema(2, "x/msg/Other") + channel(3, 2, "/a")
    result = scanned(path, HEADER + A + again + message(1, 1) + message(2, 2) + message(3, 3) + END)
    assert [(track.topic, track.schema, track.count) for track in result.tracks.values()] == [
        ("/a", "x/msg/Foreign", 2), ("/a", "x/msg/Other", 1),
    ]  # fmt: skip
    assert not result.damage.lossy


def test_a_schema_with_two_texts_is_a_contradiction(path: Path) -> None:
    result = scanned(path, HEADER + A + schema(1, "x/msg/Foreign", b"int8 a") + message(1, 1) + END)
    assert result.damage.counts == {"contradiction": {"": 1}}


def test_a_monstrous_schema_is_not_parsed(path: Path) -> None:
    big = schema(1, IMAGE, b"#" * (1 << 21)) + channel(1, 1, "/cam")
    (track,) = scanned(path, HEADER + big + END).tracks.values()
    assert track.kind is None
    assert "more than any message definition" in track.trouble


def test_duplicates_and_disorder_are_counted(recorder: Callable[..., Recorder]) -> None:
    log = recorder()
    for shift in (0, 2, 2, 1):
        log.ros("/cam", IMAGE, ROS.image(BASE_NS + shift, picture(0), "rgb8"), BASE_NS + shift)
    (track,) = scan(find_files([log.close()])).tracks.values()
    assert (track.duplicates, track.out_of_order) == (1, 1)


INSIDE = A + message(1, 1, b"abc" * 100)
FRAMES = {
    "zstd": [zstandard.compress(INSIDE)],
    "zstd of unknown size": [zstandard.ZstdCompressor(write_content_size=False).compress(INSIDE)],
    "zstd in parts": [zstandard.compress(INSIDE[:50]), zstandard.compress(INSIDE[50:])],
    "zstd behind a skippable frame": [b"\x50\x2a\x4d\x18\4\0\0\0abcd", zstandard.compress(INSIDE)],
    "lz4": [lz4.frame.compress(INSIDE)],
    "lz4 of unknown size": [lz4.frame.compress(INSIDE, store_size=False)],
    "lz4 in parts": [lz4.frame.compress(INSIDE[:50]), lz4.frame.compress(INSIDE[50:])],
}


@pytest.mark.parametrize("name", FRAMES)
def test_compressed_frames_of_every_make(path: Path, name: str) -> None:
    """One or several, of known and unknown size; a stated size that is not theirs is not believed, however large."""
    data, kind = b"".join(FRAMES[name]), name.split()[0]
    result = scanned(path, HEADER + chunk(INSIDE, kind, data) + END)
    assert (counts(result), result.damage.lossy) == ({"/a": 1}, False)
    for size in (0, len(INSIDE) - 1, len(INSIDE) + 1, MAX_CHUNK_BYTES + 1, (1 << 64) - 1):
        result = scanned(path, HEADER + chunk(INSIDE, kind, data, size) + END)
        assert (counts(result), result.damage.counts) == ({}, {"chunk_unreadable": {"": 1}})


def test_thousands_of_broken_places_are_survived(path: Path) -> None:
    """Each gap is counted; behind a limit the rest of the file is."""
    spoilt = b"".join(message(1, t, b"abc") * 3 + b"\0" * 5 for t in range(12_000))
    result = scanned(path, HEADER + A + spoilt + END)
    assert 9_000 < result.damage.counts["bad_record"][""] <= 12_000
    assert counts(result)["/a"] >= 3 * 9_000


def test_fields_are_held_to_their_lengths() -> None:
    metadata = text(b"name") + text(text(b"key") + text(b"value"))
    assert is_whole(Opcode.METADATA, metadata)
    assert not is_whole(Opcode.METADATA, metadata + b"x")
    assert not is_whole(Opcode.METADATA, metadata[:-1])
    assert string_map(memoryview(text(b"key") + text(b"value"))) == {"key": "value"}
    for wrong in (text(b"key"), text(b"key") + b"\1", text(b"key") + text(b"value")[:-1], text(b"k") + text(b"\xff")):
        with pytest.raises(ValueError, match=r"map|utf-8"):
            string_map(memoryview(wrong))


def test_random_bytes_are_no_records(path: Path) -> None:
    noise = np.random.Generator(np.random.PCG64(3)).integers(0, 256, 1 << 18, np.uint8).tobytes()
    result = scanned(path, HEADER + A + message(1, 1) + noise + END)
    assert counts(result) == {"/a": 1}
    assert result.damage.counts["unread_byte"] == {"": len(noise)}
