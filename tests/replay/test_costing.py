"""Which cost source a configuration gets, and what is kept in the cache folder."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from stsem.errors import CostError, OutputError, UsageError
from stsem.log.log import Log, open_log
from stsem.log.plan import NEEDS
from stsem.replay import costing as module
from stsem.replay.build import build_model, settled
from stsem.replay.calibrate import Subject
from stsem.replay.costing import Costing, calibration_frames, costing
from stsem.replay.modes import MODES
from stsem.replay.settings import validated
from stsem.sim.profile import CostProfile
from tests.made_up_walk import BASE_NS, write_walk


@pytest.fixture
def log(tiny_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Log]:
    """The small log, and an empty cache."""
    monkeypatch.setenv("STSEM_CACHE", str(tmp_path / "cache"))
    with open_log([tiny_log]) as opened:
        yield opened


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[Subject]:
    """Every subject that was measured; the measurement itself is a fake."""
    subjects: list[Subject] = []

    def fake(subject: Subject, frames: list[Any], **limits: int) -> CostProfile:
        subjects.append(subject)
        samples = {f"segment@{cores}": (100 + len(subjects),) for cores in subject.network_cores}
        return CostProfile("fake", {**samples, "register@1": (5,), "propagate@1": (2,), "fuse@1": (1,)})

    monkeypatch.setattr(module, "measure", fake)
    return subjects


def ask(log: Log, **settings: Any) -> Costing:
    config = settled(log, validated({"model": "oracle", **settings}))
    return costing(log, config, build_model(log, config), fused=True, say=lambda text: None)


def test_auto_measures_once(log: Log, measured: list[Subject]) -> None:
    """The second run finds the profile of the first; --no-cache neither reads nor writes it."""
    first = ask(log)
    assert ask(log).sha256 == first.sha256
    assert len(measured) == 1
    assert ask(log, cache=False).sha256 != first.sha256
    assert len(measured) == 2
    assert ask(log).sha256 == first.sha256


@pytest.mark.parametrize(
    ("settings", "again"),
    [
        ({"seed": 9}, False), ({"keyframes": "every:3"}, True), ({"queue": "lossless"}, False),
        ({"cores": 1}, True), ({"propagation": "hold"}, True), ({"count_decode": True}, True),
    ],
    ids=str,
)  # fmt: skip
def test_what_a_profile_is_made_for(log: Log, measured: list[Subject], settings: dict[str, Any], again: bool) -> None:
    """What the stages cost depends on some settings and not on others."""
    ask(log)
    ask(log, **settings)
    assert len(measured) == 1 + again


def test_the_oracle_costs_what_the_default_network_costs(log: Log, measured: list[Subject]) -> None:
    """On the cores that the modes claim."""
    ask(log)
    ask(log, cores=1)
    assert [s.network.name for s in measured] == ["default", "default"]
    assert [s.network_cores for s in measured] == [(2,), (1,)]


def test_a_damaged_profile_is_measured_anew(log: Log, measured: list[Subject], tmp_path: Path) -> None:
    """Half a file from a run that was killed is no error."""
    ask(log)
    (kept,) = (tmp_path / "cache" / "costs").iterdir()
    kept.write_bytes(kept.read_bytes()[:40])
    ask(log)
    assert len(measured) == 2
    ask(log)
    assert len(measured) == 2


def test_an_unwritable_cache(
    log: Log, measured: list[Subject], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Named, with the variable that moves it."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("STSEM_CACHE", os.fspath(tmp_path / "file"))
    with pytest.raises(OutputError, match="STSEM_CACHE"):
        ask(log)


def test_a_profile_from_a_file(log: Log, made_up_costs: Path) -> None:
    """The draw depends on seed, log, stamp and stage alone: modes and call order share their luck."""
    found = ask(log, costs=str(made_up_costs))
    assert (found.name, found.sha256) == ("profile of made up", found.profile.sha256 if found.profile else "")
    one, other = (found.of(MODES[name]) for name in ("per-frame", "keyframe"))
    stamps = [BASE_NS + i * 10**8 for i in range(50)]
    costs = [one.run(stamp, "segment", 2, lambda: None)[1] for stamp in stamps]
    assert costs == [other.run(stamp, "segment", 2, lambda: None)[1] for stamp in reversed(stamps)][::-1]
    assert set(costs) == {ms * 1_000_000 for ms in (90, 100, 110, 120)}
    again = ask(log, costs=str(made_up_costs), seed=1)
    assert [again.of(MODES["keyframe"]).run(s, "segment", 2, lambda: None)[1] for s in stamps] != costs


def test_measured(log: Log) -> None:
    """No digest, hence no gate and no search; decoding is no job then."""
    found = ask(log, costs="measured", model="default")
    assert (found.sha256, found.profile) == (None, None)
    result, cost = found.of(MODES["keyframe"]).run(0, "segment", 2, lambda: 42)
    assert (result, cost >= 0) == (42, True)
    for wrong in ({"count_decode": True}, {"model": "oracle"}, {"sustainable": True}, {"repeat": 2}):
        with pytest.raises(UsageError, match="needs a cost profile"):
            ask(log, **{"costs": "measured", "model": "default", **wrong})


def test_calibration_needs_two_frames(tmp_path: Path) -> None:
    """Undecodable ones do not count."""
    path = write_walk(tmp_path / "log.mcap", frames=4, broken=frozenset({0, 2}))
    with open_log([path]) as opened:
        assert [frame.index for frame in calibration_frames(opened, NEEDS)] == [1, 3]
    path = write_walk(tmp_path / "short.mcap", frames=4, broken=frozenset({0, 1, 2}))
    with open_log([path]) as opened, pytest.raises(CostError, match="two decodable frames"):
        calibration_frames(opened, NEEDS)
