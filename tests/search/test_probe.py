"""Replays for their timing alone against replays with labels."""

from collections.abc import Callable, Iterator
from dataclasses import astuple, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from stsem.log.log import Log, open_log
from stsem.log.plan import NEEDS
from stsem.replay.build import build_model, needed_roles, settled, truth_frames
from stsem.replay.engine import replay_log
from stsem.replay.posing import can_map
from stsem.replay.settings import validated
from stsem.result import FrameResult, Outcome
from stsem.search.probe import Probe
from stsem.sim.costs import ConstantCosts, CostSource, ProfileCosts
from stsem.sim.profile import load_profile
from tests.made_up_walk import write_walk

MS = 1_000_000


@pytest.fixture(scope="module")
def gappy_log(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Log]:
    """Frames without truth, without depth, and one that cannot be decoded."""
    path = tmp_path_factory.mktemp("gappy") / "gappy.mcap"
    write_walk(path, frames=16, truth=lambda i: i % 3 == 1, depth=lambda i: i % 4 != 2, broken=frozenset({6}))
    with open_log([path]) as log:
        yield log


def shown(results: list[FrameResult]) -> list[tuple[Any, ...]]:
    """What a replay without labels can know: not what a prediction had to do without."""
    blank: dict[str, Any] = {"coverage": None, "covered_share": None, "labels": None, "covered": None, "remark": ""}
    return [astuple(replace(r, **blank)) for r in sorted(results, key=lambda r: r.index)]


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"keyframes": "every:4", "propagation": "hold"},
        {"keyframes": "every:4", "propagation": "flow"},
        {"propagation": "depth", "map": False},
        {"keyframes": "every:4", "queue": "fifo:2", "rate": "2"},
        {"queue": "lossless", "rate": "3", "map": False},
        {"count_decode": True, "cores": 1, "seed": 5},
        {"keyframe_translation": 0.03, "rate": "1/3"},
        {"mode": "keyframe-async"},
        {"mode": "keyframe-async", "keyframes": "every:2", "propagation": "flow", "rate": "2"},
    ],
    ids=str,
)
def test_the_same_outcomes(gappy_log: Log, made_up_costs: Path, settings: dict[str, Any]) -> None:
    """Outcomes, keyframes, reasons and every instant are those of the real run."""
    config = settled(gappy_log, validated({"model": "oracle", **settings}))
    model, fused = build_model(gappy_log, config), can_map(gappy_log, config)
    source = ProfileCosts(load_profile(made_up_costs), config.seed, gappy_log.info.sha256)
    costs: Callable[[object], CostSource] = lambda mode: source  # noqa: E731
    real = replay_log(gappy_log, config, model, costs, lambda done, total: None)
    needs = needed_roles(model, config, fused=fused)
    probe = Probe(gappy_log, config, costs, needs=needs, fused=fused, usable=truth_frames(gappy_log))
    for run in real.runs:
        assert run.real_time is not None
        assert shown(probe.attempt(run.mode, config.exact_rate)) == shown(run.real_time.results)
    assert any(r.outcome is Outcome.UNDECODABLE for run in real.runs if run.real_time for r in run.real_time.results)


def test_patience(gappy_log: Log) -> None:
    """The clock of a search runs on for the deadline, so that the last frames can be answered within it."""
    config = settled(gappy_log, validated({"model": "oracle", "mode": "per-frame", "queue": "lossless", "map": False}))
    (mode,) = config.modes
    costs: Callable[[object], CostSource] = lambda mode: ConstantCosts({"segment": 50 * MS})  # noqa: E731
    pending = []
    for patience in (0, 100 * MS, 10**10):
        probe = Probe(gappy_log, config, costs, needs=frozenset(), fused=False, usable=None, patience_ns=patience)
        results = probe.attempt(mode, Fraction(10))
        assert len(results) == 16
        pending.append(sum(r.outcome is Outcome.PENDING for r in results))
    assert pending[0] > pending[1] > pending[2] == 0


def test_an_attempt_leaves_nothing_behind(gappy_log: Log, made_up_costs: Path) -> None:
    """Rates may be tried in any order."""
    config = settled(gappy_log, validated({"model": "oracle"}))
    source = ProfileCosts(load_profile(made_up_costs), 0, gappy_log.info.sha256)
    probe = Probe(gappy_log, config, lambda mode: source, needs=NEEDS, fused=True, usable=truth_frames(gappy_log))
    for mode in config.modes:
        first = shown(probe.attempt(mode, Fraction(1)))
        assert shown(probe.attempt(mode, Fraction(4))) != first
        assert shown(probe.attempt(mode, Fraction(1))) == first
