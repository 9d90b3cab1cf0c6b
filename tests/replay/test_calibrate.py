"""Measuring costs, on a clock that stands still except where the test moves it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stsem import hostclock
from stsem.camera import Camera
from stsem.frame import Frame, Segmentation
from stsem.geometry.features import Features
from stsem.replay import calibrate
from stsem.replay.calibrate import Subject, measure
from stsem.stages.propagation.hold import Hold
from stsem.stages.propagation.method import Predicted
from stsem.stages.register import Registration
from stsem.stages.select import PaperPolicy

MS = 1_000_000
COSTS_MS = {"segment": 100, "register": 5, "propagate": 2, "fuse": 7, "decode": 3}


@dataclass
class Host:
    """A machine whose clocks advance when work is done.

    Args:
        others: share of a core that other work takes; None: the machine cannot say.
        rush: from when to when another process takes half of our core.
    """

    now_ns: int = 0
    own_ns: int = 0
    others: float | None = 0.0
    rush: tuple[int, int] = (0, 0)
    others_ns: int = 0

    def work(self, duration_ns: int) -> None:
        if self.rush[0] <= self.now_ns < self.rush[1]:
            self.others_ns += duration_ns
            self.now_ns += duration_ns
        self.now_ns += duration_ns
        self.own_ns += duration_ns

    def busy_ns(self) -> int | None:
        return None if self.others is None else self.own_ns + self.others_ns + round(self.others * self.now_ns)


def no_features(register: object, frame: Frame, anchors: object) -> Registration:
    """A register stage that finds nothing, at no expense."""
    return Registration(Features(np.empty((0, 2), np.float32), np.empty((0, 32), np.uint8), *frame.size))


class FakeNetwork:
    """What `Subject.network` is asked for."""

    name, sha256 = "fake", "ab" * 32


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> Host:
    """Fake clocks, and stages that take a known time on them."""
    machine = Host()
    monkeypatch.setattr(hostclock, "wall_ns", lambda: machine.now_ns)
    monkeypatch.setattr(hostclock, "process_cpu_ns", lambda: machine.own_ns)
    monkeypatch.setattr(hostclock, "machine_busy_ns", machine.busy_ns)

    class SlowInferencer:
        def __init__(self, network: object, *, backend: str, precision: str, threads: int) -> None:
            self.threads = threads

        def infer(self, frame: Frame) -> Segmentation:
            machine.work(COSTS_MS["segment"] * MS // self.threads)
            return Segmentation(np.zeros(frame.image.shape[:2], np.uint8))

    def slowed(name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        def run(*args: Any) -> Any:
            machine.work(COSTS_MS[name] * MS)
            return real(*args)

        return run

    monkeypatch.setattr(calibrate, "Inferencer", SlowInferencer)
    monkeypatch.setattr(calibrate.Register, "__call__", slowed("register", no_features))
    monkeypatch.setattr(calibrate.Fuse, "__call__", slowed("fuse", calibrate.Fuse.__call__))
    return machine


class SlowHold(Hold):
    """Hold, on the fake clock."""

    def __init__(self, machine: Host) -> None:
        self.machine = machine

    def predict(self, *args: Any) -> Predicted:
        self.machine.work(COSTS_MS["propagate"] * MS)
        return super().predict(*args)


def frames(count: int = 3) -> list[Frame]:
    """Textured frames with all that fuse needs."""
    rng = np.random.default_rng(0)
    return [
        Frame(
            i, i, rng.integers(0, 255, (24, 32, 3), np.uint8), None, np.ones((24, 32), np.float32), np.eye(4),
            Camera(32, 24, 30.0, 30.0, 15.5, 11.5),
        )
        for i in range(count)
    ]  # fmt: skip


PAPER = PaperPolicy(1.0, 1.0, 1)


def subject(machine: Host, *, cores: tuple[int, ...] = (1, 2), decode: bool = False) -> Subject:
    def decoded() -> None:
        machine.work(COSTS_MS["decode"] * MS)

    return Subject(
        FakeNetwork(), "onnxruntime", "f32", cores, "hold", SlowHold(machine), PAPER, 0, decoded if decode else None  # type: ignore[arg-type]
    )  # fmt: skip


def test_every_stage_is_measured(host: Host) -> None:
    """The network on each number of cores, the others on one; exact on a clock without noise."""
    profile = measure(subject(host, decode=True), frames())
    assert {name: set(samples) for name, samples in profile.samples_ns.items()} == {
        "segment@1": {100 * MS}, "segment@2": {50 * MS}, "register@1": {5 * MS}, "propagate@1": {2 * MS},
        "fuse@1": {7 * MS}, "decode@1": {3 * MS},
    }  # fmt: skip
    assert all(len(samples) == calibrate.SAMPLES for samples in profile.samples_ns.values())
    assert not profile.disturbed
    assert profile.made_for["network"] == "fake"
    assert profile.made_for["image"] == "32x24"
    assert (profile.made_for["propagation"], profile.made_for["register"]) == ("hold", "points")


def test_quick_stages_are_thinned_fairly() -> None:
    """The samples kept are spread like all of them, whatever their number."""
    assert calibrate._thinned(list(range(1000, 0, -1)), 4) == (126, 376, 626, 876)
    assert calibrate._thinned([3, 1, 2], 12) == (1, 2, 3)
    for count in range(1, 40):
        kept = calibrate._thinned(list(range(count)), 12)
        assert len(set(kept)) == min(count, 12)


def test_what_is_not_needed_is_not_measured(host: Host) -> None:
    """No decoding, no map without depth, the network on two cores alone."""
    flat = [replace(frame, depth=None) for frame in frames()]
    profile = measure(subject(host, cores=(2,)), flat)
    assert set(profile.samples_ns) == {"segment@2", "register@1", "propagate@1"}


def test_the_oracle_measures_the_default_network_on_its_cores(host: Host) -> None:
    """No core count at all is a mistake of the caller."""
    with pytest.raises(ValueError, match="number of cores"):
        measure(subject(host, cores=()), frames())


def test_a_busy_machine_marks_the_profile(host: Host) -> None:
    """Other work on a core all the time: after the limit what there is must do, and says so."""
    host.others = 0.8
    profile = measure(subject(host, cores=(2,)), frames(), limit_ns=5 * 10**8)
    assert profile.disturbed
    assert all(profile.samples_ns.values())


def test_a_slow_network_on_a_quiet_machine(host: Host) -> None:
    """Few samples within the limit are few, but nobody disturbed them."""
    profile = measure(subject(host, cores=(1,)), frames(), samples=12, limit_ns=3 * 10**8)
    assert not profile.disturbed
    assert 1 <= len(profile.samples_ns["segment@1"]) < 12


@pytest.mark.parametrize(("share", "disturbed"), [(0.0, False), (0.09, False), (0.11, True), (None, False)])
def test_where_quiet_ends(host: Host, share: float | None, disturbed: bool) -> None:
    """A tenth of one core is tolerated; a machine that cannot say is taken to be quiet."""
    host.others = share
    assert measure(subject(host, cores=(2,)), frames(), limit_ns=5 * 10**8).disturbed == disturbed


def test_disturbed_batches_are_left_out(host: Host) -> None:
    """Work that comes and goes and slows the network to a half: its samples are dropped, the rest is undisturbed."""
    host.rush = (10**9, 3 * 10**9)
    profile = measure(subject(host, cores=(2,)), frames(), samples=60)
    assert host.now_ns > 3 * 10**9
    assert host.others_ns > 0
    assert not profile.disturbed
    assert set(profile.samples_ns["segment@2"]) == {50 * MS}


def test_a_profile_is_written_and_found_again(host: Host, tmp_path: Path) -> None:
    """What is measured is what a file brings back."""
    from stsem.sim.profile import load_profile

    profile = measure(subject(host), frames())
    profile.save(tmp_path / "p.json")
    assert load_profile(tmp_path / "p.json").sha256 == profile.sha256
