"""Training: it learns, a stopped one goes on exactly, and what it publishes is what a user loads."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.classes import NO_LABEL, ClassSet
from stsem.errors import NetworkError, TrainingError
from stsem.frame import Frame
from stsem.inference.inferencer import Inferencer
from stsem.inference.sidecar import Difference, Sidecar
from stsem.models.network import Answers, SegmentationNetwork, SideAnswer
from stsem.train.augment import Augmentation, view
from stsem.train.dataset import Pair, PairFolder, class_shares, save_pair
from stsem.train.loop import Progress, Schedule, Training
from stsem.train.objective import Objective, class_weights
from stsem.train.publish import load_checkpoint, publish

pytestmark = pytest.mark.torch
SIZE = (89, 41)
SIDECAR = Sidecar(SIZE, (0.5,) * 3, (0.25,) * 3, ClassSet(("dark", "red", "green")), Difference(4.0))


def _pair(seed: int) -> Pair:
    """Squares of pure colour on a dark ground; the second frame is the first moved by two pixels."""
    rng = np.random.default_rng(seed)
    image, labels = np.full((52, 96, 3), 30, np.uint8), np.zeros((52, 96), np.uint8)
    for _ in range(6):
        label, x, y = int(rng.integers(1, 3)), int(rng.integers(80)), int(rng.integers(36))
        image[y : y + 16, x : x + 16] = (220, 40, 40) if label == 1 else (40, 220, 40)
        labels[y : y + 16, x : x + 16] = label
    return Pair(np.stack([image, np.roll(image, 2, 1)]), np.stack([labels, np.roll(labels, 2, 1)]))


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> PairFolder:
    """Twelve pairs on disk."""
    folder = tmp_path_factory.mktemp("pairs")
    for i in range(12):
        save_pair(folder / f"{i:02}.npz", _pair(i))
    return PairFolder(folder)


def _training(iterations: int) -> Training:
    schedule = Schedule(iterations, batch=4, rate=5e-3, warm_up=4, average=0.9, checkpoint_every=4)
    objective = Objective(class_weights(np.array([0.6, 0.2, 0.2])))
    return Training("pspnet-r18-w2-w1", SIDECAR, objective, Augmentation(SIZE, (1.0, 1.2)), schedule)


def test_it_learns_and_what_it_publishes_works(pairs: PairFolder, tmp_path: Path) -> None:
    """From noise to most pixels right in 40 small steps, through checkpoint, ONNX and the user's own loader."""
    reports: list[Progress] = []
    training = _training(40)
    training.run(pairs, tmp_path / "c.pt", reports.append, every=10)
    assert [r.iteration for r in reports] == [10, 20, 30, 40]
    assert reports[-1].loss < 0.6 * reports[0].loss
    network = publish(load_checkpoint(tmp_path / "c.pt", 3), SIDECAR, tmp_path / "net.onnx")
    test = _pair(99)
    answer = Inferencer(network, threads=1).infer(Frame(1, 1, test.images[1], previous=test.images[0]))
    assert (answer.labels == test.labels[1]).mean() > 0.8


def test_a_stopped_training_goes_on_exactly(pairs: PairFolder, tmp_path: Path) -> None:
    """Eight iterations at once, and four, killed at five, continued from four: the same weights, bit for bit."""
    whole = _training(8)
    whole.run(pairs, tmp_path / "whole.pt", lambda _: None)

    class KilledError(Exception): ...

    def kill(progress: Progress) -> None:
        if progress.iteration == 5:
            raise KilledError

    with pytest.raises(KilledError):
        _training(8).run(pairs, tmp_path / "part.pt", kill, every=1)
    again = _training(8)
    again.resume(tmp_path / "part.pt")
    assert again.iteration == 4
    again.run(pairs, tmp_path / "part.pt", lambda _: None)
    one, other = (load_checkpoint(tmp_path / f"{name}.pt", 3).state_dict() for name in ("whole", "part"))
    assert all(torch.equal(one[key], other[key]) for key in one)


