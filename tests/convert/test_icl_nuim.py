"""ICL-NUIM: its left-handed world is mirrored, so that depth and poses agree as anywhere else."""

from pathlib import Path

import numpy as np
import pytest
from made_up_images import HEIGHT, WIDTH, convert, pose, rgb, write

from stsem.convert import icl_nuim, tum
from stsem.convert.recording import Options, even_stamp_ns
from stsem.errors import ConversionError
from stsem.pose import to_quaternion


def sequence(root: Path, frames: int = 3, *, associations: bool = True) -> Path:
    lines, poses = "", ""
    for k in range(frames):
        write(root / f"rgb/{k}.png", rgb(k))
        write(root / f"depth/{k}.png", np.full((HEIGHT, WIDTH), 5000 + 5 * k, np.uint16))
        lines += f"{k} depth/{k}.png {k} rgb/{k}.png\n"
        poses += f"{k} {' '.join(f'{x:.17g}' for x in (*pose(k)[:3, 3], *to_quaternion(pose(k))))}\n"
    if associations:
        write(root / "associations.txt", lines)
    write(root / "livingRoom0.gt.freiburg", poses)
    return root


@pytest.mark.parametrize("associations", [True, False])
def test_frames_meet_poses_by_their_number(tmp_path: Path, associations: bool) -> None:
    """30 Hz by number; whole millimetres of depth stay whole; fy is positive."""
    root = sequence(tmp_path / "lr0", associations=associations)
    assert icl_nuim.detect(root)
    assert not tum.detect(root)
    converted = convert(icl_nuim.read, root, tmp_path / "log.mcap")
    assert not converted.summary.losses
    with converted.log as log:
        assert log.camera is not None
        assert log.camera.fx == pytest.approx(481.2 * WIDTH / 640)
        assert log.camera.fy == pytest.approx(480 * HEIGHT / 480)
        for k, plan in enumerate(log.plans):
            assert plan.stamp_ns == even_stamp_ns(k, 30)
            frame = log.frame(k, depth=True, previous=False)
            np.testing.assert_array_equal(frame.image, rgb(k))
            np.testing.assert_array_equal(frame.depth, np.full((HEIGHT, WIDTH), np.float32(1 + k / 1000)))


def test_a_point_of_the_left_handed_world_is_seen_in_the_same_pixel(tmp_path: Path) -> None:
    """Projected by the published camera (fy = -480) and pose, and mirrored by the converted ones."""
    root = sequence(tmp_path / "lr0")
    log = convert(icl_nuim.read, root, tmp_path / "log.mcap").log
    left = np.array([[481.2, 0, 319.5], [0, -480.0, 239.5], [0, 0, 1]])
    right = np.abs(left)
    point = np.array([0.3, 0.4, 2.5, 1.0])
    for k in range(3):
        T_WC = log.frame(k, depth=False, previous=False).T_WC
        assert T_WC is not None
        assert np.linalg.det(T_WC[:3, :3]) == pytest.approx(1)
        published = left @ (np.linalg.inv(pose(k)) @ point)[:3]
        converted = right @ (np.linalg.inv(T_WC) @ np.diag([1, -1, 1, 1]) @ point)[:3]
        np.testing.assert_allclose(converted / converted[2], published / published[2], atol=1e-9)
    log.close()


def test_frames_without_a_pose_are_counted(tmp_path: Path) -> None:
    root = sequence(tmp_path / "lr0", frames=4)
    lines = (root / "livingRoom0.gt.freiburg").read_text().splitlines()
    write(root / "livingRoom0.gt.freiburg", "\n".join([*lines[:2], "2 nan 0 0 0 0 0 1"]))
    converted = convert(icl_nuim.read, root, tmp_path / "log.mcap")
    converted.log.close()
    assert converted.summary.losses == {
        "lines of livingRoom0.gt.freiburg that are not a number and a pose": 1,
        "frames without a pose": 2,
    }


def test_two_trajectories_are_a_sentence(tmp_path: Path) -> None:
    root = sequence(tmp_path / "lr0")
    write(root / "livingRoom1.gt.freiburg", "")
    with pytest.raises(ConversionError, match=r"several trajectories \(livingRoom0\.gt\.freiburg, livingRoom1"):
        icl_nuim.read(root, Options())
