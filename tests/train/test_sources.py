"""What a training reads: logs and folders give the same pairs; what cannot be read is one sentence."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from stsem.classes import NO_LABEL, ClassSet
from stsem.errors import ClassTableError, StsemError, TrainingError
from stsem.log.classtable import read_class_map
from stsem.log.log import open_log
from stsem.train.consecutive import consecutive
from stsem.train.dataset import PairFolder, Pairs, save_pair
from stsem.train.log_pairs import decode_log
from stsem.train.sources import Reading, classes_of, join, open_source
from stsem.train.vocabulary import lookup, network_classes
from tests.made_up_walk import NAMES, write_walk

from .squares import pair

SPARSE = lambda index: index % 4 == 1 or index == 0  # noqa: E731


def _write_images(folder: Path, log: Path) -> Path:
    """The frames of a log as a folder of images."""
    for name in ("images", "labels", "depth"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "classes.txt").write_text("\n".join(NAMES.values()))
    with open_log([log]) as opened:
        for loaded in opened.frames(range(len(opened.plans)), depth=True, previous=False, truth=True):
            assert loaded.frame is not None
            name = f"{loaded.index}.png"  # 9 comes before 10 by nature
            cv2.imwrite(str(folder / "images" / name), loaded.frame.image[:, :, ::-1])
            if loaded.truth is not None:
                cv2.imwrite(str(folder / "labels" / name), loaded.truth)
            if loaded.frame.depth is not None:
                millimetres = np.nan_to_num(loaded.frame.depth * 1000).round().astype(np.uint16)
                cv2.imwrite(str(folder / "depth" / name), millimetres)
    return folder


def _assert_same(one: Pairs, other: Pairs) -> None:
    assert len(one) == len(other)
    for index in range(len(one)):
        a, b = one.pair(index), other.pair(index)
        assert np.array_equal(a.images, b.images)
        assert np.array_equal(a.labels, b.labels)
        assert a.depths is not None
        assert b.depths is not None
        assert np.array_equal(a.depths, b.depths, equal_nan=True)


@pytest.mark.parametrize("truth", [None, SPARSE], ids=["every frame", "few frames"])
def test_logs_and_folders_give_the_same_pairs(tmp_path: Path, truth: Callable[[int], bool] | None) -> None:
    """Images, labels and depth; frames without truth serve as predecessors."""
    log = write_walk(tmp_path / "walk.mcap", **({} if truth is None else {"truth": truth}))
    how = Reading(tmp_path / "cache", depth=True)
    of_log, of_folder = (open_source([str(given)], how) for given in (log, _write_images(tmp_path / "images", log)))
    assert of_log.classes.names == of_folder.classes.names == tuple(NAMES.values())
    assert of_log.size == of_folder.size == (96, 64)
    _assert_same(of_log.pairs, of_folder.pairs)
    assert len(of_log.pairs) == (11 if truth is None else 3)
    labelled = [of_log.pairs.pair(index).labelled for index in range(len(of_log.pairs))]
    assert set(labelled) == ({(0, 1)} if truth is None else {(0, 1), (1,)})


def test_a_log_is_decoded_once_and_gone_on_with(tmp_path: Path) -> None:
    """Frames that are there are not read again; a killed decoding goes on; another log starts anew."""
    log, folder, seen = write_walk(tmp_path / "walk.mcap"), tmp_path / "frames", []
    with open_log([log]) as opened:
        first = decode_log(opened, folder, report=lambda done, total: seen.append((done, total)))
        assert seen == [(k, 12) for k in range(1, 13)]
        expected = [first.pair(index) for index in range(len(first))]
        again = decode_log(opened, folder, report=lambda done, total: pytest.fail("decoded again"))
        assert again.fingerprint == first.fingerprint
        (folder / "frames.json").unlink()
        (folder / "0000005.npz").unlink()
        (folder / ".0000006.npz.999999999").write_bytes(b"half")
        seen.clear()
        last = decode_log(opened, folder, report=lambda done, total: seen.append((done, total)))
        assert seen == [(12, 12)]
        for index, one in enumerate(expected):
            assert np.array_equal(last.pair(index).images, one.images)
            assert np.array_equal(last.pair(index).labels, one.labels)
    with open_log([write_walk(tmp_path / "other.mcap", frames=5)]) as other:
        assert len(decode_log(other, folder)) == 4
    (folder / "0000001.npz").write_bytes(b"")
    with open_log([tmp_path / "other.mcap"]) as other, pytest.raises(TrainingError, match="0000001"):
        decode_log(other, folder).pair(0)
    (folder / "frames.json").unlink()
    with open_log([tmp_path / "other.mcap"]) as other, pytest.raises(TrainingError, match="0000001"):
        decode_log(other, folder)


def test_frames_whose_size_changes_have_no_predecessor(tmp_path: Path) -> None:
    """A pair has one size: the labelled frame stands alone, as where its predecessor cannot be decoded."""
    folder = tmp_path / "frames"
    with open_log([write_walk(tmp_path / "walk.mcap", frames=4)]) as opened:
        pairs = decode_log(opened, folder)
    with np.load(folder / "0000001.npz") as arrays:
        kept = {name: array[:32] for name, array in arrays.items()}
    np.savez(folder / "0000001.npz", **kept)
    for index, height in ((0, 32), (1, 64), (2, 64)):
        seen = pairs.pair(index)
        assert (seen.images.shape, seen.labels.shape) == ((2, height, 96, 3), (2, height, 96))
        assert np.array_equal(seen.images[0], seen.images[1]) == (index < 2)


def test_frames_that_cannot_be_decoded(tmp_path: Path) -> None:
    """A broken predecessor is left out, a broken labelled frame counted."""
    log = write_walk(tmp_path / "walk.mcap", truth=SPARSE, broken=frozenset({4, 9}))
    source = open_source([str(log)], Reading(tmp_path / "cache"))
    assert len(source.pairs) == 2
    alone = source.pairs.pair(1)
    assert np.array_equal(alone.images[0], alone.images[1])
    assert "1 labelled frames of walk cannot be decoded" in source.notes[0]


@pytest.mark.parametrize(("labelled", "pairs"), [
    ("", []), ("0", []), ("1", [(0, 0)]), ("10", [(0, 1)]), ("11", [(0, 1)]), ("01", [(0, 1)]),
    ("1001", [(0, 1), (2, 3)]), ("0110", [(0, 1), (1, 2)]), ("00", []),
])  # fmt: skip
def test_which_frames_make_pairs(labelled: str, pairs: list[tuple[int, int]]) -> None:
    """By hand."""
    assert consecutive([mark == "1" for mark in labelled]) == pairs


def test_sequences_do_not_meet(tmp_path: Path) -> None:
    """Folders below `images` are recordings of their own: no pair crosses from one to the next."""
    rng = np.random.default_rng(0)
    for sequence, shade in (("a", 10), ("b", 200)):
        for kind in ("images", "labels"):
            (tmp_path / kind / sequence).mkdir(parents=True)
        for k in range(3):
            image = np.full((8, 9, 3), shade, np.uint8)
            cv2.imwrite(str(tmp_path / "images" / sequence / f"{k}.png"), image)
            cv2.imwrite(str(tmp_path / "labels" / sequence / f"{k}.png"), rng.integers(0, 2, (8, 9)).astype(np.uint8))
    (tmp_path / "classes.json").write_text('["floor", "wall"]')
    pairs = open_source([str(tmp_path)], Reading(tmp_path / "cache")).pairs
    assert len(pairs) == 4
    assert all(np.ptp(pairs.pair(index).images) == 0 for index in range(4))


def _image_folder(folder: Path) -> Path:
    """Two small labelled images."""
    for kind in ("images", "labels"):
        (folder / kind).mkdir(parents=True)
        for k in range(2):
            cv2.imwrite(str(folder / kind / f"{k}.png"), np.ones((8, 9, 3) if kind == "images" else (8, 9), np.uint8))
    (folder / "classes.json").write_text('["floor", "wall"]')
    return folder


def _spoil(folder: Path, what: str) -> None:
    image = str(folder / "images" / "1.png")
    label = str(folder / "labels" / "1.png")
    spoilt: dict[str, Callable[[], object]] = {
        "id": lambda: cv2.imwrite(label, np.full((8, 9), 7, np.uint8)),
        "label size": lambda: cv2.imwrite(label, np.ones((4, 9), np.uint8)),
        "image": lambda: Path(image).write_bytes(b"no image"),
        "empty": lambda: Path(image).write_bytes(b""),
        "turned": lambda: _turn(Path(image)),
        "table": (folder / "classes.json").unlink,
        "names": lambda: [path.rename(path.with_stem(f"x{path.stem}")) for path in (folder / "labels").iterdir()],
        "labels": lambda: shutil.rmtree(folder / "labels"),
        "two": lambda: cv2.imwrite(image.replace("png", "jpg"), np.ones((8, 9, 3), np.uint8)),
    }
    spoilt[what]()


def _turn(path: Path) -> None:
    """Into a JPEG on its side."""
    path.unlink()
    jpeg = cv2.imencode(".jpg", np.ones((8, 9, 3), np.uint8))[1].tobytes()
    tag = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    path.with_suffix(".jpg").write_bytes(jpeg[:2] + b"\xff\xe1" + (len(tag) + 2).to_bytes(2, "big") + tag + jpeg[2:])


def test_images_of_unequal_sizes_stand_alone(tmp_path: Path) -> None:
    """As frames of a log whose size changes; depth that the network does not take is not even looked at."""
    folder = _image_folder(tmp_path / "data")
    cv2.imwrite(str(folder / "images" / "1.png"), np.full((4, 9, 3), 7, np.uint8))
    cv2.imwrite(str(folder / "labels" / "1.png"), np.zeros((4, 9), np.uint8))
    (folder / "depth").mkdir()
    (folder / "depth" / "1.png").write_bytes(b"no depth")
    pairs = open_source([str(folder)], Reading(tmp_path / "cache")).pairs
    seen = pairs.pair(0)
    assert (seen.images.shape, np.unique(seen.images).tolist(), seen.labels.shape) == ((2, 4, 9, 3), [7], (2, 4, 9))


@pytest.mark.parametrize(("what", "sentence"), [
    ("id", "1.png has 72 pixels with an id or colour that the class table of 2 classes does not have"),
    ("label size", "1.png is 9x4, but"), ("image", "1.png cannot be used: it is neither png"),
    ("empty", "1.png cannot be used: it is empty"), ("turned", "1.jpg has an EXIF tag that turns it"),
    ("table", "have no class table; give --classes FILE"), ("names", "but none of equal name"),
    ("labels", "holds no log"), ("two", "have one name"),
])  # fmt: skip
def test_image_folders_that_cannot_be(tmp_path: Path, what: str, sentence: str) -> None:
    """One sentence, in which the file is named."""
    folder = _image_folder(tmp_path / "data")
    _spoil(folder, what)
    with pytest.raises(StsemError) as said:
        open_source([str(folder)], Reading(tmp_path / "cache")).pairs.pair(0)
    assert sentence in str(said.value)


def test_logs_without_what_is_needed(tmp_path: Path) -> None:
    """No labels; no depth where the network wants it."""
    log = write_walk(tmp_path / "walk.mcap", truth=None, depth=None)
    with pytest.raises(TrainingError, match="no frame with labels"):
        open_source([str(log)], Reading(tmp_path / "cache"))
    with pytest.raises(TrainingError, match="no depth"):
        open_source([str(log)], Reading(tmp_path / "cache", depth=True))


def test_pairs_need_a_table_that_counts_from_zero(tmp_path: Path) -> None:
    """In the folder, or given."""
    save_pair(tmp_path / "0.npz", pair(0))
    table = tmp_path / "table.json"
    with pytest.raises(ClassTableError, match="no class table"):
        open_source([str(tmp_path)], Reading(tmp_path / "cache"))
    table.write_text('["dark", "red", "green"]')
    assert len(open_source([str(tmp_path)], Reading(tmp_path, table)).pairs) == 1
    table.write_text(json.dumps({"1": "dark", "2": "red"}))
    with pytest.raises(StsemError, match="counts from 0"):
        open_source([str(tmp_path)], Reading(tmp_path, table))


@pytest.mark.parametrize(("arrays", "sentence"), [
    ({"images": np.zeros((64, 96, 3), np.uint8)}, r"images have the shape \(64, 96, 3\), not \(2, H, W, 3\)"),
    ({"images": np.zeros((2, 64, 96, 3), np.float32)}, "images are float32"),
    ({"labels": np.zeros((2, 32, 48), np.uint8)}, r"labels are uint8 \(2, 32, 48\), not uint8 \(2, 64, 96\)"),
    ({"labels": np.zeros((2, 64, 96), np.int64)}, "labels are int64"),
    ({"depths_mm": np.zeros((2, 64, 96), np.float32)}, "depths_mm are float32"), ({"labels": None}, "labels"),
])  # fmt: skip
def test_pairs_of_another_form_are_refused(tmp_path: Path, arrays: dict[str, object], sentence: str) -> None:
    """Not taken for what they are not: labels of another size would lie beside the image."""
    good = {"images": np.zeros((2, 64, 96, 3), np.uint8), "labels": np.zeros((2, 64, 96), np.uint8)}
    np.savez(tmp_path / "0.npz", **{name: array for name, array in (good | arrays).items() if array is not None})
    with pytest.raises(TrainingError, match=f"0.npz cannot be read .*{sentence}"):
        PairFolder(tmp_path).pair(0)


def test_labels_beyond_the_class_table_are_not_lost_in_silence(tmp_path: Path) -> None:
    """In whichever pair they are: they would have counted as ignored."""
    save_pair(tmp_path / "0.npz", pair(0))
    save_pair(tmp_path / "1.npz", pair(1))
    (tmp_path / "classes.txt").write_text("dark\nred\ngreen\n")
    whole = open_source([str(tmp_path)], Reading(tmp_path))
    assert join([whole], whole.classes, {}).pair(1).labelled == (0, 1)
    chosen = open_source([str(tmp_path)], Reading(tmp_path, topics={"color": "/camera/color"}))
    assert chosen.notes == (f"--topic says nothing of the folder {tmp_path}.",)
    (tmp_path / "classes.txt").write_text("dark\nred\n")
    source = open_source([str(tmp_path)], Reading(tmp_path))
    with pytest.raises(TrainingError, match=r"Pair 1 of .* with the label 2, but its class table has 2 classes"):
        join([source], source.classes, {}).pair(1)


def test_data_of_equal_names_and_sizes_but_other_contents_are_told_apart(tmp_path: Path) -> None:
    """Pairs rendered anew, and a label image painted over; a copy with other times stays the same."""
    prints = [_written(tmp_path / name, seed).fingerprint for name, seed in (("a", 0), ("b", 1), ("c", 0))]
    sizes = {(tmp_path / name / "0.npz").stat().st_size for name in "abc"}
    assert (len(sizes), prints[0] == prints[2], prints[0] != prints[1]) == (1, True, True)
    (tmp_path / "b" / "0.npz").write_bytes((tmp_path / "b" / "0.npz").read_bytes()[:-30])
    with pytest.raises(TrainingError, match=r"0.npz cannot be read .*render it anew"):
        _ = PairFolder(tmp_path / "b").fingerprint

    folder = _write_images(tmp_path / "images", write_walk(tmp_path / "walk.mcap", frames=3))
    image = next((folder / "labels").iterdir())
    _paint(image, 0)
    shutil.copytree(folder, tmp_path / "copy", copy_function=shutil.copyfile)
    first, copied = (open_source([str(x)], Reading(tmp_path)).pairs.fingerprint for x in (folder, tmp_path / "copy"))
    size = image.stat().st_size
    _paint(image, 1)
    painted = open_source([str(folder)], Reading(tmp_path)).pairs.fingerprint
    assert (image.stat().st_size, first == copied, first != painted) == (size, True, True)


def _paint(path: Path, label: int) -> None:
    """One pixel, in a file that is not compressed."""
    labels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert labels is not None
    labels[0, 0] = label
    cv2.imwrite(str(path), labels, [cv2.IMWRITE_PNG_COMPRESSION, 0])


def _written(folder: Path, seed: int) -> PairFolder:
    folder.mkdir()
    save_pair(folder / "0.npz", pair(seed))
    return PairFolder(folder)


def test_frames_are_decoded_anew_for_other_channels_or_another_table(tmp_path: Path) -> None:
    """Two cameras of one log have its sum, its stamps and its number of frames; a table may give ids other names."""
    log, cache = write_walk(tmp_path / "walk.mcap", second_camera=True), tmp_path / "cache"
    first, second = (
        open_source([str(log)], Reading(cache, topics={"color": topic})).pairs
        for topic in ("/camera/color", "/second/color")
    )
    assert first.fingerprint != second.fingerprint
    assert np.array_equal(second.pair(0).images, 255 - _opened(log, cache, None).pair(0).images)
    table = tmp_path / "table.json"
    table.write_text(json.dumps({"0": "wall", "2": "floor", "5": "door"}))
    own, other = _opened(log, cache, None).pair(0).labels, _opened(log, cache, table).pair(0).labels
    assert np.array_equal(np.array([0, NO_LABEL, 1, *[NO_LABEL] * 253], np.uint8)[own], other)


def _opened(log: Path, cache: Path, classes: Path | None) -> Pairs:
    return open_source([str(log)], Reading(cache, classes, topics={"color": "/camera/color"})).pairs


OFFICE = ClassSet(("office chair", "Desk", "stool", "wall"), ((1, 0, 0), (2, 0, 0), (3, 0, 0), (4, 0, 0)))


def test_class_maps() -> None:
    """Two become one, one is not learned, the rest stays; colours go along."""
    class_map = {"Office Chair": "chair", "stool": "chair", "wall": ""}
    classes = network_classes(OFFICE, class_map)
    assert classes == ClassSet(("chair", "Desk"), ((1, 0, 0), (2, 0, 0)))
    table = lookup(OFFICE, classes, class_map, "x")
    assert table[:4].tolist() == [0, 1, 0, NO_LABEL]
    assert (table[4:] == NO_LABEL).all()
    with pytest.raises(ClassTableError, match="names 'sofa'"):
        network_classes(OFFICE, {"sofa": "chair"})
    with pytest.raises(ClassTableError, match=r"first data does not have .*stool"):
        lookup(OFFICE, classes, {"wall": ""}, "b.mcap")


def test_a_class_map_that_leaves_nothing() -> None:
    """One sentence about the map, not about tables."""
    with pytest.raises(ClassTableError, match="leaves no class to learn"):
        network_classes(ClassSet(("floor", "wall")), {"floor": "", "wall": ""})


def test_class_map_files(tmp_path: Path) -> None:
    """Names to names."""
    path = tmp_path / "map.toml"
    for text, sentence in (("a = 1", "no class name for 'a'"), ("a = ", "not valid TOML")):
        path.write_text(text)
        with pytest.raises(ClassTableError, match=sentence):
            read_class_map(path)
    path.write_text('"office chair" = "chair"')
    assert read_class_map(path) == {"office chair": "chair"}


def test_data_is_joined_in_the_networks_ids(tmp_path: Path) -> None:
    """Two logs whose tables have another order: the same picture has the same labels."""
    logs = [write_walk(tmp_path / "a.mcap", frames=3), write_walk(tmp_path / "b.mcap", frames=4,
            names={0: "wall", 1: "door", 2: "FLOOR"})]  # fmt: skip
    sources = [open_source([str(log)], Reading(tmp_path / "cache")) for log in logs]
    classes = classes_of(sources, {})
    pairs = join(sources, classes, {})
    assert (classes.names, len(pairs)) == (("wall", "floor", "door"), 2 + 3)
    raw = sources[1].pairs.pair(0).labels
    expected = np.array([0, 2, 1, *[255] * 253], np.uint8)[raw]
    assert np.array_equal(pairs.pair(2).labels, expected)
    assert replace(sources[0], pairs=pairs).pairs.fingerprint != sources[0].pairs.fingerprint
