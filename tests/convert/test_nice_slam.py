"""Replica as NICE-SLAM rendered it: poses as they stand, depth in units of the camera file."""

from pathlib import Path

import numpy as np
import pytest
from made_up_images import HEIGHT, WIDTH, convert, encoded, pose, rgb, write
from mcap.reader import make_reader

from stsem.convert import nice_slam
from stsem.convert.recording import Options, even_stamp_ns
from stsem.errors import ConversionError

CAMERA = {"camera": {"w": WIDTH, "h": HEIGHT, "fx": 20.0, "fy": 21.0, "cx": 15.5, "cy": 11.5, "scale": 6553.5}}


def scene(root: Path, frames: int = 3) -> Path:
    for k in range(frames):
        write(root / f"results/frame{k:06d}.jpg", encoded(rgb(k), ".jpg"))
        write(root / f"results/depth{k:06d}.png", np.full((HEIGHT, WIDTH), 10_000 + k, np.uint16))
    lines = (" ".join(f"{x:.18e}" for x in pose(k).ravel()) for k in range(frames))
    write(root / "traj.txt", "\n".join(lines))
    write(root / "cam_params.json", CAMERA)
    return root


def payloads(log: Path, topic: str) -> list[bytes]:
    with log.open("rb") as stream:
        return [message.data for _, _, message in make_reader(stream).iter_messages(topics=[topic])]


def test_a_scene_reads_back_as_it_is(tmp_path: Path) -> None:
    """Colour bytes untouched, depth of 6553.5 units a metre, poses without a turn."""
    root = scene(tmp_path / "room0")
    assert nice_slam.detect(root)
    converted = convert(nice_slam.read, root, tmp_path / "log.mcap")
    assert not converted.summary.losses
    jpegs = [data[data.index(b"\xff\xd8") :] for data in payloads(tmp_path / "log.mcap", "/camera/color")]
    for k, jpeg in enumerate(jpegs):
        assert jpeg.startswith((root / f"results/frame{k:06d}.jpg").read_bytes())
    assert len(jpegs) == 3
    with converted.log as log:
        assert log.camera is not None
        assert (log.camera.fx, log.camera.cy) == (20.0, 11.5)
        for k, plan in enumerate(log.plans):
            assert plan.stamp_ns == even_stamp_ns(k, 30)
            frame = log.frame(k, depth=True, previous=False)
            np.testing.assert_array_equal(frame.depth, np.full((HEIGHT, WIDTH), np.float32((10_000 + k) / 6553.5)))
            np.testing.assert_allclose(frame.T_WC, pose(k), atol=1e-9)


def test_rate_and_scale_may_be_stated(tmp_path: Path) -> None:
    converted = convert(
        nice_slam.read, scene(tmp_path / "room0"), tmp_path / "log.mcap", Options(rate_hz=7, depth_scale=2000)
    )
    with converted.log as log:
        assert [plan.stamp_ns for plan in log.plans] == [even_stamp_ns(k, 7) for k in range(3)]
        depth = log.frame(0, depth=True, previous=False).depth
        assert depth is not None
        assert depth[0, 0] == np.float32(5.0)


def test_poses_that_are_none_are_counted(tmp_path: Path) -> None:
    """Not finite, no rotation, too few numbers: the image stays, without a pose."""
    root = scene(tmp_path / "room0", frames=4)
    good = (root / "traj.txt").read_text().splitlines()
    write(root / "traj.txt", "\n".join([good[0], good[1].replace(good[1].split()[3], "-inf"), "1 2 3", "9 " * 16]))
    converted = convert(nice_slam.read, root, tmp_path / "log.mcap")
    with converted.log as log:
        assert [log.frame(k, depth=False, previous=False).T_WC is None for k in range(4)] == [False, True, True, True]
    assert converted.summary.losses == {"lines of traj.txt that are not a 4x4 pose": 3}


@pytest.mark.parametrize("text", ["", "[]", "7", '{"camera": {"w": 0}}', '{"fx": "a"}', "[" * 5000])
def test_a_camera_file_that_is_none_is_a_sentence(tmp_path: Path, text: str) -> None:
    root = scene(tmp_path / "room0")
    write(root / "cam_params.json", text)
    with pytest.raises(ConversionError, match=r"cam_params\.json is not a camera .* it should look like"):
        nice_slam.read(root, Options())
