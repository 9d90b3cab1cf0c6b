"""CamVid folders to logs."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from made_up_images import HEIGHT, WIDTH, convert, detected, encoded, rgb, write

from stsem.convert.camvid import CLASSES, PUBLISHED, detect, read
from stsem.convert.recording import ColorEvent, Loss, Options, TruthEvent, even_stamp_ns
from stsem.errors import ConversionError

FRAMES = (6690, 6720, 6750)


def ids(k: int) -> npt.NDArray[np.uint8]:
    """(H, W) ids 0 to 11, 11 is unlabelled."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    return ((u + v + k) % 12).astype(np.uint8)


def truth(k: int) -> npt.NDArray[np.uint8]:
    labels = ids(k)
    labels[labels == 11] = 255
    return labels


def tutorial(root: Path) -> Path:
    """The SegNet tutorial's folder: two sequences over two splits."""
    for split, names in (
        ("train", [f"0001TP_{k:06}" for k in FRAMES[:2]] + ["0006R0_f00930"]),
        ("test", [f"0001TP_{FRAMES[2]:06}", "Seq05VD_f00000"]),
    ):
        for name in names:
            k = int(name.rsplit("_", 1)[1].lstrip("f")) % 100
            write(root / split / f"{name}.png", rgb(k))
            write(root / f"{split}annot" / f"{name}.png", ids(k))
    write(root / "train.txt", "/SegNet/CamVid/train/0001TP_006690.png /SegNet/CamVid/trainannot/0001TP_006690.png\n")
    return root


def published_colours(k: int) -> npt.NDArray[np.uint8]:
    """(H, W, 3): one column for each of the 32 published classes."""
    palette = np.array([rgb for rgb, _ in PUBLISHED.values()], np.uint8)
    u = (np.mgrid[:HEIGHT, :WIDTH][1] + k) % 32
    return palette[u]


def published(root: Path, colours_file: bool = True) -> Path:
    for k in FRAMES:
        write(root / f"701_StillsRaw_full/0001TP_{k:06}.png", rgb(k % 100))
        write(root / f"LabeledApproved_full/0001TP_{k:06}_L.png", published_colours(k % 100))
    if colours_file:
        lines = "".join(f"{r} {g} {b}\t\t{name}\n" for name, ((r, g, b), _) in PUBLISHED.items())
        write(root / "label_colors.txt", lines)
    return root


def test_the_tutorials_form_comes_through_exactly(tmp_path: Path) -> None:
    """A sequence is put together from the splits, with the stamps of its frame numbers."""
    source = tutorial(tmp_path / "CamVid")
    assert detected(source) == ["camvid"]
    converted = convert(read, source, tmp_path / "log.mcap", Options(sequence="0001TP"))
    log = converted.log
    assert [plan.stamp_ns for plan in log.plans] == [even_stamp_ns(k, 30) for k in FRAMES]
    assert log.classes is not None
    assert log.classes.names == CLASSES.names
    for i, k in enumerate(FRAMES):
        np.testing.assert_array_equal(log.frame(i, depth=False, previous=False).image, rgb(k % 100))
        np.testing.assert_array_equal(log.truth(i), truth(k % 100))
    assert not converted.summary.losses
    assert converted.summary.notes == ("3 of 3 images are labelled.",)


@pytest.mark.parametrize("colours_file", [True, False])
def test_the_published_colours_are_grouped_into_11_classes(tmp_path: Path, colours_file: bool) -> None:
    source = published(tmp_path / "CamVid", colours_file)
    assert detected(source) == ["camvid"]
    log = convert(read, source, tmp_path / "log.mcap").log
    groups = [group for _, group in PUBLISHED.values()]
    of_class = np.array([255 if g is None else CLASSES.names.index(g) for g in groups], np.uint8)
    for i, k in enumerate(FRAMES):
        expected = np.broadcast_to(of_class[(np.arange(WIDTH) + k % 100) % 32], (HEIGHT, WIDTH))
        np.testing.assert_array_equal(log.truth(i), expected)


