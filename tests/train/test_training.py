"""Training: it learns, a stopped one goes on exactly, and what it publishes is what a user loads."""

import resource
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.errors import NetworkError, OutputError, TrainingError, TrainingStoppedError
from stsem.frame import Frame
from stsem.inference.inferencer import Inferencer
from stsem.train.checkpoint import read_checkpoint, write_checkpoint
from stsem.train.curves import read_csv
from stsem.train.dataset import PairFolder
from stsem.train.job import Job, Machine
from stsem.train.judge import judge
from stsem.train.publish import load_checkpoint, publish
from stsem.train.stages import Progress, train_stage

from .squares import SCRATCH, SIDECAR, pair, short, write_squares

pytestmark = pytest.mark.torch
SPATIAL = Job("pspnet-r18-spatial-w1", "colour", SIDECAR, SCRATCH, seed=3)


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> PairFolder:
    """Twelve pairs on disk."""
    return write_squares(tmp_path_factory.mktemp("pairs"))


@pytest.fixture(scope="module")
def whole(pairs: PairFolder, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The checkpoint of eight iterations at once."""
    return train_stage(SPATIAL, pairs, None, tmp_path_factory.mktemp("whole"), lambda _: None)


def test_it_learns_and_what_it_publishes_works(pairs: PairFolder, tmp_path: Path) -> None:
    """From noise to most pixels right in 40 small steps, through ONNX and the user's loader."""
    reports: list[Progress] = []
    recipe = replace(short(SCRATCH, 40), report_every=10, validate_every=100)
    job = Job("pspnet-r18-spatial-w2", "colour", SIDECAR, recipe)
    checkpoint = train_stage(job, pairs, pairs, tmp_path / "stage", reports.append)
    assert [r.iteration for r in reports] == [10, 20, 30, 40]
    assert reports[-1].loss < 0.6 * reports[0].loss
    assert reports[-2].validation is None
    network = load_checkpoint(checkpoint, 3)
    scores = judge(network, SIDECAR, pairs).compute()
    assert reports[-1].validation == (scores.miou, scores.pixel_accuracy)
    test = pair(99)
    published = publish(network, SIDECAR.for_inputs(network.inputs), tmp_path / "net.onnx")
    answer = Inferencer(published, threads=1).infer(Frame(1, 1, test.images[1], previous=test.images[0]))
    assert (answer.labels == test.labels[1]).mean() > 0.8


@pytest.mark.parametrize("stops", [(5,), (1, 4, 7)])
def test_a_stopped_training_goes_on_exactly(
    pairs: PairFolder, whole: Path, tmp_path: Path, stops: tuple[int, ...]
) -> None:
    """Stopped here and there and continued, with two workers and dropout: the same weights bit for bit, and losses."""
    for before, stop in pairwise((0, *stops)):
        reached = iter(range(before + 1, 100))
        with pytest.raises(TrainingStoppedError, match=f"after {stop} of 8"):
            train_stage(SPATIAL, pairs, None, tmp_path, lambda _: None, partial(_reaches, reached, stop))
    again = train_stage(SPATIAL, pairs, None, tmp_path, lambda _: None)
    _assert_same(whole, again)
    assert (tmp_path / "curves.csv").read_bytes() == whole.with_name("curves.csv").read_bytes()


def _reaches(reached: Iterator[int], stop: int) -> bool:
    return next(reached) == stop


def _assert_same(one: Path, other: Path) -> None:
    a, b = read_checkpoint(one), read_checkpoint(other)
    assert a["losses"] == b["losses"]
    assert all(torch.equal(a[part][key], b[part][key]) for part in ("network", "mean") for key in a[part])


def test_a_finished_one_is_left_alone(pairs: PairFolder, whole: Path) -> None:
    """Nothing is trained or written again."""
    data = whole.read_bytes()
    assert train_stage(SPATIAL, pairs, None, whole.parent, lambda _: pytest.fail("trained")) == whole
    assert whole.read_bytes() == data


def test_weights_depend_on_the_seed_and_on_nothing_else(pairs: PairFolder, whole: Path, tmp_path: Path) -> None:
    """Global random numbers, validation and reporting change nothing; another seed changes the weights."""
    torch.manual_seed(99)
    often = replace(SPATIAL, recipe=replace(SCRATCH, report_every=1, validate_every=3, checkpoint_every=3))
    same = train_stage(often, pairs, pairs, tmp_path / "same", lambda _: torch.rand(3))
    _assert_same(whole, same)
    other = train_stage(replace(SPATIAL, seed=4), pairs, None, tmp_path / "other", lambda _: None)
    assert read_checkpoint(whole)["losses"] != read_checkpoint(other)["losses"]


@pytest.mark.parametrize(("change", "what"), [
    ({"seed": 9}, "the seed is 9, not"),
    ({"recipe": short(SCRATCH, 9)}, r"the recipe has iterations 9, not iterations \d+"),
    ({"recipe": replace(SCRATCH, crop=(41, 89), still=1.0)}, r"the recipe has crop \(41, 89\), not crop .*, still 1.0"),
    ({"machine": Machine(workers=1)}, "device, workers or precision differ"),
    ({"architecture": "pspnet-r18-spatial-w2"}, "the architecture is pspnet-r18-spatial-w2, not"),
    ({"sidecar": replace(SIDECAR, mean=(0.4,) * 3)}, "classes or forms of the inputs differ"),
])  # fmt: skip
def test_another_training_is_not_continued(
    pairs: PairFolder, whole: Path, change: dict[str, object], what: str
) -> None:
    """What differs is named."""
    with pytest.raises(TrainingError, match=f"of another training: {what}"):
        train_stage(replace(SPATIAL, **change), pairs, None, whole.parent, lambda _: None)  # type: ignore[arg-type]


def test_other_pairs_and_broken_checkpoints_are_refused(whole: Path, tmp_path: Path) -> None:
    """Also a file that is no checkpoint, and one of other classes."""
    few = write_squares(tmp_path / "few", 2)
    with pytest.raises(TrainingError, match="another training: the data differ"):
        train_stage(SPATIAL, few, None, whole.parent, lambda _: None)
    for name, content in (("text", b"no checkpoint"), ("half", whole.read_bytes()[:5000])):
        bad = tmp_path / name
        bad.mkdir()
        (bad / "checkpoint.pt").write_bytes(content)
        with pytest.raises(TrainingError, match="missing or damaged"):
            train_stage(SPATIAL, few, None, bad, lambda _: None)
    write_checkpoint(tmp_path / "plain.pt", {"epoch": 1})
    with pytest.raises(TrainingError, match="holds no checkpoint"):
        read_checkpoint(tmp_path / "plain.pt")
    with pytest.raises(NetworkError, match="5 classes"):
        load_checkpoint(whole, 5)


def test_a_checkpoint_of_an_earlier_version_can_be_published(whole: Path, tmp_path: Path) -> None:
    """Architecture and averaged weights are all that it needs; it is not gone on with."""
    path = tmp_path / "checkpoint.pt"
    write_checkpoint(path, {"architecture": SPATIAL.architecture, "mean": read_checkpoint(whole)["mean"]})
    old, new = (load_checkpoint(given, 3).state_dict() for given in (path, whole))
    assert all(torch.equal(old[name], new[name]) for name in new)
    with pytest.raises(TrainingError, match="of another training"):
        train_stage(SPATIAL, write_squares(tmp_path / "pairs", 2), None, tmp_path, lambda _: None)


def test_a_full_disk_keeps_the_checkpoint_before(whole: Path, tmp_path: Path) -> None:
    """Files limited to 100 kB stand for the disk."""
    path = tmp_path / "checkpoint.pt"
    write_checkpoint(path, {"architecture": "a", "mean": {}, "old": True})
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
    try:
        with pytest.raises(OutputError, match="cannot be written"):
            write_checkpoint(path, {"architecture": "a", "mean": {"x": torch.zeros(100_000)}})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert read_checkpoint(path)["old"] is True
    assert [file.name for file in tmp_path.iterdir()] == ["checkpoint.pt"]


def test_the_curves_are_the_losses(pairs: PairFolder, whole: Path) -> None:
    """A row every two iterations, each the mean of its two; the rate of the last."""
    losses, rows = read_checkpoint(whole)["losses"], read_csv(whole.with_name("curves.csv"))
    assert [row.iteration for row in rows] == [2, 4, 6, 8]
    for k, row in enumerate(rows):
        assert row.loss == pytest.approx((losses[2 * k] + losses[2 * k + 1]) / 2, abs=1e-6)
        assert row.rate == pytest.approx(SCRATCH.rate_at(2 * k + 1), rel=1e-5)


def test_a_diverging_training_says_so(pairs: PairFolder, tmp_path: Path) -> None:
    """Instead of going on with numbers that are none."""
    wild = replace(SPATIAL, recipe=replace(short(SCRATCH, 30), optimiser="sgd", rate=1e20, clip=0.0))
    with pytest.raises(TrainingError, match="diverges"):
        train_stage(wild, pairs, None, tmp_path, lambda _: None)


def test_bfloat16_repeats(pairs: PairFolder, tmp_path: Path) -> None:
    """Two workers with casts of their own, and an input of several scales that uses every weight more than once."""
    job = replace(
        SPATIAL,
        architecture="deeplab-v2-w1",
        machine=Machine(bf16=True),
        recipe=replace(short(SCRATCH, 2), crop=(41, 41)),
    )
    one, other = (train_stage(job, pairs, None, tmp_path / name, lambda _: None) for name in ("a", "b"))
    _assert_same(one, other)
