"""One lit office for all tests that look at something, and one short log."""

from pathlib import Path

import pytest

from stsem.errors import MissingExtraError
from stsem.synth.generate import render_log
from stsem.synth.mesh import Builder
from stsem.synth.scene import Scene
from stsem.synth.tracer import Tracer


@pytest.fixture(scope="session")
def embree() -> None:
    """Skips what renders where the extra `synth` is not installed."""
    try:
        Tracer(Builder().build())
    except MissingExtraError as err:
        pytest.skip(f"{err}")


@pytest.fixture(scope="session")
def scene(embree: None) -> Scene:
    """The office of the shipped log tiny-a."""
    return Scene(layout=7002, seed=1)


@pytest.fixture(scope="session")
def rendered(embree: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six frames of 64x48 with exact depth, truth for every second one."""
    path = tmp_path_factory.mktemp("rendered") / "short.mcap"
    render_log(
        path, seed=3, layout=11, width=64, height=48, rate_hz=10, length_s=0.6, noise="none", speed="steady",
        label_every=2,
    )  # fmt: skip
    return path
