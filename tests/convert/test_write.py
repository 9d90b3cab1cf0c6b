"""From events to a log: what is written, what is refused, and what is left behind when it goes wrong."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_images import HEIGHT, WIDTH, encoded, pose, rgb
from mcap.reader import make_reader

from stsem.camera import Camera
from stsem.classes import ClassSet
from stsem.convert.lists import stamp_ns
from stsem.convert.recording import (
    ColorEvent,
    DepthEvent,
    Event,
    Loss,
    PoseEvent,
    Recording,
    Summary,
    TruthEvent,
    even_stamp_ns,
)
from stsem.convert.write import write_recording
from stsem.errors import ConversionError
from stsem.log.encode import whole_millimetres
from stsem.log.log import open_log
from stsem.log.pixels.metres import in_metres

NS = 10**9


def written(path: Path, *events: Event, **given: object) -> Summary:
    recording = Recording(iter(events), len(events), **given)  # type: ignore[arg-type]
    return write_recording(recording, path, lambda done, total: None)


@pytest.mark.parametrize(
    ("image", "form"),
    [(encoded(rgb(1)), "png"), (encoded(rgb(1), ".jpg"), "jpeg"), (encoded(rgb(1), ".webp"), "webp"), (rgb(1), "png")],
    ids=["png", "jpeg", "webp", "pixels"],
)
def test_colour_is_passed_on_or_kept_without_loss(tmp_path: Path, image: bytes | np.ndarray, form: str) -> None:  # type: ignore[type-arg]
    """The bytes of the file stand in the message; pixels come back equal."""
    written(tmp_path / "log.mcap", ColorEvent(NS, image))
    with (tmp_path / "log.mcap").open("rb") as stream:
        (payload,) = (message.data for _, _, message in make_reader(stream).iter_messages())
    assert form.encode() in payload
    assert not isinstance(image, bytes) or image in payload
    with open_log([tmp_path / "log.mcap"]) as log:
        if not isinstance(image, bytes):
            np.testing.assert_array_equal(log.frame(0, depth=False, previous=False).image, image)


def test_only_channels_with_messages_are_there(tmp_path: Path) -> None:
    """And no class table without truth."""
    summary = written(tmp_path / "log.mcap", ColorEvent(NS, encoded(rgb(0))))
    assert summary.messages == {"/camera/color": 1}
    with (tmp_path / "log.mcap").open("rb") as stream:
        reader = make_reader(stream)
        found = reader.get_summary()
        assert found is not None
        assert {channel.topic for channel in found.channels.values()} == {"/camera/color"}
        assert list(reader.iter_metadata()) == []
        assert list(reader.iter_attachments()) == []


def test_a_depth_camera_of_its_own_is_described(tmp_path: Path) -> None:
    """Its calibration, and where it stands: the reader brings depth to the colour camera by them."""
    color, depth_camera = Camera(WIDTH, HEIGHT, 20, 20, 15.5, 11.5), Camera(16, 12, 10, 10, 7.5, 5.5)
    T_color_depth = np.eye(4)
    T_color_depth[0, 3] = 0.05
    summary = written(
        tmp_path / "log.mcap", ColorEvent(NS, encoded(rgb(0))), DepthEvent(NS, np.full((12, 16), 2, np.float32)),
        camera=color, depth_camera=depth_camera, T_color_depth=T_color_depth,
    )  # fmt: skip
    described = {"/camera/calibration", "/camera/depth/calibration", "/tf_static"}
    assert summary.messages == dict.fromkeys(described | {"/camera/color", "/camera/depth"}, 1)
    with open_log([tmp_path / "log.mcap"]) as log:
        assert log.camera is not None
        assert log.camera.fx == 20
        depth = log.frame(0, depth=True, previous=False).depth
        assert depth is not None
        assert depth.shape == (HEIGHT, WIDTH)
        assert set(np.unique(depth[np.isfinite(depth)])) == {np.float32(2)}


def test_faults_are_counted_and_the_rest_is_written(tmp_path: Path) -> None:
    """Each kind once; stamps outside of what a message can say; a stamp that goes back."""
    bad = pose(1).copy()
    bad[0, 3] = -np.inf
    summary = written(
        tmp_path / "log.mcap",
        Loss("frames that the sensor lost", count=3), PoseEvent(-1, pose(0)), PoseEvent(1 << 63, pose(0)),
        ColorEvent(NS, encoded(rgb(0))), ColorEvent(2 * NS, b"\xff\xd8\xff rubbish"), PoseEvent(2 * NS, bad),
        ColorEvent(2 * NS, encoded(rgb(0, 8, 8))), TruthEvent(3 * NS, np.zeros((4, 4), np.uint8)),
        ColorEvent(2 * NS, encoded(rgb(1))), ColorEvent(3 * NS, encoded(rgb(1))),
        classes=ClassSet(("wall",)),
    )  # fmt: skip
    assert summary.messages == {"/camera/color": 2, "/gt/labels": 1}
    assert summary.losses == {
        "frames that the sensor lost": 3,
        "poses with a stamp before 1970 or after 2106": 2,
        "colour images that cannot be decoded": 1,
        "poses that are none (not finite, or not a rotation)": 1,
        "colour images of another size than the first": 1,
        "colour images whose stamp is behind the one before": 1,
    }


def test_no_colour_is_a_sentence_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ConversionError, match=r"^No colour image could be read \(1 colour images that cannot be dec"):
        written(tmp_path / "log.mcap", ColorEvent(NS, b"rubbish"), PoseEvent(NS, pose(0)))
    assert list(tmp_path.iterdir()) == []


def test_events_are_asked_for_one_by_one(tmp_path: Path) -> None:
    """Whatever the length of the data set: when an event is asked for, the ones before are done with."""
    steps: list[tuple[int, int]] = []

    def events() -> Iterator[Event]:
        for k in range(5):
            assert len(steps) == k
            yield ColorEvent(k * NS, encoded(rgb(k)))

    write_recording(Recording(events(), 5), tmp_path / "log.mcap", lambda done, total: steps.append((done, total)))
    assert steps == [(k, 5) for k in range(1, 6)]


@settings(max_examples=60)
@given(st.lists(st.integers(0, 65535), min_size=1, max_size=8), st.sampled_from([1000, 5000, 6553.5]))
def test_millimetres_are_used_only_when_nothing_is_lost(samples: list[int], scale: float) -> None:
    """Whole millimetres come back equal, bit by bit; anything else is refused."""
    depth = (np.array([samples], np.uint16) / scale).astype(np.float32)
    depth[depth == 0] = np.nan
    millimetres = whole_millimetres(depth)
    if millimetres is not None:
        np.testing.assert_array_equal(in_metres(millimetres), depth)
    elif scale == 1000:
        assert 65535 in samples


@settings(max_examples=60)
@given(st.integers(0, (1 << 32) - 1), st.integers(0, NS - 1))
def test_seconds_are_read_to_the_nanosecond(seconds: int, rest: int) -> None:
    assert stamp_ns(f"{seconds}.{rest:09d}") == seconds * NS + rest


@pytest.mark.parametrize("text", ["nan", "inf", "-1", "1e400", "4294967296", "0x10", "", "1_0.5.2"])
def test_what_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        stamp_ns(text)


def test_even_stamps_do_not_drift() -> None:
    """A day at 29.97 Hz ends where it should; the first stamp is not zero."""
    assert even_stamp_ns(0, 29.97) > 0
    assert even_stamp_ns(2997 * 864, 29.97) - even_stamp_ns(0, 29.97) == pytest.approx(86_400 * NS, abs=1)
