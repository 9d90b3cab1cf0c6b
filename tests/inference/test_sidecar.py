"""The sidecar: what it reads back, and the sentences for what it cannot read."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.classes import ClassSet
from stsem.errors import NetworkError
from stsem.inference.sidecar import DepthForm, Difference, Sidecar, parse, render

PLAIN = 'size = [41, 89]\nmean = [0.5, 0.5, 0.5]\nstd = [0.2, 0.2, 0.2]\nclasses = ["wall", "rubbish bin"]\n'

_share = st.floats(0.01, 1.0)
_name = st.text(st.characters(codec="utf-8", exclude_characters="_- "), min_size=1, max_size=8)
_names = st.lists(_name, min_size=1, max_size=5, unique_by=str.casefold)


@settings(max_examples=50, derandomize=True)
@given(
    size=st.tuples(st.integers(1, 2000), st.integers(1, 2000)),
    mean=st.tuples(_share, _share, _share),
    std=st.tuples(_share, _share, _share),
    names=_names,
    scale=st.none() | st.floats(-10, 10),
    note=st.text(st.characters(codec="utf-8")),
    depth=st.none() | st.builds(DepthForm, st.floats(-10, 10), st.floats(-1, 0)),
)
def test_what_is_written_reads_back_equal(
    size: tuple[int, int],
    mean: tuple[float, float, float],
    std: tuple[float, float, float],
    names: list[str],
    scale: float | None,
    note: str,
    depth: DepthForm | None,
) -> None:
    """Any name, number and note survives the way through TOML."""
    classes = ClassSet(tuple(names), tuple((i, 2 * i, 255) for i in range(len(names))))
    sidecar = Sidecar(size, mean, std, classes, None if scale is None else Difference(scale), note, depth)
    assert parse(render(sidecar), "x.toml") == sidecar


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("size = [41", "not valid TOML"),
        (PLAIN + "sise = 3\n", "did you mean 'size'"),
        (PLAIN + "zzz = 3\n", "valid keys are size"),
        (PLAIN + "[difference]\nsing = 1\n", "'sing' in [difference]; did you mean 'sign'"),
        (PLAIN + '[difference]\nsign = "previous - current"\n', "the only sign known is 'current - previous'"),
        (PLAIN + '[difference]\npartner = "previous keyframe"\n', "the only partner known is 'previous frame'"),
        (PLAIN + "[difference]\nscale = true\n", "expected a number"),
        (PLAIN + "difference = 3\n", "expected a table [difference]"),
        (PLAIN + "depth = 3\n", "expected a table [depth]"),
        (PLAIN + "[depth]\nscael = 1\n", "'scael' in [depth]; did you mean 'scale'"),
        (PLAIN + '[depth]\nunit = "mm"\n', "the only unit known is 'metres'"),
        (PLAIN + '[depth]\nunknown = "0"\n', "unknown = '0' in [depth]; expected a number"),
        (PLAIN.replace("mean", "note"), "has no key 'mean'"),
        (PLAIN.replace("[41, 89]", "[41]"), "expected a list of 2 numbers"),
        (PLAIN.replace("[41, 89]", "[41, 0]"), "expected [width, height]"),
        (PLAIN.replace("[0.2, 0.2, 0.2]", "[0.2, 0.0, 0.2]"), "above 0"),
        (PLAIN.replace("[0.5, 0.5, 0.5]", "[0.5, nan, 0.5]"), "expected a list of 3 numbers"),
        (PLAIN.replace('"rubbish bin"', '"Wall"'), "the same name"),
        (PLAIN.replace('"rubbish bin"', "7"), "expected a list of names"),
        (PLAIN + "colours = [[1, 2, 300], [1, 2, 3]]\n", "expected [red, green, blue]"),
        (PLAIN + "colours = [[1, 2, 3]]\n", "give one per class"),
    ],
)
def test_a_mistake_is_named(text: str, part: str) -> None:
    """Each message names the file, what came, and what to do."""
    with pytest.raises(NetworkError) as caught:
        parse(text, "net.toml")
    assert part in str(caught.value)
    assert "net.toml" in str(caught.value)


def test_the_difference_has_defaults() -> None:
    """An empty section asks for the plain difference."""
    assert parse(PLAIN + "[difference]\n", "x").difference == Difference(1.0)
    assert parse(PLAIN, "x").difference is None


def test_depth_has_defaults() -> None:
    """An empty section asks for metres, with 0 where they are unknown."""
    assert parse(PLAIN + "[depth]\n", "x").depth == DepthForm(1.0, 0.0)
    assert parse(PLAIN, "x").depth is None


def test_a_sidecar_follows_the_inputs_of_a_network() -> None:
    """Sections without use go; depth stays as it is or comes as metres; the scale of a difference cannot be guessed."""
    both = parse(PLAIN + "[difference]\nscale = 4.0\n[depth]\nscale = 0.1\n", "x")
    assert both.inputs == ("image", "difference", "depth")
    assert both.for_inputs(("image",)).inputs == ("image",)
    assert both.for_inputs(("image", "depth")).depth == DepthForm(0.1)
    assert both.for_inputs(("difference",)).difference == Difference(4.0)
    plain = parse(PLAIN, "x").for_inputs(("image", "difference", "depth"))
    assert (plain.depth, plain.difference) == (DepthForm(), None)
