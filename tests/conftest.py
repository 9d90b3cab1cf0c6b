"""Fixtures shared by all tests."""

import functools
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from stsem.sim.profile import CostProfile

from .made_up_walk import write_walk

settings.register_profile("stsem", derandomize=True, deadline=None)
settings.load_profile("stsem")  # the same examples everywhere, however busy the machine is

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session", autouse=True)
def _signals_as_in_a_terminal() -> None:
    """A suite that is started in the background inherits SIGINT and SIGHUP as ignored, and so would what it starts."""
    for number, default in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, default)


@pytest.fixture(scope="session")
def shared_logs() -> Path:
    """Folder of recorded logs that cannot be redistributed: STSEM_SHARED_LOGS, else ../shared/logs."""
    folder = Path(os.environ.get("STSEM_SHARED_LOGS", ROOT.parent / "shared" / "logs"))
    if not folder.is_dir():
        pytest.skip(f"the recorded logs are not at hand: no folder {folder} (set STSEM_SHARED_LOGS)")
    return folder


@pytest.fixture(scope="session")
def tiny_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A foxglove log of 12 frames, 96x64, with colour, depth, poses, labels, calibration and class table."""
    return write_walk(tmp_path_factory.mktemp("logs") / "tiny.mcap")


@pytest.fixture(scope="session")
def made_up_costs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cost profile in round numbers: the network takes about the period of `tiny_log`, the rest is quick."""
    samples = {
        "segment@2": (90, 100, 110, 120), "segment@1": (160, 180), "register@1": (8, 9), "propagate@1": (1, 2),
        "fuse@1": (20,), "decode@1": (3,), "track@1": (30,),
    }  # fmt: skip
    profile = CostProfile("made up", {name: tuple(ms * 1_000_000 for ms in kept) for name, kept in samples.items()})
    path = tmp_path_factory.mktemp("costs") / "made-up.json"
    profile.save(path)
    return path


@pytest.fixture(scope="session")
def operators_once() -> Iterator[None]:
    """torch builds the same table of operators for every export, which takes 0.7 s; here it is built once."""
    from torch.onnx._internal.exporter._registration import ONNXRegistry

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ONNXRegistry, "from_torchlib", staticmethod(functools.cache(ONNXRegistry.from_torchlib)))
        yield


@pytest.fixture(autouse=True)
def _quick_exports(request: pytest.FixtureRequest) -> None:
    if request.node.get_closest_marker("torch"):
        request.getfixturevalue("operators_once")
