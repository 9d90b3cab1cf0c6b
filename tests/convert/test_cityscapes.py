"""Cityscapes sequences to logs."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from made_up_images import HEIGHT, WIDTH, convert, detected, rgb, write

from stsem.convert.cityscapes import CLASSES, LABEL_IDS, detect, read
from stsem.convert.recording import ColorEvent, DepthEvent, Loss, Options, TruthEvent, even_stamp_ns
from stsem.errors import ConversionError

CAMERA = {
    "extrinsic": {"baseline": 0.209313, "pitch": 0.038, "roll": 0, "x": 1.7, "y": 0.1, "yaw": -0.0195, "z": 1.22},
    "intrinsic": {"fx": 2262.52, "fy": 2265.30, "u0": 1096.98, "v0": 513.137},
}
VOID = 255


def train_ids(k: int) -> npt.NDArray[np.uint8]:
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    labels = ((u + 2 * v + k) % 19).astype(np.uint8)
    labels[:3] = VOID
    return labels


def label_ids(k: int) -> npt.NDArray[np.uint8]:
    """The same as `train_ids`, in ids; the void stripe has the ids 0, 6 and 29."""
    ids = np.array([*LABEL_IDS], np.uint8)[np.minimum(train_ids(k), 18)]
    ids[0], ids[1], ids[2] = 0, 6, 29
    return ids


def disparity(k: int) -> npt.NDArray[np.uint16]:
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    pixels = (u * 300 + v * 256 + k).astype(np.uint16)
    pixels[0] = 0
    pixels[1] = 1
    return pixels


def metres(k: int) -> npt.NDArray[np.float32]:
    """d = (p - 1) / 256, depth = baseline fx / d."""
    d = (disparity(k).astype(np.float64) - 1) / 256
    d[d <= 0] = np.nan
    return (CAMERA["extrinsic"]["baseline"] * CAMERA["intrinsic"]["fx"] / d).astype(np.float32)


def snippet(root: Path, sequence: str = "aachen_000000", first: int = 0, kind: str = "labelTrainIds") -> Path:
    """30 frames, the 20th with labels, disparity and camera."""
    city = sequence.split("_")[0]
    for k in range(first, first + 30):
        write(root / f"leftImg8bit_sequence/val/{city}/{sequence}_{k:06}_leftImg8bit.png", rgb(k % 256))
    k = first + 19
    labels = train_ids(k) if kind == "labelTrainIds" else label_ids(k)
    write(root / f"gtFine/val/{city}/{sequence}_{k:06}_gtFine_{kind}.png", labels)
    write(root / f"gtFine/val/{city}/{sequence}_{k:06}_gtFine_color.png", rgb(1))
    write(root / f"camera/val/{city}/{sequence}_{k:06}_camera.json", CAMERA)
    write(root / f"disparity/val/{city}/{sequence}_{k:06}_disparity.png", disparity(k))
    write(root / f"vehicle/val/{city}/{sequence}_{k:06}_vehicle.json", {"speed": 8.1, "yawRate": 0.01})
    return root


@pytest.mark.parametrize("kind", ["labelTrainIds", "labelIds"])
def test_a_snippet_comes_through_exactly(tmp_path: Path, kind: str) -> None:
    source = snippet(tmp_path / "cityscapes", kind=kind)
    assert detected(source) == ["cityscapes"]
    converted = convert(read, source, tmp_path / "log.mcap")
    log = converted.log
    assert [plan.stamp_ns for plan in log.plans] == [even_stamp_ns(k, 17) for k in range(30)]
    assert log.classes is not None
    assert log.classes.names == CLASSES.names
    assert [k for k in range(30) if log.truth(k) is not None] == [19]
    np.testing.assert_array_equal(log.truth(19), train_ids(19))
    frame = log.frame(19, depth=True, previous=False)
    np.testing.assert_array_equal(frame.depth, metres(19))
    assert log.camera is not None
    shrunk = WIDTH / 2048
    assert (log.camera.fx, log.camera.width) == (2262.52 * shrunk, WIDTH)
    assert log.camera.cx == pytest.approx((1096.98 + 0.5) * shrunk - 0.5, abs=1e-12)
    assert not converted.summary.losses
    assert "1 of 30 images are labelled." in converted.summary.notes


def test_gaps_between_the_snippets_of_a_drive_stay(tmp_path: Path) -> None:
    """Some cities number the frames of one long drive: several snippets, one sequence."""
    snippet(tmp_path, "hamburg_000000", 100)
    snippet(tmp_path, "hamburg_000000", 900)
    stamps = [e.stamp_ns for e in read(tmp_path, Options()).events if isinstance(e, ColorEvent)]
    assert stamps == [even_stamp_ns(k, 17) for k in (*range(100, 130), *range(900, 930))]


def test_a_city_folder_has_images_alone(tmp_path: Path) -> None:
    source = snippet(tmp_path) / "leftImg8bit_sequence/val/aachen"
    recording = read(source, Options())
    assert {type(e) for e in recording.events} == {ColorEvent}
    assert recording.classes is None
    assert recording.camera is None
    assert any("no truth" in note for note in recording.notes)
    assert any("no intrinsics" in note for note in recording.notes)


def test_several_sequences_need_a_choice(tmp_path: Path) -> None:
    snippet(tmp_path)
    snippet(tmp_path, "aachen_000001")
    with pytest.raises(ConversionError, match=r"2 sequences \(aachen_000000, aachen_000001\).*--sequence NAME"):
        read(tmp_path, Options())
    recording = read(tmp_path, Options(sequence="aachen_000001"))
    assert sum(isinstance(e, TruthEvent) for e in recording.events) == 1


def test_trainids_win_over_ids_and_strays_are_counted(tmp_path: Path) -> None:
    snippet(tmp_path)
    write(tmp_path / "gtFine/val/aachen/aachen_000000_000019_gtFine_labelIds.png", np.zeros((4, 4), np.uint8))
    write(tmp_path / "gtFine/val/aachen/aachen_000000_000077_gtFine_labelTrainIds.png", train_ids(0))
    recording = read(tmp_path, Options())
    truth = [e.labels for e in recording.events if isinstance(e, TruthEvent)]
    np.testing.assert_array_equal(truth, [train_ids(19)])
    assert "1 label images belong to no colour image: left out." in recording.notes


def test_the_users_class_table_replaces_the_own_one(tmp_path: Path) -> None:
    snippet(tmp_path, kind="labelIds")
    table = write(tmp_path / "classes.json", {"7": "road", "26": "car"})
    recording = read(tmp_path, Options(classes_file=table))
    (truth,) = (e.labels for e in recording.events if isinstance(e, TruthEvent))
    assert recording.classes is not None
    assert recording.classes.names == ("road", "car")
    np.testing.assert_array_equal(truth == 0, label_ids(19) == 7)
    np.testing.assert_array_equal(truth == 1, label_ids(19) == 26)


@pytest.mark.parametrize(
    "content", ["{", "[]", "null", '{"intrinsic": {"fx": "wide"}}', "[" * 100_000, '{"intrinsic": {"fx": 1e999}}']
)
def test_a_broken_camera_file_is_named(tmp_path: Path, content: str) -> None:
    snippet(tmp_path)
    write(tmp_path / "camera/val/aachen/aachen_000000_000019_camera.json", content)
    with pytest.raises(ConversionError, match=r"_camera\.json is no Cityscapes camera"):
        read(tmp_path, Options())


def test_broken_images_are_counted(tmp_path: Path) -> None:
    snippet(tmp_path)
    write(tmp_path / "disparity/val/aachen/aachen_000000_000019_disparity.png", rgb(0))
    write(tmp_path / "gtFine/val/aachen/aachen_000000_000019_gtFine_labelTrainIds.png", b"")
    events = list(read(tmp_path, Options()).events)
    assert [e.what for e in events if isinstance(e, Loss)] == [
        "depth images that cannot be read", "label images that cannot be read",
    ]  # fmt: skip
    assert not any(isinstance(e, DepthEvent) for e in events)


def test_another_folder_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "pictures/1.png", rgb(0))
    assert not detect(tmp_path)
    with pytest.raises(ConversionError, match="leftImg8bit_sequence"):
        read(tmp_path, Options())
