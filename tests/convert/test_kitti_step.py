"""KITTI-STEP folders to logs."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from made_up_images import HEIGHT, WIDTH, contents, convert, detected, encoded, pose, rgb, write

from stsem.convert.kitti_step import CLASSES, detect, read
from stsem.convert.recording import ColorEvent, Loss, Options, PoseEvent, TruthEvent, even_stamp_ns
from stsem.errors import ConversionError

FX, FY, CX, CY = 20.0, 21.0, 15.5, 11.5
SHIFT = (0.06, -0.001, 0.002)


def panoptic(k: int) -> npt.NDArray[np.uint8]:
    """(H, W, 3): class in red, instance in green and blue, a stripe of void."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    classes = (u + v + k) % 19
    classes[5] = 255
    return np.stack([classes, (u // 256), u + k], axis=2).astype(np.uint8)


def calib() -> str:
    K = np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1]])
    P = np.hstack([K, (K @ SHIFT)[:, None]])
    return "P0: " + "1 0 0 0 0 1 0 0 0 0 1 0\n" + "P2: " + " ".join(f"{v:.12e}" for v in P.ravel()) + "\nR_rect 1 0 0\n"


def street(root: Path, sequences: tuple[str, ...] = ("0002",), frames: int = 12) -> Path:
    """A data set as it is unpacked: images under `training`, maps under `train`."""
    for name in sequences:
        for k in range(frames):
            write(root / f"training/image_02/{name}/{k:06}.png", rgb(k))
            write(root / f"panoptic_maps/train/{name}/{k:06}.png", panoptic(k))
        write(root / f"training/calib/{name}.txt", calib())
        rows = "\n".join(" ".join(f"{v:.12e}" for v in pose(k)[:3].ravel()) for k in range(frames))
        write(root / f"training/poses/{name}.txt", rows + "\n")
    return root


def T_WC(k: int) -> npt.NDArray[np.float64]:
    """Pose of camera 2, from that of camera 0: x_2 = x_0 + SHIFT."""
    T_20 = np.eye(4)
    T_20[:3, 3] = SHIFT
    return pose(k) @ np.linalg.inv(T_20)


def test_everything_comes_through_exactly(tmp_path: Path) -> None:
    source = street(tmp_path / "kitti")
    before = contents(source)
    assert detected(source) == ["kitti-step"]
    converted = convert(read, source, tmp_path / "log.mcap")
    log = converted.log
    assert [plan.stamp_ns for plan in log.plans] == [even_stamp_ns(k, 10) for k in range(12)]
    assert log.classes is not None
    assert log.classes.names == CLASSES.names
    assert log.camera is not None
    assert (log.camera.fx, log.camera.fy, log.camera.cx, log.camera.cy) == (FX, FY, CX, CY)
    for k in range(12):
        frame = log.frame(k, depth=False, previous=False)
        np.testing.assert_array_equal(frame.image, rgb(k))
        np.testing.assert_array_equal(log.truth(k), panoptic(k)[:, :, 0])
        assert frame.T_WC is not None
        np.testing.assert_allclose(frame.T_WC, T_WC(k), atol=1e-9)
    assert not converted.summary.losses
    assert contents(source) == before


def test_the_bytes_of_the_images_are_untouched(tmp_path: Path) -> None:
    source = street(tmp_path, frames=2)
    colors = [e.image for e in read(source, Options()).events if isinstance(e, ColorEvent)]
    assert colors == [encoded(rgb(0)), encoded(rgb(1))]


def test_events_are_in_order_and_as_many_as_said(tmp_path: Path) -> None:
    recording = read(street(tmp_path, frames=11), Options(rate_hz=5))
    events = list(recording.events)
    stamps = [e.stamp_ns for e in events]
    assert stamps == sorted(stamps)
    assert len(events) == recording.count == 33
    assert stamps[-1] == even_stamp_ns(10, 5)


