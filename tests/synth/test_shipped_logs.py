"""The logs that ship: what the manifest says about them is true, and today's code still renders them."""

import hashlib
import shlex
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stsem import chance
from stsem.log.log import open_log
from stsem.synth.generate import office_camera
from stsem.synth.path import pose_at, profile, walk
from stsem.synth.scene import Scene
from stsem.synth.sensor import expose, kinect
from stsem.synth.vocabulary import OFFICE

LOGS = Path(__file__).resolve().parents[2] / "logs"
TRAINING, VALIDATION = range(1000), range(5000, 5100)


def manifest() -> dict[str, dict[str, Any]]:
    return tomllib.loads((LOGS / "manifest.toml").read_text(encoding="utf-8"))


def options(entry: dict[str, Any]) -> dict[str, str]:
    """Flags of the command that made a log."""
    words = shlex.split(entry["made_by"])
    assert words[:3] == ["stsem", "synth", entry["file"]]
    return dict(zip(words[3::2], words[4::2], strict=True))


def test_the_manifest_names_every_log_with_its_checksum() -> None:
    """No log without an entry, no entry without its log, no changed byte."""
    entries = manifest()
    assert {entry["file"] for entry in entries.values()} == {path.name for path in LOGS.glob("*.mcap")}
    for entry in entries.values():
        assert hashlib.sha256((LOGS / entry["file"]).read_bytes()).hexdigest() == entry["sha256"], entry["file"]


def test_no_shipped_layout_trained_or_validated_the_network() -> None:
    """Each log has a layout of its own, outside both ranges."""
    layouts = [int(options(entry)["--layout"]) for entry in manifest().values()]
    assert len(set(layouts)) == len(layouts)
    assert not set(layouts) & (set(TRAINING) | set(VALIDATION))


@pytest.mark.parametrize("name", sorted(manifest()))
def test_a_shipped_log_is_what_its_command_asks_for(name: str) -> None:
    """Size, length, rate, truth; sound from end to end."""
    entry = manifest()[name]
    asked = options(entry)
    with open_log([LOGS / entry["file"]]) as log:
        assert not log.info.damage.lossy
        assert log.info.warnings == ()
        assert "{}x{}".format(*log.size) == asked["--size"]
        assert log.period_ns == round(10**9 / float(asked["--rate"]))
        assert len(log.plans) == float(asked["--rate"]) * float(asked["--seconds"])
        assert log.classes == OFFICE
        every = int(asked.get("--label-every", 1))
        assert [p.index for p in log.plans if p.truth_log_ns is not None] == list(range(0, len(log.plans), every))
        assert all(not plan.missing(frozenset({"depth", "pose"})) for plan in log.plans)


@pytest.mark.render
def test_todays_code_still_renders_tiny_a(scene: Scene) -> None:
    """Pose exactly; labels, depth and colour but for what another processor's rounding may do."""
    asked = options(manifest()["tiny-a"])
    seed, width, height = int(asked["--seed"]), *map(int, asked["--size"].split("x"))
    assert (seed, asked["--layout"]) == (1, "7002")
    camera = office_camera(width, height)
    states = walk(
        scene.office, chance.hash31(seed, "walk", 7002), float(asked["--seconds"]), profile(asked["--speed"])
    )  # fmt: skip
    with open_log([LOGS / "tiny-a.mcap"]) as log:
        for index in (0, 14, 29):
            read, truth, T_WC = (
                log.frame(index, depth=True, previous=False),
                log.truth(index),
                pose_at(states, index / 10),
            )
            view, rng = scene.look(camera, T_WC, index / 10), chance.generator(seed, "sensor", index)
            image, depth = expose(view.radiance, 1.0, rng), kinect(view.depth, camera.fx, rng)
            assert read.T_WC is not None
            assert read.depth is not None
            assert truth is not None
            np.testing.assert_allclose(read.T_WC, T_WC, atol=1e-9)
            assert (truth == view.labels).mean() > 0.999
            same = np.isclose(read.depth, depth, atol=0.0006, rtol=0, equal_nan=True)
            assert same.mean() > 0.995
            assert np.abs(read.image.astype(int) - image).mean() < 4
