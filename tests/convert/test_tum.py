"""TUM RGB-D: stamps to the nanosecond, depth exact, poses to 1e-9; and lists that lie."""

from pathlib import Path

import numpy as np
import pytest
from made_up_images import HEIGHT, WIDTH, contents, convert, encoded, pose, rgb, write

from stsem.convert import tum
from stsem.convert.recording import Options
from stsem.errors import ConversionError
from stsem.pose import to_quaternion

START_NS = 1_305_031_102_175_304_000
PERIOD_NS = 33_000_001


def seconds(stamp_ns: int) -> str:
    return f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"


def raw_depth(k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    """Fifths of a millimetre, with holes."""
    samples = (np.arange(HEIGHT * WIDTH, dtype=np.uint16).reshape(HEIGHT, WIDTH) * 31 + k).astype(np.uint16)
    samples[2, 3] = 0
    return samples


def sequence(root: Path, frames: int = 4, depth_lag_ns: int = 4_000_000) -> Path:
    """Colour, depth a little later, poses three times as often; comments as in the originals."""
    lists = {"rgb.txt": "# color images\n", "depth.txt": "# depth maps\n", "groundtruth.txt": "# timestamp tx ty tz\n"}
    for k in range(frames):
        stamp = START_NS + k * PERIOD_NS
        write(root / f"rgb/{k}.png", rgb(k))
        write(root / f"depth/{k}.png", raw_depth(k))
        lists["rgb.txt"] += f"{seconds(stamp)} rgb/{k}.png\n"
        lists["depth.txt"] += f"{seconds(stamp + depth_lag_ns)} depth/{k}.png\n"
        t, q = pose(k)[:3, 3], to_quaternion(pose(k))
        lists["groundtruth.txt"] += f"{seconds(stamp)} {' '.join(f'{x:.17g}' for x in (*t, *q))}\n"
    for name, text in lists.items():
        write(root / name, text)
    return root


@pytest.fixture
def freiburg(tmp_path: Path) -> Path:
    return sequence(tmp_path / "rgbd_dataset_freiburg3_made_up")


def test_a_sequence_reads_back_as_it_is(freiburg: Path, tmp_path: Path) -> None:
    """Colour bytes, stamps and depth exactly; depth within 20 ms is the frame's."""
    before = contents(freiburg)
    converted = convert(tum.read, freiburg, tmp_path / "log.mcap")
    assert not converted.summary.losses
    with converted.log as log:
        assert [plan.stamp_ns for plan in log.plans] == [START_NS + k * PERIOD_NS for k in range(4)]
        for k in range(4):
            frame = log.frame(k, depth=True, previous=False)
            np.testing.assert_array_equal(frame.image, rgb(k))
            expected = (raw_depth(k) / 5000).astype(np.float32)
            expected[raw_depth(k) == 0] = np.nan
            np.testing.assert_array_equal(frame.depth, expected)
            np.testing.assert_allclose(frame.T_WC, pose(k), atol=1e-9)
    assert contents(freiburg) == before


@pytest.mark.parametrize(
    ("folder", "focal", "distorted"),
    [("rgbd_dataset_freiburg1_desk", 517.3, True), ("fr2_xyz", 520.9, True), ("freiburg3_office", 535.4, False),
     ("desk", 525.0, False)],
)  # fmt: skip
def test_the_camera_is_known_by_the_name_of_the_folder(
    tmp_path: Path, folder: str, focal: float, distorted: bool
) -> None:
    root = tmp_path / folder
    big = np.zeros((480, 640, 3), np.uint8)
    write(root / "rgb/0.png", big)
    write(root / "rgb.txt", "1305031102.5 rgb/0.png\n")
    recording = tum.read(root, Options())
    assert recording.camera is not None
    assert (recording.camera.fx, recording.camera.is_distorted) == (focal, distorted)
    assert any("default" in note for note in recording.notes) == (focal == 525.0)


def test_a_calibration_in_the_folder_goes_first(freiburg: Path, tmp_path: Path) -> None:
    """As the data sets of ETH3D have it."""
    write(freiburg / "calibration.txt", "30.5 31.5 15.5 11.5\n")
    with convert(tum.read, freiburg, tmp_path / "log.mcap").log as log:
        assert log.camera is not None
        assert (log.camera.fx, log.camera.fy, log.camera.cx, log.camera.cy) == (30.5, 31.5, 15.5, 11.5)


def test_nothing_outside_the_folder_is_opened(freiburg: Path, tmp_path: Path) -> None:
    """Neither by dots, nor by an absolute path, nor by a link; each is a loss, and the rest is converted."""
    outside = write(tmp_path / "secret.png", rgb(9))
    (freiburg / "rgb/link.png").symlink_to(outside)
    with (freiburg / "rgb.txt").open("a") as stream:
        stream.write(f"1305031103.1 ../secret.png\n1305031103.2 {outside}\n1305031103.3 rgb/link.png\n")
        stream.write("1305031103.4 ../../../../../../etc/passwd\n1305031103.5 rgb\n")
    converted = convert(tum.read, freiburg, tmp_path / "log.mcap")
    assert converted.summary.losses == {"colour images that cannot be read": 5}
    with converted.log as log:
        assert len(log.plans) == 4


def test_what_is_wrong_is_left_out_and_counted(freiburg: Path, tmp_path: Path) -> None:
    """Missing, cut and differently sized images, poses that are none, lines that are none, stamps that are none."""
    (freiburg / "rgb/0.png").unlink()
    write(freiburg / "rgb/1.png", encoded(rgb(1))[:-30])
    write(freiburg / "rgb/3.png", rgb(3, 16, 12))
    write(freiburg / "depth/2.png", np.zeros((HEIGHT, WIDTH), np.uint8))
    with (freiburg / "groundtruth.txt").open("a") as stream:
        stream.write("1305031103.0 nan 0 0 0 0 0 1\n1305031103.1 -inf 0 0 0 0 0 1\n1305031103.2 0 0 0 0 0 0 0\n")
        stream.write("1e400 0 0 0 0 0 0 1\nnever 0 0 0 0 0 0 1\n1305031103.3 1 2\n")
    converted = convert(tum.read, freiburg, tmp_path / "log.mcap")
    assert converted.summary.losses == {
        "lines of groundtruth.txt that are not a stamp and a pose": 6,
        "colour images that cannot be read": 1,
        "colour images that cannot be decoded": 1,
        "colour images of another size than the first": 1,
        "depth images that cannot be read": 1,
    }
    with converted.log as log:
        assert [plan.stamp_ns for plan in log.plans] == [START_NS + 2 * PERIOD_NS]
        assert not log.info.damage.lossy


def test_lists_out_of_order_are_sorted(freiburg: Path, tmp_path: Path) -> None:
    lines = (freiburg / "rgb.txt").read_text().splitlines()
    write(freiburg / "rgb.txt", "\n".join(reversed(lines)))
    converted = convert(tum.read, freiburg, tmp_path / "log.mcap")
    assert any("rgb.txt do not ascend" in note for note in converted.summary.notes)
    with converted.log as log:
        np.testing.assert_array_equal(log.frame(0, depth=False, previous=False).image, rgb(0))


@pytest.mark.parametrize("content", ["", "# nothing\n", b"\xff\xfe\x00\x01 \xff", b"\0" * 40])
def test_a_list_without_images_is_a_sentence(tmp_path: Path, content: str | bytes) -> None:
    write(tmp_path / "rgb.txt", content)
    with pytest.raises(ConversionError, match=r"^.*rgb\.txt .*\.$"):
        tum.read(tmp_path, Options())


def test_bytes_that_are_no_text_cost_their_line(freiburg: Path, tmp_path: Path) -> None:
    """A comment in Latin-1 costs nothing, a number with a broken byte costs a pose, a broken name an image."""
    poses = (freiburg / "groundtruth.txt").read_bytes().splitlines(keepends=True)
    poses[0] = "# aufgenommen in Köln\n".encode("latin-1")
    poses[2] = poses[2].replace(b".", b"\xff", 1)
    (freiburg / "groundtruth.txt").write_bytes(b"".join(poses))
    images = (freiburg / "rgb.txt").read_bytes()
    (freiburg / "rgb.txt").write_bytes(images.replace(b"rgb/2", b"rgb/\xe9"))
    converted = convert(tum.read, freiburg, tmp_path / "log.mcap")
    assert converted.summary.losses["lines of groundtruth.txt that are not a stamp and a pose"] == 1
    assert sum(converted.summary.losses.values()) == 2
    assert converted.summary.messages["/camera/color"] == 3
    assert converted.summary.messages["/pose"] == 3
