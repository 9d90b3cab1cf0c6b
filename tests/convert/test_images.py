"""Plain folders: what the names of folders and files say, and what is assumed where they say nothing."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from made_up_images import HEIGHT, WIDTH, convert, encoded, pose, rgb, write
from PIL import Image as PilImage

from stsem.convert import images
from stsem.convert.names import keys_of
from stsem.convert.recording import Options, even_stamp_ns
from stsem.errors import ClassTableError, ConversionError
from stsem.pose import to_quaternion

NAMES = ["wall", "floor", "door"]
CAMERA = {"width": WIDTH, "height": HEIGHT, "fx": 20.0, "fy": 21.0, "cx": 15.5, "cy": 11.5}


def truth(k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    labels = ((np.arange(HEIGHT * WIDTH).reshape(HEIGHT, WIDTH) + k) % 3).astype(np.uint8)
    labels[0, :5] = 255
    return labels


def folder(root: Path, frames: int = 12) -> Path:
    """Frames 0 to 11 without leading zeros, so that order by letters would be wrong."""
    for k in range(frames):
        write(root / f"rgb/frame_{k}.png", rgb(k))
        write(root / f"depth/depth_{k}.png", np.full((HEIGHT, WIDTH), 1500 + k, np.uint16))
        write(root / f"labels/{k}.png", truth(k))
    write(root / "poses.txt", "\n".join(" ".join(f"{x:.17g}" for x in pose(k)[:3].ravel()) for k in range(frames)))
    write(root / "classes.json", json.dumps(NAMES))
    write(root / "camera.json", CAMERA)
    return root


def test_everything_is_found_and_paired_by_number(tmp_path: Path) -> None:
    """Natural order; stamps exact at 15 Hz; depth, truth, poses and camera of the image that they belong to."""
    root = folder(tmp_path / "walk")
    converted = convert(images.read, root, tmp_path / "log.mcap", Options(rate_hz=15))
    assert not converted.summary.losses
    with converted.log as log:
        assert log.classes is not None
        assert log.classes.names == tuple(NAMES)
        assert log.camera is not None
        assert (log.camera.fx, log.camera.cy) == (20.0, 11.5)
        assert [plan.stamp_ns for plan in log.plans] == [even_stamp_ns(k, 15) for k in range(12)]
        for k in range(12):
            frame = log.frame(k, depth=True, previous=False)
            np.testing.assert_array_equal(frame.image, rgb(k))
            np.testing.assert_array_equal(frame.depth, np.full((HEIGHT, WIDTH), np.float32((1500 + k) / 1000)))
            np.testing.assert_array_equal(log.truth(k), truth(k))
            np.testing.assert_allclose(frame.T_WC, pose(k), atol=1e-9)


def test_labels_outside_the_class_table_are_counted(tmp_path: Path) -> None:
    """One pixel in the second image, two in the third; 255 is no news."""
    root = folder(tmp_path / "walk", 3)
    for k in (1, 2):
        labels = truth(k)
        labels[1, :k] = 9
        write(root / f"labels/{k}.png", labels)
    converted = convert(images.read, root, tmp_path / "log.mcap", Options(rate_hz=15))
    said = "3 pixels in 2 label images have an id or colour outside the class table: ignored."
    assert [note for note in converted.summary.notes if "class table" in note] == [said]
    assert not converted.summary.losses
    with converted.log as log:
        assert log.truth(2)[1, :3].tolist() == [255, 255, truth(2)[1, 2]]


def test_a_palette_in_the_colours_of_the_classes_is_one_of_colours(tmp_path: Path) -> None:
    """As in a recorded log: the indices of such a png mean nothing."""
    root = folder(tmp_path / "walk", 1)
    write(root / "classes.json", json.dumps({"names": NAMES, "colours": [[9, 0, 0], [0, 9, 0], [0, 0, 9]]}))
    painted = PilImage.fromarray(np.minimum(truth(0), 2), "P")
    painted.putpalette([0, 0, 9, 0, 9, 0, 9, 0, 0])
    painted.save(root / "labels/0.png")
    with convert(images.read, root, tmp_path / "log.mcap", Options(rate_hz=15)).log as log:
        np.testing.assert_array_equal(log.truth(0), 2 - np.minimum(truth(0), 2))


def test_the_largest_sample_of_depth_is_unknown_as_in_a_log(tmp_path: Path) -> None:
    root = folder(tmp_path / "walk", 1)
    write(root / "depth/depth_0.png", np.tile(np.array([0, 1500, 65534, 65535], np.uint16), (HEIGHT, WIDTH // 4)))
    with convert(images.read, root, tmp_path / "log.mcap", Options(rate_hz=15)).log as log:
        depth = log.frame(0, depth=True, previous=False).depth
    assert depth is not None
    np.testing.assert_array_equal(depth[0, :4], np.array([np.nan, 1.5, 65.534, np.nan], np.float32))


@pytest.mark.parametrize(
    ("names", "stamps"),
    [
        (["1700000000.125", "1700000000.25"], [1_700_000_000_125_000_000, 1_700_000_000_250_000_000]),
        (["1700000000125", "1700000000250"], [1_700_000_000_125_000_000, 1_700_000_000_250_000_000]),
        (["1700000000125001", "1700000000250001"], [1_700_000_000_125_001_000, 1_700_000_000_250_001_000]),
        (["1700000000125000001", "1700000000250000001"], [1_700_000_000_125_000_001, 1_700_000_000_250_000_001]),
    ],
    ids=["s", "ms", "us", "ns"],
)
def test_stamps_in_names_are_taken(tmp_path: Path, names: list[str], stamps: list[int]) -> None:
    """With poses on the same clock, more often than images."""
    lines = ""
    for k, (name, stamp) in enumerate(zip(names, stamps, strict=True)):
        write(tmp_path / f"walk/{name}.png", rgb(k))
        t, q = pose(k)[:3, 3], to_quaternion(pose(k))
        lines += f"{stamp // 10**9}.{stamp % 10**9:09d} {' '.join(f'{x:.17g}' for x in (*t, *q))}\n"
    write(tmp_path / "walk/groundtruth.txt", lines)
    converted = convert(images.read, tmp_path / "walk", tmp_path / "log.mcap")
    with converted.log as log:
        assert [plan.stamp_ns for plan in log.plans] == stamps
        np.testing.assert_allclose(log.frame(1, depth=False, previous=False).T_WC, pose(1), atol=1e-9)


@pytest.mark.parametrize("digits", [10, 13, 16, 19])
def test_numbers_filled_up_with_zeros_are_no_stamps(digits: int) -> None:
    found = keys_of([Path(f"{k:0{digits}d}.png") for k in range(12)])
    assert (found.kind, list(found.files)) == ("number", list(range(12)))


def test_one_name_without_a_stamp_makes_all_numbers(tmp_path: Path) -> None:
    assert keys_of([Path("1700000000125.png"), Path("frame7.png")]).kind == "number"
    assert keys_of([Path("a1.png"), Path("b1.png")]).kind == "name"
    assert keys_of([Path("a.png")]).kind == "name"


def test_labels_may_be_colours(tmp_path: Path) -> None:
    """By the palette of the class table; a colour outside it is ignored."""
    colours = np.array([[128, 64, 128], [0, 0, 142], [70, 70, 70]], np.uint8)
    write(tmp_path / "walk/images/0.png", rgb(0))
    picture = colours[truth(0) % 3]
    picture[5, 6] = 1, 2, 3
    write(tmp_path / "walk/semantic/0.png", picture)
    write(tmp_path / "walk/classes.json", json.dumps({"names": NAMES, "colours": colours.tolist()}))
    with convert(images.read, tmp_path / "walk", tmp_path / "log.mcap").log as log:
        expected = truth(0) % 3
        expected[5, 6] = 255
        np.testing.assert_array_equal(log.truth(0), expected)


def test_what_belongs_to_nothing_is_counted(tmp_path: Path) -> None:
    """Depth, labels and poses of images that are not there, images without poses, and what cannot be read."""
    root = folder(tmp_path / "walk", frames=4)
    (root / "rgb/frame_1.png").unlink()
    write(root / "labels/2.png", b"not an image")
    write(root / "depth/depth_3.png", encoded(np.zeros((8, 8), np.uint16)))
    converted = convert(images.read, root, tmp_path / "log.mcap")
    converted.log.close()
    assert converted.summary.losses == {
        "label images that belong to no colour image": 1,
        "depth images that belong to no colour image": 1,
        "lines of poses.txt that are not a pose, or that of no image": 1,
        "label images that cannot be read": 1,
        "depth images of another size than the first": 1,
    }


def test_links_and_pipes_do_no_harm(tmp_path: Path) -> None:
    """A link to itself, to nowhere or out of the folder is a loss; a pipe is no image, and nobody waits for it."""
    root = folder(tmp_path / "walk", frames=3)
    (root / "rgb/frame_3.png").symlink_to("frame_3.png")
    (root / "rgb/frame_4.png").symlink_to("nowhere.png")
    (root / "rgb/frame_5.png").symlink_to(write(tmp_path / "secret.png", rgb(7)))
    os.mkfifo(root / "rgb/frame_6.png")
    (root / "poses.txt").unlink()
    converted = convert(images.read, root, tmp_path / "log.mcap")
    with converted.log as log:
        assert len(log.plans) == 3
    assert converted.summary.losses == {"colour images that cannot be read": 3}


def test_labels_without_a_class_table_are_a_loss(tmp_path: Path) -> None:
    root = folder(tmp_path / "walk", frames=3)
    (root / "classes.json").unlink()
    converted = convert(images.read, root, tmp_path / "log.mcap")
    with converted.log as log:
        assert log.classes is None
    assert converted.summary.losses == {"label images that no class table names (--classes FILE)": 3}
    stated = write(tmp_path / "classes.txt", "wall\nfloor\ndoor\n")
    with convert(images.read, root, tmp_path / "log.mcap", Options(classes_file=stated)).log as log:
        np.testing.assert_array_equal(log.truth(2), truth(2))


def test_no_image_and_a_bad_table_are_sentences(tmp_path: Path) -> None:
    (tmp_path / "rgb").mkdir()
    with pytest.raises(ConversionError, match="has no images"):
        images.read(tmp_path, Options())
    root = folder(tmp_path / "walk", frames=1)
    write(root / "classes.json", "[1, 2]")
    with pytest.raises(ClassTableError):
        images.read(root, Options())