def test_the_published_tables_are_whole() -> None:
    """32 names, 32 colours, every one of the 11 classes in use, and each class has the colour of its namesake."""
    assert len(PUBLISHED) == len({rgb for rgb, _ in PUBLISHED.values()}) == 32
    assert {group for _, group in PUBLISHED.values()} - {None} == set(CLASSES.names)
    by_colour = dict(PUBLISHED.values())
    assert [by_colour[colour] for colour in CLASSES.colours] == list(CLASSES.names)


def test_other_colours_in_the_file_are_followed(tmp_path: Path) -> None:
    source = published(tmp_path)
    write(source / "label_colors.txt", "1 2 3 Sky\n\n4 5 6 Tree\n")
    pixels = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    pixels[:, :8], pixels[:, 8:16] = (1, 2, 3), (4, 5, 6)
    write(source / f"LabeledApproved_full/0001TP_{FRAMES[0]:06}_L.png", pixels)
    first = next(e.labels for e in read(source, Options()).events if isinstance(e, TruthEvent))
    assert [CLASSES.names[i] for i in first[0, [0, 8]]] == ["sky", "tree"]
    assert (first[:, 16:] == 255).all()


@pytest.mark.parametrize("line", ["1 2 Sky", "256 0 0 Sky", "1 2 3 Cloud", "-1 2 3 Sky", "1 2 3 Sky Sky"])
def test_a_broken_colour_file_is_named(tmp_path: Path, line: str) -> None:
    source = published(tmp_path)
    write(source / "label_colors.txt", line)
    with pytest.raises(ConversionError, match=r"label_colors\.txt has the line"):
        read(source, Options())


def test_several_sequences_need_a_choice(tmp_path: Path) -> None:
    with pytest.raises(ConversionError, match=r"holds 3 sequences \(0001TP, 0006R0, Seq05VD\).*--sequence NAME"):
        read(tutorial(tmp_path), Options())


def test_images_without_labels_are_counted(tmp_path: Path) -> None:
    """The video's other frames may lie among the labelled ones."""
    source = published(tmp_path)
    write(source / "701_StillsRaw_full/0001TP_006691.png", rgb(1))
    recording = read(source, Options())
    stamps = [e.stamp_ns for e in recording.events if isinstance(e, ColorEvent)]
    assert stamps == [even_stamp_ns(k, 30) for k in (6690, 6691, 6720, 6750)]
    assert recording.notes == ["3 of 4 images are labelled."]


def test_labels_without_images_are_counted(tmp_path: Path) -> None:
    """Those of this sequence."""
    source = tutorial(tmp_path)
    (source / f"train/0001TP_{FRAMES[0]:06}.png").unlink()
    (source / "test/Seq05VD_f00000.png").unlink()
    assert read(source, Options(sequence="0001TP")).notes == [
        "2 of 2 images are labelled.",
        "1 label images belong to no colour image: left out.",
    ]


def test_broken_images_are_counted(tmp_path: Path) -> None:
    source = published(tmp_path)
    write(source / f"LabeledApproved_full/0001TP_{FRAMES[0]:06}_L.png", ids(0))
    write(source / f"LabeledApproved_full/0001TP_{FRAMES[1]:06}_L.png", encoded(published_colours(0))[:-30])
    losses = [e.what for e in read(source, Options()).events if isinstance(e, Loss)]
    assert losses == ["label images that cannot be read"] * 2


def test_the_users_class_table_replaces_the_own_one(tmp_path: Path) -> None:
    source = published(tmp_path / "CamVid")
    table = write(tmp_path / "classes.json", {"road": "#804080 0", "sky": "#808080 1"})
    recording = read(source, Options(classes_file=table))
    first = next(e.labels for e in recording.events if isinstance(e, TruthEvent))
    assert recording.classes is not None
    assert recording.classes.names == ("road", "sky")
    np.testing.assert_array_equal(first == 0, (published_colours(90) == (128, 64, 128)).all(axis=2))


def test_another_folder_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "train/1.png", rgb(0))
    assert not detect(tmp_path)
    with pytest.raises(ConversionError, match="trainannot"):
        read(tmp_path, Options())