def test_another_training_is_not_continued(pairs: PairFolder, tmp_path: Path) -> None:
    """Other numbers are refused by `resume`; their weights may start a new one."""
    _training(1).run(pairs, tmp_path / "c.pt", lambda _: None)
    with pytest.raises(TrainingError, match="of another training"):
        _training(2).resume(tmp_path / "c.pt")
    _training(2).start_from(tmp_path / "c.pt")
    (tmp_path / "bad.pt").write_bytes(b"no checkpoint")
    with pytest.raises(TrainingError, match="missing or damaged"):
        _training(1).resume(tmp_path / "bad.pt")
    with pytest.raises(NetworkError, match="5 classes"):
        load_checkpoint(tmp_path / "c.pt", 5)


def test_a_network_whose_inputs_the_pairs_do_not_give_is_refused() -> None:
    """A difference that the sidecar does not describe."""
    still = replace(SIDECAR, difference=None)
    objective = Objective(torch.ones(3))
    with pytest.raises(TrainingError, match=r"takes .difference., which these pairs and sidecar do not"):
        Training("pspnet-r18-temporal-w1", still, objective, Augmentation(SIZE), Schedule(1))
    Training("pspnet-r18-spatial-w1", still, objective, Augmentation(SIZE), Schedule(1))


def test_side_answers_are_judged_on_their_own_grid() -> None:
    """By hand: one pixel in four of 5x9 labels, the corners those of the grid; an enlarged one counts as the answer."""
    labels = torch.arange(45).reshape(1, 5, 9) % 3
    logits = torch.randn(1, 3, 3, 5, generator=torch.Generator().manual_seed(0))
    p = logits.softmax(1)

    class Said(SegmentationNetwork):
        def answers(self, *inputs: torch.Tensor) -> Answers:
            return Answers(p, (SideAnswer(logits, 0.4), SideAnswer(logits, 0.5, enlarged=True)))

    at_grid = torch.nn.functional.cross_entropy(logits, labels[:, ::2, ::2])
    assert Objective(torch.ones(3))(Said(), [], labels).item() == pytest.approx(1.9 * at_grid.item(), rel=1e-5)


def test_views_keep_image_and_labels_together() -> None:
    """Wherever a plain view shows pure colour, its label says so; the void around the image is not labelled."""
    pair = _pair(3)
    for seed in range(10):
        seen = view(pair, Augmentation(SIZE, (0.7, 1.5), plain=True), np.random.default_rng(seed))
        assert seen.current.shape == (SIZE[1], SIZE[0], 3)
        assert seen.labels.shape == (SIZE[1], SIZE[0])
        red, void = (seen.current == (220, 40, 40)).all(-1), (seen.current == 0).all(-1)
        assert (seen.labels[red] != 1).sum() <= 0.03 * red.sum()
        assert (seen.labels[void] != NO_LABEL).sum() <= 0.1 * void.sum()
        assert (seen.labels[~void] == NO_LABEL).sum() <= 0.03 * seen.labels.size


def test_views_repeat() -> None:
    """The generator alone decides, lights and noise included."""
    how = Augmentation(SIZE)
    one, other = (view(_pair(1), how, np.random.default_rng(5)) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(vars(one).values(), vars(other).values(), strict=True))


def test_class_shares_and_weights(pairs: PairFolder) -> None:
    """Shares sum to 1; the mean weight over pixels is 1; rarer means heavier; absent means nothing."""
    shares = class_shares(pairs, 3)
    assert shares.sum() == pytest.approx(1)
    weights = class_weights(np.array([0.9, 0.1, 0.0])).numpy()
    assert weights @ [0.9, 0.1, 0.0] == pytest.approx(1)
    assert weights[1] > weights[0]
    assert weights[2] == 0


def test_a_folder_without_pairs_and_a_damaged_pair(tmp_path: Path) -> None:
    """Both name the path."""
    with pytest.raises(TrainingError, match=r"no training pair"):
        PairFolder(tmp_path)
    save_pair(tmp_path / "a.npz", _pair(0))
    data = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "a.npz").write_bytes(data[: len(data) // 2])
    with pytest.raises(TrainingError, match=r"a\.npz"):
        PairFolder(tmp_path).pair(0)
