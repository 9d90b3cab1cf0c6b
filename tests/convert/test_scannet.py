"""ScanNet's `.sens` files to logs."""

import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from made_up_images import contents, convert, detected, encoded, pose, rgb, write
from made_up_sens import COLOR_SIZE, DEPTH_SIZE, Scan, depth_units, shots

from stsem.convert.nyu40 import CLASSES, NYU40_IDS
from stsem.convert.recording import (
    ColorEvent,
    DepthEvent,
    Event,
    Options,
    PoseEvent,
    Recording,
    TruthEvent,
    even_stamp_ns,
)
from stsem.convert.scannet import TABLE, detect, read
from stsem.errors import ConversionError

RAW_IDS = np.array([0, 1, 2, 1163, 1357])
TABLE_TEXT = "id\traw_category\tnyu40id\tnyu40class\n1\twall\t1\twall\n2\tchair\t5\tchair\n1163\tobject\t40\tother\n"


def metres(k: int) -> npt.NDArray[np.float32]:
    depth = (depth_units(k) / 1000).astype(np.float32)
    depth[depth_units(k) == 0] = np.nan
    return depth


def read_all(path: Path, options: Options | None = None) -> tuple[Recording, list[Event]]:
    recording = read(path, options or Options())
    return recording, list(recording.events)


def of_kind(events: list[Event], kind: type) -> list:
    return [e for e in events if isinstance(e, kind)]


def raw_labels(k: int) -> npt.NDArray[np.uint16]:
    v, u = np.mgrid[: COLOR_SIZE[1], : COLOR_SIZE[0]]
    return RAW_IDS[(u + v + k) % len(RAW_IDS)].astype(np.uint16)


def labels(k: int) -> npt.NDArray[np.uint8]:
    """0 is unannotated, 1163 no evaluated class, 1357 not in the table."""
    known = {1: CLASSES.names.index("wall"), 2: CLASSES.names.index("chair")}
    return np.vectorize(lambda raw: known.get(raw, 255))(raw_labels(k)).astype(np.uint8)


def test_the_log_says_what_the_scan_says(tmp_path: Path) -> None:
    source = Scan().write(tmp_path / "scan" / "scene0000_00.sens")
    before = contents(source.parent)
    assert detected(source) == ["scannet"]
    converted = convert(read, source, tmp_path / "log.mcap")
    log = converted.log
    assert [plan.stamp_ns for plan in log.plans] == [s.color_us * 1000 for s in shots()]
    assert log.camera is not None
    assert (log.camera.fx, log.camera.fy, log.camera.cx, log.camera.cy) == (36, 37, 19.5, 14.5)
    for k in range(4):
        frame = log.frame(k, depth=False, previous=False)
        np.testing.assert_array_equal(frame.image, rgb(k, *COLOR_SIZE))
        assert frame.T_WC is not None
        np.testing.assert_allclose(frame.T_WC, pose(k), atol=1e-6)
    assert not converted.summary.losses
    assert contents(source.parent) == before


def test_depth_is_of_another_camera(tmp_path: Path) -> None:
    """Its stamps, intrinsics and extrinsics are the file's own, and its metres exact."""
    T_color_depth = pose(3)
    scan = Scan(matrices=[*Scan().matrices[:3], T_color_depth])
    recording, events = read_all(scan.write(tmp_path / "a.sens"))
    assert recording.depth_camera is not None
    assert (recording.depth_camera.width, recording.depth_camera.fx, recording.depth_camera.cy) == (32, 28, 11.5)
    np.testing.assert_allclose(recording.T_color_depth, T_color_depth, atol=1e-6)
    depth = of_kind(events, DepthEvent)
    assert [e.stamp_ns for e in depth] == [s.depth_us * 1000 for s in shots()]
    for k, event in enumerate(depth):
        np.testing.assert_array_equal(event.depth, metres(k))
    # The poses of the file are those of the depth camera.
    for k, event in enumerate(of_kind(events, PoseEvent)):
        np.testing.assert_allclose(event.T_WC, pose(k) @ np.linalg.inv(T_color_depth), atol=1e-5)


