"""Every network of the zoo keeps the contract of stsem/models/network.py; test_zoo_replay.py exports and replays it."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from stsem.errors import UsageError
from stsem.models.network import CHANNELS, SegmentationNetwork
from stsem.models.zoo import ALIASES, ZOO, build
from stsem.train.objective import Objective

pytestmark = pytest.mark.torch
CLASSES = 5
ODD = (97, 67)
"""Width and height that divide by nothing."""


def _network(name: str) -> SegmentationNetwork:
    torch.manual_seed(1)
    return build(f"{name}-w1", CLASSES)


def _inputs(network: SegmentationNetwork, size: tuple[int, int], batch: int = 1) -> dict[str, np.ndarray]:
    """Noise; depth is positive with holes. The image is always there."""
    rng = np.random.default_rng(0)
    made = {name: rng.normal(size=(batch, CHANNELS[name], size[1], size[0])).astype(np.float32)
            for name in dict.fromkeys(("image", *network.inputs))}  # fmt: skip
    if "depth" in made:
        made["depth"] = np.maximum(made["depth"] + 1, 0)
    return made


@pytest.mark.parametrize("name", ZOO)
def test_gradients_reach_every_weight(name: str) -> None:
    """The loss of one batch of odd size; the answers are those of `forward`, and they are probabilities."""
    network = _network(name)
    inputs = [torch.from_numpy(_inputs(network, ODD, batch=3)[key]) for key in network.inputs]
    with torch.no_grad():
        given = network.eval()(*inputs)
        answers = network.answers(*inputs)
    assert given.dtype == torch.float32
    assert given.shape[:2] == (3, CLASSES)
    assert torch.allclose(given.sum(1), torch.ones(()), atol=1e-5)
    assert given.min() >= 0
    assert torch.allclose(answers.probabilities, given, atol=1e-5)
    labels = torch.from_numpy(np.random.default_rng(1).integers(CLASSES, size=(3, ODD[1], ODD[0])))
    loss = Objective(torch.ones(CLASSES))(network.train(), inputs, labels)
    loss.backward()
    without = [key for key, p in network.named_parameters() if p.requires_grad and (p.grad is None or not p.grad.any())]
    assert not without
    assert torch.isfinite(loss)


@pytest.mark.parametrize("name", ZOO)
def test_every_row_is_complete(name: str) -> None:
    """A paper to read, inputs there are, and a good side near every side; test_networks_doc.py counts sizes."""
    row = ZOO[name]
    assert all((row.paper.authors, row.paper.title, row.paper.figure))
    with torch.device("meta"):
        network = build(f"{name}-w1", 13)
    assert set(network.inputs) <= CHANNELS.keys()
    for side in (1, 96, 97, 270, 473):
        assert network.fits(network.nearest_side(side))


def test_names() -> None:
    """Widths at the end; a wrong name lists the right ones; earlier names are still good."""
    with torch.device("meta"):
        for name in ("pspnet-r50", "pspnet-r18-w4", "pspnet-r18-w4-w2", "pspnet-r18-w6-w4", "pspnet-r18-spatial"):
            build(name, 13)
    assert set(ALIASES.values()) <= ZOO.keys()
    with pytest.raises(UsageError, match=r"no architecture 'pspnet'; choose one of pspnet-r18"):
        build("pspnet", 13)
    for name in ("pspnet-r18-spatial-w4-w2", "pspnet-r18-w0", "pspnet-r18-w4-w2-w1"):
        with pytest.raises(UsageError, match=r"takes at most"):
            build(name, 13)
