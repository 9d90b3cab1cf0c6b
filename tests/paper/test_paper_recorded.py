"""Recorded data: Cityscapes' folders and labelled logs become small pairs, training and test apart."""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from bench.paper import recorded
from bench.paper.data import find_data
from stsem.classes import NO_LABEL
from stsem.convert.cityscapes import LABEL_IDS
from stsem.errors import UsageError
from stsem.synth.vocabulary import OFFICE
from stsem.train.dataset import PairFolder

ROOT = Path(__file__).resolve().parents[2]
IMAGE = "leftImg8bit_sequence/{split}/{city}/{city}_000000_{frame:06}_leftImg8bit.png"
LABELS = "gtFine/{split}/{city}/{city}_000000_{frame:06}_gtFine_labelIds.png"


def _say(_: str) -> None: ...


def _write(path: Path, pixels: npt.NDArray[np.uint8]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), pixels[..., ::-1] if pixels.ndim == 3 else pixels)


def _snippet(root: Path, split: str, city: str, frames: tuple[int, ...] = (18, 19)) -> npt.NDArray[np.uint8]:
    """Frames of flat colour with the frame's number in it, and the 20th labelled with every id in turn."""
    for frame in frames:
        _write(
            root / IMAGE.format(split=split, city=city, frame=frame), np.full((32, 64, 3), (10, 20, frame), np.uint8)
        )
    ids = (np.arange(32 * 64) % 34).reshape(32, 64).astype(np.uint8)
    _write(root / LABELS.format(split=split, city=city, frame=19), ids)
    return ids


def test_cityscapes_folders(tmp_path: Path) -> None:
    """`train` and `val` become training and test; the frame before is the partner; ids become the 19 classes."""
    ids = _snippet(tmp_path / "source", "train", "aachen")
    _snippet(tmp_path / "source", "val", "lindau")
    _snippet(tmp_path / "source", "train", "bochum", frames=(19,))  # nothing before it: left out
    data = find_data(f"cityscapes={tmp_path / 'source'}", tmp_path / "out", tmp_path)
    data.prepare(_say)
    assert data.names() == ["aachen_000000_000019"]
    assert len(data.pairs("test")) == 1
    pair = data.pairs("train").pair(0)
    assert [tuple(image[0, 0]) for image in pair.images] == [(10, 20, 18), (10, 20, 19)]
    assert pair.labelled == (1,)
    for raw in range(34):
        expected = LABEL_IDS.index(raw) if raw in LABEL_IDS else NO_LABEL
        assert set(pair.labels[1][ids == raw]) == {expected}


def test_large_images_are_reduced_with_their_labels(tmp_path: Path) -> None:
    """2:1 at four times the kept width; each label of a 4x4 block is that of the block."""
    image = np.kron(np.arange(288, dtype=np.uint8)[None], np.ones((4, 4), np.uint8)).repeat(144, 0)[:576]
    labels = (image % 19).astype(np.uint8)
    recorded.save(tmp_path, "a", *2 * [np.stack([image] * 3, 2)], labels)
    pair = PairFolder(tmp_path).pair(0)
    assert pair.images.shape == (2, 144, 288, 3)
    np.testing.assert_array_equal(pair.labels[1] % 19, pair.images[1, ..., 0] % 19)


def test_a_folder_without_pairs_is_refused(tmp_path: Path) -> None:
    """And so is a label image that is none."""
    with pytest.raises(UsageError, match="no labelled pair of frames for train and test"):
        recorded.from_cityscapes(tmp_path, tmp_path / "out", _say)
    _snippet(tmp_path, "train", "aachen")
    (tmp_path / LABELS.format(split="train", city="aachen", frame=19)).write_bytes(b"no image")
    with pytest.raises(UsageError, match="cannot be read"):
        recorded.from_cityscapes(tmp_path, tmp_path / "out", _say)


def test_a_log_is_split_in_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Training before the gap, test behind it, each labelled frame with the one before it."""
    monkeypatch.setattr(recorded, "CAMVID", OFFICE)
    recorded.from_log(ROOT / "logs" / "tiny-a.mcap", tmp_path, _say)
    train, test = (sorted(int(path.stem) for path in (tmp_path / which).glob("*.npz")) for which in ("train", "test"))
    assert train == list(range(1, 18))
    assert test == list(range(23, 30))  # of 30 frames: the last quarter
    pairs = PairFolder(tmp_path / "train")
    for k in range(len(pairs) - 1):
        np.testing.assert_array_equal(pairs.pair(k).images[1], pairs.pair(k + 1).images[0])
        assert pairs.pair(k).labelled == (1,)


@pytest.mark.shared_logs
def test_camvid(tmp_path: Path, shared_logs: Path) -> None:
    """The real log: 60 frames to learn from, 25 to be judged on, all eleven classes."""
    data = find_data(f"camvid={shared_logs / 'camvid-0016E5-15hz.mcap'}", tmp_path, tmp_path)
    data.prepare(_say)
    assert (len(data.pairs("train")), len(data.pairs("test"))) == (60, 25)
    seen = np.unique(np.stack([data.pairs("train").pair(k).labels[1] for k in range(60)]))
    assert set(seen) == {*range(11), NO_LABEL}


@pytest.mark.parametrize(("given", "words"), [("kitti", "no data set 'kitti'"), ("camvid", "camvid=PATH")])
def test_data_that_is_not_at_hand(tmp_path: Path, given: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        find_data(given, tmp_path, tmp_path)