def test_the_log_registers_the_depth_camera(tmp_path: Path) -> None:
    """A wall across the view is as far in the colour camera as in the depth camera behind it says."""
    wall = zlib.compress(np.full(DEPTH_SIZE[::-1], 2000, np.uint16).tobytes())
    T_color_depth = np.eye(4)
    T_color_depth[2, 3] = -0.25
    frames = [replace(s, depth=wall) for s in shots()]
    scan = Scan(frames, matrices=[*Scan().matrices[:3], T_color_depth])
    log = convert(read, scan.write(tmp_path / "a.sens"), tmp_path / "log.mcap").log
    depth = log.frame(1, depth=True, previous=False).depth
    assert depth is not None
    assert depth.shape == COLOR_SIZE[::-1]
    known = np.isfinite(depth)
    assert known.mean() > 0.5
    np.testing.assert_allclose(depth[known], 1.75, atol=1e-6)


def test_depth_of_the_same_pixels_needs_no_camera_of_its_own(tmp_path: Path) -> None:
    K, eye = Scan().matrices[2], np.eye(4)
    frames = [replace(s, color=encoded(rgb(k, *DEPTH_SIZE))) for k, s in enumerate(shots())]
    scan = Scan(frames, matrices=[K, eye, K, eye], sizes=(*DEPTH_SIZE, *DEPTH_SIZE))
    log = convert(read, scan.write(tmp_path / "a.sens"), tmp_path / "log.mcap").log
    for k in range(4):
        np.testing.assert_array_equal(log.frame(k, depth=True, previous=False).depth, metres(k))


def test_events_are_in_order_and_as_many_as_said(tmp_path: Path) -> None:
    recording, events = read_all(Scan().write(tmp_path / "a.sens"))
    stamps = [e.stamp_ns for e in events]
    assert stamps == sorted(stamps)
    assert len(events) == recording.count == 12


@pytest.mark.parametrize("stamps", [(0, 0, 0, 0), (5, 4, 3, 2), (7, 7, 7, 7), (1, 2, 3, 1 << 63)])
def test_without_ascending_stamps_frames_are_even(tmp_path: Path, stamps: tuple[int, ...]) -> None:
    frames = [replace(s, color_us=t, depth_us=t) for s, t in zip(shots(), stamps, strict=True)]
    path = Scan(frames).write(tmp_path / "a.sens")
    recording, events = read_all(path)
    assert [e.stamp_ns for e in of_kind(events, ColorEvent)] == [even_stamp_ns(k, 30) for k in range(4)]
    assert [e.stamp_ns for e in of_kind(events, DepthEvent)] == [even_stamp_ns(k, 30) for k in range(4)]
    assert any("30 a second" in note for note in recording.notes)
    _, slower = read_all(path, Options(rate_hz=10))
    assert of_kind(slower, ColorEvent)[3].stamp_ns == even_stamp_ns(3, 10)


def test_a_depth_clock_of_its_own_is_not_used(tmp_path: Path) -> None:
    frames = [replace(s, depth_us=s.depth_us + 10**9) for s in shots()]
    recording, events = read_all(Scan(frames).write(tmp_path / "a.sens"))
    assert [e.stamp_ns for e in of_kind(events, DepthEvent)] == [s.color_us * 1000 for s in shots()]
    assert any("colour's clock" in note for note in recording.notes)


def test_lost_poses_are_left_out_and_counted(tmp_path: Path) -> None:
    frames = shots()
    frames[1] = replace(frames[1], camera_to_world=np.full((4, 4), -np.inf))
    frames[2] = replace(frames[2], camera_to_world=np.zeros((4, 4)))
    recording, events = read_all(Scan(frames).write(tmp_path / "a.sens"))
    assert [e.stamp_ns for e in of_kind(events, PoseEvent)] == [frames[k].color_us * 1000 for k in (0, 3)]
    assert "2 of 4 frames have no pose: the reconstruction lost them." in recording.notes