def test_without_calib_poses_and_maps(tmp_path: Path) -> None:
    """What is not there is said, and the rest is converted."""
    for k in (0, 2):
        write(tmp_path / f"image_02/0000/{k:06}.png", rgb(k))
    write(tmp_path / "panoptic_maps/val/0000/000002.png", panoptic(2))
    write(tmp_path / "panoptic_maps/val/0000/000003.png", panoptic(3))
    recording = read(tmp_path, Options())
    events = list(recording.events)
    assert [type(e) for e in events] == [ColorEvent, ColorEvent, TruthEvent]
    assert recording.camera is None
    assert recording.notes == [
        "There is no calib/0000.txt: the log has no intrinsics.",
        "1 label images belong to no colour image: left out.",
        "1 of 2 images have no label image.",
    ]


def test_poses_without_calib_are_said_to_be_those_of_camera_0(tmp_path: Path) -> None:
    source = street(tmp_path)
    (source / "training/calib/0002.txt").unlink()
    recording = read(source, Options())
    poses = [e.T_WC for e in recording.events if isinstance(e, PoseEvent)]
    np.testing.assert_allclose(poses[3], pose(3), atol=1e-9)
    assert any("camera 0" in note for note in recording.notes)


def test_a_pose_that_is_none_is_left_out(tmp_path: Path) -> None:
    source = street(tmp_path, frames=3)
    path = source / "training/poses/0002.txt"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([rows[0], " ".join(["0"] * 12), rows[2]]))
    recording = read(source, Options())
    assert sum(isinstance(e, PoseEvent) for e in recording.events) == 2
    assert "1 of 3 images have no pose." in recording.notes


def test_several_sequences_need_a_choice(tmp_path: Path) -> None:
    source = street(tmp_path, ("0002", "0010"), frames=2)
    with pytest.raises(ConversionError, match=r"holds 2 sequences \(0002, 0010\).*--sequence NAME"):
        read(source, Options())
    with pytest.raises(ConversionError, match=r"no sequence '0011' \(did you mean 0010\?\)"):
        read(source, Options(sequence="0011"))
    assert read(source, Options(sequence="0010")).count == 6


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("calib", "P0: 1 2 3\n"),
        ("calib", "P2: 1 2 3\n"),
        ("calib", "P2: 0 0 0 0 0 0 0 0 0 0 0 0\n"),
        ("calib", "P2: nan 0 0 0 0 1 0 0 0 0 1 0\n"),
        ("calib", b"\xff\xfe\x00"),
        ("poses", "1 2 3\n"),
        ("poses", "one two\n"),
    ],
)
def test_broken_text_files_are_named(tmp_path: Path, name: str, content: str | bytes) -> None:
    source = street(tmp_path, frames=1)
    write(source / f"training/{name}/0002.txt", content)
    with pytest.raises(ConversionError, match=rf"{name}.0002\.txt .*(mend|remove)"):
        read(source, Options())


def test_broken_images_are_counted(tmp_path: Path) -> None:
    source = street(tmp_path, frames=3)
    write(source / "panoptic_maps/train/0002/000001.png", encoded(panoptic(1))[:-20])
    write(source / "panoptic_maps/train/0002/000002.png", panoptic(2)[:, :, 0].copy())
    write(source / "training/image_02/0002/000000.png", b"no image")
    recording = read(source, Options())
    losses = [e.what for e in recording.events if isinstance(e, Loss)]
    assert losses == ["colour images that cannot be read"] + ["label images that cannot be read"] * 2
    assert any("000001.png" in note for note in recording.notes)


def test_a_link_out_of_the_source_is_not_followed(tmp_path: Path) -> None:
    source = street(tmp_path / "kitti", frames=2)
    outside = write(tmp_path / "outside.png", rgb(0))
    target = source / "training/image_02/0002/000001.png"
    target.unlink()
    target.symlink_to(outside)
    losses = [e for e in read(source, Options()).events if isinstance(e, Loss)]
    assert len(losses) == 1


def test_another_folder_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "pictures/1.png", rgb(0))
    assert not detect(tmp_path)
    assert not detect(tmp_path / "missing")
    with pytest.raises(ConversionError, match="image_02"):
        read(tmp_path, Options())
