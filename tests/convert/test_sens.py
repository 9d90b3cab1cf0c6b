"""Broken and hostile `.sens` files: read as far as they go, or refused in one sentence."""

import tracemalloc
import zlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_up_images import pose, write
from made_up_sens import Scan, Shot, shots

from stsem.convert.recording import ColorEvent, DepthEvent, Event, Loss, Options, PoseEvent, Recording
from stsem.convert.scannet import read
from stsem.errors import ConversionError


def read_all(path: Path) -> tuple[Recording, list[Event]]:
    recording = read(path, Options())
    return recording, list(recording.events)


def of_kind(events: list[Event], kind: type) -> list:
    return [e for e in events if isinstance(e, kind)]


def test_a_bomb_costs_no_memory(tmp_path: Path) -> None:
    """A zlib stream of far more than its image is refused before it is unpacked."""
    bomb = zlib.compress(b"\0" * (64 << 20), 1)
    frames = shots()
    frames[1] = replace(frames[1], depth=bomb)
    path = Scan(frames).write(tmp_path / "a.sens")
    del bomb, frames
    tracemalloc.start()
    _, events = read_all(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert [e.what for e in of_kind(events, Loss)] == ["depth images that cannot be read"]
    assert peak < 8 << 20


def test_a_cut_file_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    data = Scan(imu=b"").packed()
    path = write(tmp_path / "a.sens", data[: len(data) - len(shots()[3].packed()) - 10])
    recording, events = read_all(path)
    assert len(of_kind(events, ColorEvent)) == 2
    assert [(e.what, e.count) for e in of_kind(events, Loss)] == [
        ("frames after the place where the file is cut off or broken", 2)
    ]
    assert "The file declares 4 frames, but 2 whole ones are in it." in recording.notes


@pytest.mark.parametrize(
    ("scan", "said"),
    [
        (Scan(version=3), "version 3"),
        (Scan(name=b"n" * 5000), "5000 bytes"),
        (Scan(sizes=(1 << 31, 1 << 31, 32, 24)), "colour images are 2147483648x2147483648"),
        (Scan(frames=[]), "no whole frame"),
    ],
)
def test_a_broken_header_is_said(tmp_path: Path, scan: Scan, said: str) -> None:
    with pytest.raises(ConversionError, match=said):
        read(scan.write(tmp_path / "a.sens"), Options())


def test_absurd_numbers_of_frames_and_bytes_cost_nothing(tmp_path: Path) -> None:
    frames = [*shots(2), Shot(b"", b"", pose(0), 0, 0)]
    data = Scan(frames, declared=(1 << 64) - 1, imu=b"").packed()
    recording, events = read_all(write(tmp_path / "a.sens", data[:-16] + b"\xff" * 16))
    assert len(of_kind(events, ColorEvent)) == 2
    assert recording.count == 6


def sound(path: Path) -> None:
    """Reading raises nothing but a ConversionError, and what comes is of its kind."""
    with suppress(ConversionError):
        for event in read(path, Options()).events:
            match event:
                case DepthEvent(depth=depth):
                    assert depth.dtype == np.float32
                    assert not (depth <= 0).any()
                case PoseEvent(T_WC=T_WC):
                    assert np.isfinite(T_WC).all()


SAME_FILE = settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])


@given(st.data())
@SAME_FILE
def test_flipped_and_cut_files_are_read_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    original = Scan().packed()
    kept = bytearray(original[: data.draw(st.integers(0, len(original)))])
    for _ in range(data.draw(st.integers(0, 8))):
        # Half of the flips go to the header, where every byte counts.
        at = data.draw(st.integers(0, 400) | st.integers(0, len(original) - 1))
        if at < len(kept):
            kept[at] = data.draw(st.integers(0, 255))
    sound(write(tmp_path / "a.sens", bytes(kept)))


@given(st.binary(max_size=600))
@settings(SAME_FILE, max_examples=50)
def test_random_bytes_are_refused(tmp_path: Path, junk: bytes) -> None:
    sound(write(tmp_path / "a.sens", junk))
    sound(write(tmp_path / "a.sens", Scan(frames=[], declared=5, imu=b"").packed() + junk))