@pytest.mark.parametrize("compression", [(0, 0), (1, 0), (-1, 1)])
def test_every_compression(tmp_path: Path, compression: tuple[int, int]) -> None:
    color, depth = compression
    frames = [
        replace(
            s,
            color=rgb(k, *COLOR_SIZE).tobytes() if color == 0 else s.color,
            depth=depth_units(k).tobytes() if depth == 0 else s.depth,
        )
        for k, s in enumerate(shots())
    ]
    path = Scan(frames, compression=compression).write(tmp_path / "a.sens")
    _, events = read_all(path)
    np.testing.assert_array_equal(of_kind(events, DepthEvent)[2].depth, metres(2))
    image = of_kind(events, ColorEvent)[2].image
    if color == 0:
        np.testing.assert_array_equal(image, rgb(2, *COLOR_SIZE))
    else:
        assert image == frames[2].color


@pytest.mark.parametrize("compression", [2, -1, 77])
def test_depth_that_cannot_be_read_is_left_out(tmp_path: Path, compression: int) -> None:
    recording, events = read_all(Scan(compression=(2, compression)).write(tmp_path / "a.sens"))
    assert {type(e) for e in events} == {ColorEvent, PoseEvent}
    assert recording.count == len(events)
    assert recording.depth_camera is None
    assert any("left out" in note for note in recording.notes)


def test_the_unit_of_depth_can_be_stated(tmp_path: Path) -> None:
    path = Scan(depth_shift=0).write(tmp_path / "a.sens")
    recording, events = read_all(path)
    assert not of_kind(events, DepthEvent)
    assert any("--depth-scale" in note for note in recording.notes)
    _, events = read_all(path, Options(depth_scale=1000))
    np.testing.assert_array_equal(of_kind(events, DepthEvent)[0].depth, metres(0))


def test_labels_become_the_20_classes(tmp_path: Path) -> None:
    folder = tmp_path / "scene0000_00"
    Scan().write(folder / "scene0000_00.sens")
    for k in (0, 2, 9):
        write(folder / f"label-filt/{k}.png", raw_labels(k))
    write(folder / TABLE, TABLE_TEXT)
    converted = convert(read, folder, tmp_path / "log.mcap")
    log = converted.log
    assert log.classes is not None
    assert log.classes.names == CLASSES.names
    assert [k for k in range(4) if log.truth(k) is not None] == [0, 2]
    for k in (0, 2):
        np.testing.assert_array_equal(log.truth(k), labels(k))
    assert "1 label images belong to no frame: left out." in converted.summary.notes


def test_labels_without_their_table_are_left_out(tmp_path: Path) -> None:
    Scan().write(tmp_path / "a.sens")
    write(tmp_path / "label-filt/0.png", raw_labels(0))
    recording, events = read_all(tmp_path)
    assert recording.classes is None
    assert not of_kind(events, TruthEvent)
    assert any(TABLE in note for note in recording.notes)
    own = write(tmp_path / "own.json", {"1": "wall", "1163": "object"})
    recording, events = read_all(tmp_path, Options(classes_file=own))
    (truth,) = of_kind(events, TruthEvent)
    np.testing.assert_array_equal(truth.labels == 1, raw_labels(0) == 1163)


@pytest.mark.parametrize(
    "text", ["", "id\tname\n1\twall\n", "id\tnyu40id\nx\ty\n", "id\tnyu40id\n" + "1" * 5000 + "\t1"]
)
def test_a_broken_table_is_named(tmp_path: Path, text: str) -> None:
    Scan().write(tmp_path / "a.sens")
    write(tmp_path / "label-filt/0.png", raw_labels(0))
    write(tmp_path / TABLE, text)
    with pytest.raises(ConversionError, match=TABLE):
        read(tmp_path, Options())


def test_the_tables_fit() -> None:
    assert len(NYU40_IDS) == len(CLASSES) == len(CLASSES.colours) == 20
    assert sorted(NYU40_IDS) == list(NYU40_IDS)


def test_several_scans_need_a_choice(tmp_path: Path) -> None:
    for name in ("scene0000_00", "scene0000_01"):
        Scan().write(tmp_path / name / f"{name}.sens")
    with pytest.raises(ConversionError, match=r"2 sequences \(scene0000_00, scene0000_01\)"):
        read(tmp_path, Options())
    assert read(tmp_path, Options(sequence="scene0000_01")).count == 12


def test_no_scan(tmp_path: Path) -> None:
    assert not detect(tmp_path)
    assert not detect(tmp_path / "missing.sens")
    with pytest.raises(ConversionError, match=r"no \.sens file"):
        read(tmp_path, Options())
