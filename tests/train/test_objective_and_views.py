"""The loss by hand, and what random views keep true."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.classes import NO_LABEL
from stsem.errors import TrainingError
from stsem.models.network import Answers, SegmentationNetwork, SideAnswer
from stsem.train.augment import Augmentation, view
from stsem.train.dataset import Pair, PairFolder, class_shares, save_pair
from stsem.train.dropout import KeyedDropout, begin_iteration, key_dropout
from stsem.train.objective import Objective, class_weights

from .squares import SIZE, pair, write_squares

pytestmark = pytest.mark.torch
PLAIN = Augmentation(SIZE, stretch=0.0, mirror=False, light=False)


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


@pytest.mark.parametrize(("height", "width", "every_pixel"), [(5, 9, True), (3, 5, False)])
def test_an_answer_at_every_pixel_is_judged_at_every_pixel(height: int, width: int, every_pixel: bool) -> None:
    """By the phases of 5x9 labels: between the judged pixels a coarse answer is enlarged, a fine one would be free."""
    probabilities = torch.full((1, 2, height, width), 0.5, requires_grad=True)

    class Said(SegmentationNetwork):
        def answers(self, *inputs: torch.Tensor) -> Answers:
            return Answers(probabilities)

    Objective(torch.ones(2), fine=2)(Said(), [], torch.zeros(1, 5, 9, dtype=torch.int64)).backward()
    assert probabilities.grad is not None
    taught = probabilities.grad[0, 0] != 0
    assert taught.all()
    each = -2.0 / (45 if every_pixel else 15)
    assert probabilities.grad[0, 0].flatten().tolist() == pytest.approx([each] * (height * width), rel=1e-4)


def test_a_view_without_labels_teaches_nothing() -> None:
    """As when a crop lies beyond the image: the loss is 0, not a number that is none; weights count as in torch."""
    logits = torch.randn(2, 3, 5, 9, requires_grad=True)

    class Said(SegmentationNetwork):
        def answers(self, *inputs: torch.Tensor) -> Answers:
            return Answers(logits.softmax(1))

    labels, weights = torch.full((2, 5, 9), NO_LABEL), torch.tensor([0.5, 1.0, 2.0])
    loss = Objective(weights, fine=1)(Said(), [], labels)
    loss.backward()
    assert loss.item() == 0
    assert logits.grad is not None
    assert not logits.grad.any()
    labels[0, :3] = torch.arange(27).reshape(3, 9) % 3
    expected = torch.nn.functional.cross_entropy(logits, labels, weights, ignore_index=NO_LABEL)
    assert Objective(weights, fine=1)(Said(), [], labels).item() == pytest.approx(expected.item(), rel=1e-5)


def test_views_keep_image_and_labels_together() -> None:
    """Wherever a plain view shows pure colour, its label says so; the void around the image is not labelled."""
    for seed in range(10):
        seen = view(pair(3), replace(PLAIN, scales=(0.7, 1.5)), np.random.default_rng(seed))
        assert seen.current.shape == (SIZE[1], SIZE[0], 3)
        assert seen.labels.shape == (SIZE[1], SIZE[0])
        red, void = (seen.current == (220, 40, 40)).all(-1), (seen.current == 0).all(-1)
        assert (seen.labels[red] != 1).sum() <= 0.03 * red.sum()
        assert (seen.labels[void] != NO_LABEL).sum() <= 0.1 * void.sum()
        assert (seen.labels[~void] == NO_LABEL).sum() <= 0.03 * seen.labels.size


def test_views_of_the_paper_scale_the_image_itself() -> None:
    """A crop of 40x20 at scale 2 shows a quarter of 40x20 pixels of the image, wherever it is; void is the mean."""
    ramp = np.repeat(np.arange(96, dtype=np.uint8)[None, :, None], 52, 0).repeat(3, 2)
    ramped = Pair(np.stack([ramp, ramp]), np.zeros((2, 52, 96), np.uint8))
    how = replace(PLAIN, crop=(40, 20), scales=(2.0, 2.0), of_image=True)
    seen = view(ramped, how, np.random.default_rng(0)).current.astype(int)
    assert seen[0, -1, 0] - seen[0, 0, 0] == pytest.approx(19.5, abs=1)
    small = view(ramped, replace(how, scales=(0.1, 0.1), fill=(9, 8, 7)), np.random.default_rng(0))
    assert tuple(small.current[small.labels == NO_LABEL][0]) == (9, 8, 7)


def test_depth_moves_with_the_image() -> None:
    """The hole at the top stays unknown, the rest two metres, mirrored or not; labels lie likewise."""
    for seed in range(4):
        seen = view(pair(0, depth=True), replace(PLAIN, mirror=True, scales=(1.0, 1.0)), np.random.default_rng(seed))
        assert seen.depth is not None
        assert set(np.unique(seen.depth[np.isfinite(seen.depth)])) == {np.float32(2.0)}
        assert np.isnan(seen.depth[0]).all()
        assert np.isfinite(seen.depth[-1]).all()


def test_views_repeat() -> None:
    """The generator alone decides, lights and noise included."""
    one, other = (view(pair(1, depth=True), Augmentation(SIZE), np.random.default_rng(5)) for _ in range(2))
    assert all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
               for a, b in zip(vars(one).values(), vars(other).values(), strict=True))  # fmt: skip


def test_a_partner_is_never_the_current_frame() -> None:
    """A frame without truth serves as predecessor alone, whichever of the two it is."""
    both = pair(2)
    for alone in range(2):
        labels = both.labels.copy()
        labels[1 - alone] = NO_LABEL
        images = np.stack([np.full_like(both.images[0], 10), np.full_like(both.images[0], 200)])
        for seed in range(8):
            seen = view(Pair(images, labels), replace(PLAIN, scales=(1.0, 1.0), still=0.0), np.random.default_rng(seed))
            assert seen.current.max() == images[alone].max()
            assert seen.previous.max() == images[1 - alone].max()


def test_class_shares_and_weights(tmp_path: Path) -> None:
    """Shares sum to 1; the mean weight over pixels is 1; rarer means heavier; what the sample missed is learned."""
    assert class_shares(write_squares(tmp_path), 3).sum() == pytest.approx(1)
    weights = class_weights(np.array([0.9, 0.1, 0.0])).numpy()
    assert weights @ [0.9, 0.1, 0.0] == pytest.approx(1)
    assert weights[2] > weights[1] > weights[0]
    assert (class_weights(np.array([0.9, 0.1]), 0.0).numpy() == 1).all()
    with pytest.raises(TrainingError, match=r"label 2, but there are 2 classes"):
        class_shares(PairFolder(tmp_path), 2)


def test_a_folder_without_pairs_a_damaged_pair_and_no_labels(tmp_path: Path) -> None:
    """All are named."""
    with pytest.raises(TrainingError, match=r"no training pair"):
        PairFolder(tmp_path)
    blank = replace(pair(0), labels=np.full((2, 52, 96), NO_LABEL, np.uint8))
    save_pair(tmp_path / "a.npz", blank)
    with pytest.raises(TrainingError, match="No pixel"):
        class_shares(PairFolder(tmp_path), 3)
    data = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "a.npz").write_bytes(data[: len(data) // 2])
    with pytest.raises(TrainingError, match=r"a\.npz"):
        PairFolder(tmp_path).pair(0)


def test_depth_is_kept_in_millimetres(tmp_path: Path) -> None:
    """Known stays known to half a millimetre, unknown unknown."""
    save_pair(tmp_path / "a.npz", pair(0, depth=True))
    depths = PairFolder(tmp_path).pair(0).depths
    assert depths is not None
    np.testing.assert_allclose(depths, pair(0, depth=True).depths, atol=5e-4)


def test_dropout_by_key() -> None:
    """The share of torch's layer, whole channels where it drops those, and the same mask for the same key only."""
    layers = torch.nn.ModuleDict({"flat": torch.nn.Dropout(0.3), "whole": torch.nn.Dropout2d(0.3)})
    network = SegmentationNetwork()
    network.add_module("layers", layers)
    key_dropout(network)
    assert not network.state_dict()
    x = torch.ones(8, 64, 5, 5)
    begin_iteration(network, 1, 7, 0)
    flat, whole = (network.get_submodule(f"layers.{name}") for name in ("flat", "whole"))
    assert isinstance(flat, KeyedDropout)
    first, channels = flat(x), whole(x)
    assert (first == 0).float().mean().item() == pytest.approx(0.3, abs=0.02)
    assert first.mean().item() == pytest.approx(1, abs=0.03)
    assert ((channels == 0).all((2, 3)) | (channels > 0).all((2, 3))).all()
    assert not torch.equal(flat(x), first)
    begin_iteration(network, 1, 7, 0)
    assert torch.equal(flat(x), first)
    begin_iteration(network, 1, 8, 0)
    assert not torch.equal(flat(x), first)
    network.eval()
    assert torch.equal(flat(x), x)
