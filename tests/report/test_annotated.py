"""annotated.mcap is what viewers open: typed channels, capture stamps, the classes' colours."""

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from stsem.chance import generator
from stsem.classes import NO_LABEL, ClassSet
from stsem.errors import OutputError
from stsem.frame import Frame
from stsem.report.annotated import AnnotatedLog
from stsem.result import FrameResult, Outcome

CLASSES = ClassSet(("wall", "door"), ((10, 20, 30), (200, 100, 50)))
STAMP_NS = 1_700_000_000_123_456_789


def test_channels_times_and_colours(tmp_path: Path) -> None:
    """An answer, a pose and a map, read back with the public reader, checksums checked."""
    labels = np.array([[0, 1], [1, NO_LABEL]], np.uint8)
    image, pose = np.full((2, 2, 3), 90, np.uint8), np.eye(4)
    pose[:3, 3] = 1, 2, 3
    result = FrameResult(7, 0, 10_000_000, 10_000_000, 52_500_000, Outcome.SEGMENTED, 7, "first", 0.75, labels=labels)
    with AnnotatedLog(tmp_path / "a.mcap", CLASSES) as annotated:
        annotated.answer("keyframe", result, Frame(7, STAMP_NS, image, T_WC=pose))
        annotated.map(STAMP_NS, np.array([[1.0, 2.0, 3.0]]), np.array([1], np.uint8))
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        (legend,) = reader.iter_metadata()
        raw = {channel.topic: (schema, message) for schema, channel, message in reader.iter_messages()}
        decoded = {c.topic: m for _, c, _, m in reader.iter_decoded_messages(
            [topic for topic in raw if topic != "/stsem/keyframe/answer"])}  # fmt: skip
    assert set(raw) == {
        "/stsem/keyframe/overlay", "/stsem/keyframe/labels", "/stsem/keyframe/answer", "/stsem/pose", "/stsem/map",
    }  # fmt: skip
    assert {message.log_time for _, message in raw.values()} == {STAMP_NS}
    shown = np.frombuffer(decoded["/stsem/keyframe/labels"].data, np.uint8).reshape(2, 2, 3)
    np.testing.assert_array_equal(shown, [[[10, 20, 30], [200, 100, 50]], [[200, 100, 50], [0, 0, 0]]])
    assert json.loads(raw["/stsem/keyframe/answer"][1].data) == {
        "frame": 7, "outcome": "segmented", "keyframe": 7, "reason": "first", "remark": "", "latency_ms": 42.5,
        "coverage": 0.75,
    }  # fmt: skip
    assert (legend.name, legend.metadata) == ("stsem.classes", {"wall": "#0a141e 0", "door": "#c86432 1"})
    assert decoded["/stsem/pose"].translation.z == 3
    assert decoded["/stsem/map"].point_stride == 17
    assert len(decoded["/stsem/map"].data) == 17
    assert decoded["/stsem/keyframe/overlay"].format == "jpeg"


def test_an_error_leaves_no_file(tmp_path: Path) -> None:
    """Half an annotated log is none; closing twice is closing."""
    path = tmp_path / "a.mcap"
    with pytest.raises(IndexError), AnnotatedLog(path, CLASSES) as annotated:
        annotated.map(STAMP_NS, np.zeros((1, 3)), np.array([300]))  # labels end at 255
    assert list(tmp_path.iterdir()) == []
    with AnnotatedLog(path, CLASSES) as annotated:
        annotated.close()
    assert path.stat().st_size > 0


def test_a_place_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"annotated log .* cannot be written \(No such file or directory\)"):
        AnnotatedLog(tmp_path / "missing" / "a.mcap", CLASSES)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a disk that is always full")
def test_a_full_disk_is_one_sentence(tmp_path: Path) -> None:
    """Whatever fails while writing, the stream's own error does not come through and nothing is left."""
    path = tmp_path / "a.mcap"
    path.symlink_to("/dev/full")
    points = generator(0, "points").random((200_000, 3))
    with pytest.raises(OutputError, match="No space left"), AnnotatedLog(path, CLASSES) as annotated:
        annotated.map(STAMP_NS, points, np.zeros(len(points), np.uint8))
    assert list(tmp_path.iterdir()) == []
