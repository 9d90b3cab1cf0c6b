"""One lit office for all tests that look at something, and one short log."""

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from stsem.errors import MissingExtraError
from stsem.synth import generate
from stsem.synth.generate import RenderedFrame
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


@dataclass(frozen=True)
class Rendered:
    """A log and the frames that went into it."""

    path: Path
    asked: dict[str, Any]
    frames: list[RenderedFrame]


@pytest.fixture(scope="session")
def rendered(embree: None, tmp_path_factory: pytest.TempPathFactory) -> Rendered:
    """Six frames of 64x48 with exact depth, truth for every second one."""
    asked: dict[str, Any] = {
        "seed": 3, "layout": 11, "width": 64, "height": 48, "rate_hz": 10, "length_s": 0.6, "noise": "none",
        "speed": "steady",
    }  # fmt: skip
    log = Rendered(tmp_path_factory.mktemp("rendered") / "short.mcap", asked, [])
    original = generate.render_frames

    def remembered(**given: Any) -> Generator[RenderedFrame, None, None]:
        for frame in original(**given):
            log.frames.append(frame)
            yield frame

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generate, "render_frames", remembered)
        generate.render_log(log.path, label_every=2, **asked)
    return log
