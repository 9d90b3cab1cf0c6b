"""The cache of outputs: what is kept comes back bit for bit, and what does not fit is ignored."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.errors import OutputError
from stsem.frame import Frame
from stsem.inference.cache import CachedInferencer, OutputCache, cache_root, checksum, clear, pack, unpack, usage
from stsem.inference.inferencer import Inferencer, Output
from stsem.inference.network import load_network

Files = Callable[..., Path]
SIDECAR = 'size = [16, 12]\nmean = [0.0, 0.0, 0.0]\nstd = [1.0, 1.0, 1.0]\nclasses = ["red", "green", "blue"]\n'
RNG = np.random.default_rng(0)


def _frame(index: int, seed: int = 0) -> Frame:
    rng = np.random.default_rng([seed, index])
    image, previous = rng.integers(0, 256, (2, 24, 32, 3)).astype(np.uint8)
    return Frame(index, 100 * index, image, previous=previous)


def _output(width: int = 16, height: int = 12) -> Output:
    labels, confidence = RNG.integers(0, 13, (2, height, width)).astype(np.uint8)
    return Output(labels, confidence)


class _Counting(Inferencer):
    calls = 0

    def compute(self, frame: Frame) -> Output:
        self.calls += 1
        return super().compute(frame)


@pytest.fixture
def inferencer(files: Files) -> _Counting:
    """A network that counts its runs."""
    return _Counting(load_network(files()), threads=1)


def test_cold_and_warm_runs_give_the_same(inferencer: _Counting, tmp_path: Path) -> None:
    """Uncached, cold and warm answers are equal, and the warm one costs no run."""
    cached = CachedInferencer(inferencer, OutputCache(tmp_path / "c", "log", inferencer.identity))
    frame = _frame(3)
    plain = inferencer.infer(frame)
    cold, warm = cached.infer(frame), cached.infer(frame)
    assert inferencer.calls == 2
    for answer in (cold, warm):
        assert np.array_equal(answer.labels, plain.labels)
        assert answer.confidence is not None
        assert plain.confidence is not None
        assert np.array_equal(answer.confidence, plain.confidence)


def test_a_damaged_entry_is_written_anew(inferencer: _Counting, tmp_path: Path) -> None:
    """Any one damaged byte of an entry is seen; the next run mends it."""
    cache = OutputCache(tmp_path / "c", "log", inferencer.identity)
    cached = CachedInferencer(inferencer, cache)
    frame = _frame(1)
    good = cached.infer(frame)
    entry = cache.folder / f"{frame.stamp_ns}.seg"
    whole = entry.read_bytes()
    for damaged in (b"", whole[:10], whole[:-1], whole[:40] + bytes([whole[40] ^ 1]) + whole[41:]):
        entry.write_bytes(damaged)
        assert np.array_equal(cached.infer(frame).labels, good.labels)
        assert entry.read_bytes() == whole
    assert inferencer.calls == 5


def test_other_pixels_under_one_stamp_are_computed(inferencer: _Counting, tmp_path: Path) -> None:
    """Two cameras of a log may share a stamp; neither gets the other's labels."""
    cached = CachedInferencer(inferencer, OutputCache(tmp_path / "c", "log", inferencer.identity))
    for seed in (0, 1):
        frame = _frame(1, seed)
        assert np.array_equal(cached.infer(frame).labels, inferencer.infer(frame).labels)


def test_the_key_covers_log_network_and_machine(inferencer: _Counting, tmp_path: Path) -> None:
    """Each part of the identity leads to another folder."""
    identity = inferencer.identity
    others = [
        replace(identity, backend="x"), replace(identity, versions={"onnxruntime": "0"}),
        replace(identity, precision="bf16"), replace(identity, cpu_features=("z80",)),
        replace(identity, model_sha256="0"),
    ]  # fmt: skip
    folders = {OutputCache(tmp_path, "log", each).folder for each in (identity, *others)}
    folders.add(OutputCache(tmp_path, "other log", identity).folder)
    assert len(folders) == 7


@settings(max_examples=30, derandomize=True)
@given(width=st.integers(1, 40), height=st.integers(1, 40), source=st.integers(0, 2**32 - 1))
def test_entries_keep_every_value(width: int, height: int, source: int) -> None:
    """Packing and unpacking is the identity; another source is not accepted."""
    output = _output(width, height)
    back = unpack(pack(output, source), source)
    assert back is not None
    assert np.array_equal(back.labels, output.labels)
    assert np.array_equal(back.confidence, output.confidence)
    assert unpack(pack(output, source), source ^ 1) is None


@settings(max_examples=100, derandomize=True)
@given(st.binary(max_size=80))
def test_arbitrary_bytes_are_no_entry(data: bytes) -> None:
    """Nothing but None comes from bytes that `pack` did not make."""
    assert unpack(data, 0) is None
    assert unpack(b"stsem-o2" + data, 0) is None


@pytest.mark.parametrize(("kind", "sections", "looks_at"), [
    ("labels", "", {"image"}), ("difference", "[difference]\n", {"image", "previous"}),
    ("depth", "[depth]\n", {"image", "depth"}),
])  # fmt: skip
def test_the_checksum_sees_what_the_network_sees(files: Files, kind: str, sections: str, looks_at: set[str]) -> None:
    """One changed value of an input, or a missing one, changes it; what is loaded for others does not."""
    network = load_network(files(kind, SIDECAR + sections))
    frame = replace(_frame(0), depth=np.full((24, 32), 2, np.float32))
    sums = {checksum(frame, network)}
    for part in ("image", "previous", "depth"):
        changed = getattr(frame, part).copy()
        changed.flat[5] += 1
        lacking = () if part == "image" else (replace(frame, **{part: None}),)
        others = {checksum(other, network) for other in (replace(frame, **{part: changed}), *lacking)}
        assert others.isdisjoint(sums) == (part in looks_at), part
        sums |= others
    swapped = replace(frame, image=frame.previous, previous=frame.image)
    assert checksum(swapped, network) not in sums


def test_usage_and_clear(inferencer: _Counting, tmp_path: Path) -> None:
    """Everything is counted; network outputs and cost profiles are removed, files of others stay."""
    root = tmp_path / "c"
    assert usage(root).files == 0
    cached = CachedInferencer(inferencer, OutputCache(root, "log", inferencer.identity))
    for index in range(3):
        cached.infer(_frame(index))
    (root / "costs").mkdir()
    (root / "costs" / "profile.json").write_text("{}")
    (root / "mine.txt").write_text("mine")
    assert usage(root).files == 6  # three entries, about.json, the profile, and a file of somebody else
    removed = clear(root)
    assert (removed.files, usage(root).files, usage(root).bytes) == (5, 1, 4)
    assert clear(root).files == 0


def test_a_folder_that_cannot_be_made(inferencer: _Counting, tmp_path: Path) -> None:
    """A file in the way is an error that names the folder and the ways out."""
    (tmp_path / "c").write_text("in the way")
    with pytest.raises(OutputError, match="STSEM_CACHE to another, or use --no-cache"):
        OutputCache(tmp_path / "c", "log", inferencer.identity)


def test_the_root_follows_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """`STSEM_CACHE` wins over the platform's folder."""
    monkeypatch.setenv("STSEM_CACHE", str(tmp_path))
    assert cache_root() == tmp_path
    monkeypatch.delenv("STSEM_CACHE")
    assert cache_root().name == "stsem"
