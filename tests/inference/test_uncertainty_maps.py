"""Maps of uncertainty from a graph: recognised, rounded, kept, and refused where they cannot be."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from stsem.errors import NetworkError
from stsem.frame import Frame, Segmentation
from stsem.inference.cache import CachedInferencer, OutputCache, pack, unpack
from stsem.inference.inferencer import Inferencer, Output
from stsem.inference.network import Network, load_network
from stsem.stages.segment import NetworkSegmenter
from stsem.uncertainty import MEASURES, Uncertainty, ceiling, to_levels, to_values

Files = Callable[..., Path]
FAINT = 20
"""A brightness that stays below the largest variance of three classes, 2 / 9."""


@pytest.fixture
def network(files: Files) -> Network:
    """Red is the variance, blue the mutual information."""
    return load_network(files("unsure"))


def _frame(red: int = FAINT, blue: int = 0, size: int = 12) -> Frame:
    image = np.zeros((size, 4 * size // 3, 3), np.uint8)
    image[: size // 2, :, 0], image[..., 1], image[..., 2] = red, 200, blue
    return Frame(0, 0, image)


def test_a_graph_says_which_maps_it_gives(network: Network, files: Files) -> None:
    """In the order of MEASURES, not of the file; a graph without any has none."""
    assert network.measures == ("variance", "mutual_information")
    assert load_network(files("labels")).measures == ()


def test_maps_come_at_the_size_of_the_image(network: Network) -> None:
    """Values come back to half a level of the fourth root, enlarged like the labels; the classes' ids play no part."""
    answer = Inferencer(network, threads=1).infer(_frame(blue=100, size=24))
    assert answer.uncertainty is not None
    assert answer.uncertainty.levels.shape == (2, 24, 32)
    variance = answer.uncertainty.values("variance")
    assert variance[:12] == pytest.approx(FAINT / 255, rel=4 * 0.5 / 140)
    assert not variance[12:].any()
    assert answer.uncertainty.values("mutual_information") == pytest.approx(100 / 255, rel=4 * 0.5 / 130)
    translated = NetworkSegmenter(Inferencer(network, threads=1), np.full(256, 7, np.uint8)).segment(_frame(blue=100))
    assert translated.uncertainty is not None
    assert (translated.labels == 7).all()


def test_a_graph_without_maps_gives_none(files: Files) -> None:
    assert Inferencer(load_network(files("labels")), threads=1).infer(_frame()).uncertainty is None


def test_the_cache_keeps_them(network: Network, tmp_path: Path) -> None:
    """Computed and read back, cold and warm: equal."""
    inferencer = Inferencer(network, threads=1)
    cached = CachedInferencer(inferencer, OutputCache(tmp_path / "c", "log", inferencer.identity))
    plain = inferencer.infer(_frame()).uncertainty
    for answer in (cached.infer(_frame()), cached.infer(_frame())):
        assert answer.uncertainty is not None
        assert plain is not None
        assert (answer.uncertainty.measures, answer.uncertainty.classes) == (plain.measures, 3)
        np.testing.assert_array_equal(answer.uncertainty.levels, plain.levels)


@pytest.mark.parametrize("measures", [MEASURES, MEASURES[1:2], ()])
def test_entries_hold_any_choice_of_measures(measures: tuple[str, ...]) -> None:
    labels, confidence, *maps = np.random.default_rng(0).integers(0, 256, (2 + len(measures), 5, 7)).astype(np.uint8)
    said = Uncertainty(measures, np.stack(maps), 200) if maps else None
    back = unpack(pack(Output(labels, confidence, said), 1), 1)
    assert back is not None
    if said is None:
        assert back.uncertainty is None
        return
    assert back.uncertainty is not None
    assert (back.uncertainty.measures, back.uncertainty.classes) == (measures, 200)
    np.testing.assert_array_equal(back.uncertainty.levels, said.levels)


def test_values_that_cannot_be_are_refused(network: Network) -> None:
    """A mean variance of three classes ends at 2 / 9."""
    with pytest.raises(
        NetworkError, match=r"returned 'variance' of shape \(12, 16\) from 0 to 0.35\d+; expected .* 0 to 0.2222"
    ):
        Inferencer(network, threads=1).infer(_frame(red=90))


def test_a_map_of_another_size_is_refused(files: Files) -> None:
    with pytest.raises(NetworkError, match=r"has '.*' as tensor\(float\) of shape"):
        load_network(files("unsure", 'size = [16, 13]\nmean = [0, 0, 0]\nstd = [1, 1, 1]\nclasses = ["a", "b", "c"]\n'))


@settings(max_examples=50, derandomize=True, deadline=None)
@given(values=arrays(np.float32, 20, elements=st.floats(0, 1, width=32)), measure=st.sampled_from(MEASURES),
       classes=st.integers(2, 255))  # fmt: skip
def test_levels_keep_the_order_and_read_back_equal(values: np.ndarray, measure: str, classes: int) -> None:
    """A larger value never gets a smaller level; a level stands for a value that has this level again."""
    values = values * np.float32(ceiling(measure, classes))
    levels = to_levels(values, measure, classes)
    assert (np.diff(levels[np.argsort(values)].astype(int)) >= 0).all()
    again = to_levels(to_values(levels, measure, classes).astype(np.float32), measure, classes)
    np.testing.assert_array_equal(again, levels)


@settings(max_examples=50, derandomize=True, deadline=None)
@given(samples=arrays(np.float64, (6, 5), elements=st.floats(0, 1)))
def test_no_sample_exceeds_the_ceilings(samples: np.ndarray) -> None:
    """Of six passes over five classes; one-hot passes that never agree come closest."""
    chances = (samples + 1e-9) / (samples + 1e-9).sum(axis=1, keepdims=True)
    mean = chances.mean(axis=0)
    assert ((chances - mean) ** 2).mean() <= ceiling("variance", 5) + 1e-9
    assert -(mean * np.log(mean)).sum() <= ceiling("entropy", 5) + 1e-9
    apart = np.eye(5)
    assert ((apart - apart.mean(axis=0)) ** 2).mean() == pytest.approx(ceiling("variance", 5))


def test_a_segmentation_cannot_be_changed() -> None:
    answer = Segmentation(np.zeros((2, 2), np.uint8))
    with pytest.raises(AttributeError):
        answer.uncertainty = None  # type: ignore[misc]
