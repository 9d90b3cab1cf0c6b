"""Logs that stsem writes: read back by stsem's reader and by mcap's own, and whole or not there at all."""

import json
import struct
from pathlib import Path
from typing import IO, Any

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import DataEnd
from mcap.stream_reader import StreamReader

from stsem.camera import Camera
from stsem.classes import ClassSet
from stsem.errors import OutputError
from stsem.log.log import open_log
from stsem.log.writer import LogWriter
from stsem.pose import Pose, from_quaternion

NS = 1_000_000_000
START_NS, PERIOD_NS = 1_700_000_000 * NS + 123_456_789, NS // 10
CLASSES = ClassSet(("wall", "Floor lamp", "PC"), ((1, 2, 3), (40, 50, 60), (255, 0, 128)))
CAMERA = Camera(40, 30, 25.5, 26.5, 19.5, 14.25)
TOPICS = {"/camera/color", "/camera/depth", "/camera/calibration", "/gt/labels", "/pose"}


def picture(k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """A smooth gradient whose red, green and blue differ, so that JPEG keeps it and a swap of channels shows."""
    y, x = np.mgrid[:30, :40]
    return np.stack([5 * x + k, 6 * y, 200 - 4 * x], axis=-1).astype(np.uint8)


def depth_mm(k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    depth = (np.arange(30 * 40, dtype=np.uint16).reshape(30, 40) * 50 + k).astype(np.uint16)
    depth[3, 4] = 0
    return depth


def truth(k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    labels = (np.arange(30 * 40).reshape(30, 40) + k) % 3
    labels[5, 6] = 255
    return labels.astype(np.uint8)


def pose(k: int) -> Pose:
    return from_quaternion((1.0 + 0.1 * k, -2.0, 1.25), (0.5, -0.4 + 0.01 * k, 0.3, -0.7))


def write(path: Path, frames: int = 4) -> Path:
    with LogWriter(path, CLASSES) as log:
        for k in range(frames):
            stamp = START_NS + k * PERIOD_NS
            log.calibration(stamp, stamp + 1_000_000, CAMERA)
            log.pose(stamp, stamp + 2_000_000, pose(k))
            log.color(stamp, stamp + 5_000_000, picture(k))
            log.depth(stamp, stamp + 5_000_000, depth_mm(k))
            log.labels(stamp, stamp + 9_000_000, truth(k))
    return path


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("written") / "log.mcap")


def test_our_reader_gets_back_what_was_written(written: Path) -> None:
    """Depth and labels exactly, colour as JPEG keeps it, poses to 1e-9, camera, classes with colours, stamps."""
    with open_log([written]) as log:
        assert not log.info.damage.lossy
        assert log.info.warnings == ()
        assert log.classes == CLASSES
        assert log.camera is not None
        np.testing.assert_array_equal(log.camera.K, CAMERA.K)
        assert log.size == (40, 30)
        assert not log.camera.is_distorted
        for k, plan in enumerate(log.plans):
            stamp = START_NS + k * PERIOD_NS
            assert (plan.stamp_ns, plan.color_log_ns, plan.truth_log_ns) == (
                stamp,
                stamp + 5_000_000,
                stamp + 9_000_000,
            )
            frame = log.frame(k, depth=True, previous=False)
            assert frame.depth is not None
            assert frame.T_WC is not None
            assert np.abs(frame.image.astype(int) - picture(k)).max() < 16
            known = depth_mm(k) > 0
            np.testing.assert_allclose(frame.depth[known], depth_mm(k)[known] / 1000, rtol=1e-6)
            assert np.isnan(frame.depth[~known]).all()
            np.testing.assert_allclose(frame.T_WC, pose(k), atol=1e-9)
            labels = log.truth(k)
            assert labels is not None
            np.testing.assert_array_equal(labels, truth(k))
        assert len(log.plans) == 4


def test_mcaps_own_reader_finds_sound_chunks_in_order(written: Path) -> None:
    """Every checksum holds, log times ascend, publish time is the stamp, sequences count per topic from zero."""
    with written.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        messages = list(reader.iter_messages(log_time_order=False))
        summary = reader.get_summary()
    times = [message.log_time for _, _, message in messages]
    assert times == sorted(times)
    assert len(messages) == 4 * 5
    for topic in TOPICS:
        mine = [message for _, channel, message in messages if channel.topic == topic]
        assert [m.sequence for m in mine] == [0, 1, 2, 3]
        assert [m.publish_time for m in mine] == [START_NS + k * PERIOD_NS for k in range(4)]
    assert summary is not None
    assert {channel.topic for channel in summary.channels.values()} == TOPICS
    assert {schema.encoding for schema in summary.schemas.values()} == {"protobuf"}
    assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}


def test_the_data_section_has_a_checksum(written: Path) -> None:
    """Without one a flipped bit outside the chunks would go unnoticed; with one mcap refuses the file."""
    with written.open("rb") as stream:
        ends = [record for record in StreamReader(stream, validate_crcs=True).records if isinstance(record, DataEnd)]
    assert [end.data_section_crc != 0 for end in ends] == [True]


def test_a_flipped_bit_is_seen_by_our_reader(written: Path, tmp_path: Path) -> None:
    """In the name of a class, outside the chunks: the checksum over everything tells."""
    data = bytearray(written.read_bytes())
    data[data.index(b"Floor lamp")] ^= 32
    (tmp_path / "flipped.mcap").write_bytes(data)
    with open_log([tmp_path / "flipped.mcap"]) as log:
        assert str(log.info.damage) == "data_crc 1"


def test_the_class_table_is_there_twice(written: Path) -> None:
    """As metadata, id to name, and as an attachment with colours for other programs."""
    with written.open("rb") as stream:
        reader = make_reader(stream)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attached = {a.name: json.loads(a.data) for a in reader.iter_attachments()}
    assert metadata == {"stsem.classes": {"0": "wall", "1": "Floor lamp", "2": "PC"}}
    assert attached == {
        "classes.json": {"names": list(CLASSES.names), "colours": [list(c) for c in CLASSES.colours], "ignore_id": 255}
    }


def test_colour_is_jpeg_and_images_are_raw(written: Path) -> None:
    """The payload says so: other tools decode colour, and depth needs no decoder."""
    with written.open("rb") as stream:
        payloads = {channel.topic: m.data for _, channel, m in make_reader(stream).iter_messages()}
    jpeg = payloads["/camera/color"]
    start = jpeg.index(b"\xff\xd8\xff")
    image = cv2.imdecode(np.frombuffer(jpeg[start:], np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape == (30, 40, 3)
    assert depth_mm(3).tobytes() in payloads["/camera/depth"]
    assert truth(3).tobytes() in payloads["/gt/labels"]


def test_equal_input_gives_equal_bytes(written: Path, tmp_path: Path) -> None:
    """Whatever the file is called; no date and no path in it."""
    assert write(tmp_path / "another name.mcap").read_bytes() == written.read_bytes()


def test_an_exception_leaves_nothing_behind(tmp_path: Path) -> None:
    """An earlier log of that name stays as it was, and no half of one lies beside it."""
    path = tmp_path / "log.mcap"
    path.write_bytes(b"earlier")

    def interrupted() -> None:
        with LogWriter(path, CLASSES) as log:
            log.color(START_NS, START_NS, picture(0))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [p.name for p in tmp_path.iterdir()] == ["log.mcap"]
    assert path.read_bytes() == b"earlier"


def test_a_message_out_of_order_is_an_error_of_the_caller(tmp_path: Path) -> None:
    """Equal log times are fine, an earlier one is not."""
    with LogWriter(tmp_path / "log.mcap", CLASSES) as log:
        log.color(START_NS, START_NS + 5, picture(0))
        log.depth(START_NS, START_NS + 5, depth_mm(0))
        with pytest.raises(ValueError, match=r"/pose at .* came after a message at"):
            log.pose(START_NS, START_NS + 4, pose(0))
    with open_log([tmp_path / "log.mcap"]) as read:
        assert len(read.plans) == 1


@pytest.mark.parametrize("place", ["missing/log.mcap", "folder", "folder/..", "file/log.mcap"])
def test_a_place_that_cannot_be_written_is_a_sentence(tmp_path: Path, place: str) -> None:
    """No folder, a folder in its place, or a file where a folder should be: told before anything is written."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"^The log .* cannot be written: .*; .*\.$"):
        LogWriter(tmp_path / place, CLASSES)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_a_sentence_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Found out only when the last bytes are flushed."""
    original = Path.open

    def full(path: Path, mode: str) -> IO[Any]:
        original(path, mode).close()
        return original(Path("/dev/full"), mode)

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(OutputError, match="No space left on device; choose another place"):
        write(tmp_path / "log.mcap")
    assert list(tmp_path.iterdir()) == []


def test_an_empty_log_is_a_log(tmp_path: Path) -> None:
    """Nothing written is not an error of the writer; mcap finds the end."""
    write(tmp_path / "log.mcap", frames=0)
    data = (tmp_path / "log.mcap").read_bytes()
    assert data[:8] == data[-8:] == struct.pack("<8B", 0x89, *b"MCAP0\r\n")
    with (tmp_path / "log.mcap").open("rb") as stream:
        assert list(make_reader(stream, validate_crcs=True).iter_messages()) == []
