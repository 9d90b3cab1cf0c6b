"""Which cost source a configuration asks for."""

import contextlib
import hashlib
import importlib.metadata
import itertools
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from stsem import __version__, hostclock
from stsem.errors import CostError, DecodeError, OutputError, UsageError
from stsem.frame import Frame
from stsem.inference.backends import BACKENDS
from stsem.inference.cache import cache_root
from stsem.inference.network import DEFAULT, Network, load_network
from stsem.inference.variant import at_precision
from stsem.log.log import Log
from stsem.replay.build import Model, needed_roles, policy_of
from stsem.replay.calibrate import Subject, measure, registers
from stsem.replay.config import RunConfig
from stsem.replay.modes import Mode
from stsem.replay.posing import posing
from stsem.replay.tracking import posed
from stsem.sim.costs import CostSource, MeasuredCosts, ProfileCosts, TraceCosts
from stsem.sim.profile import CostProfile, load_profile
from stsem.sim.trace import is_trace, read_durations
from stsem.stages.propagate import PROPAGATIONS
from stsem.stages.track import SlamTracker, Tracker

_CALIBRATION_FRAMES = 12
_DECODED_FRAMES = 60
_TRACKED_FRAMES = 60


@dataclass(frozen=True, eq=False)
class Costing:
    """Where durations come from.

    Args:
        name: for the report.
        of: the source of a mode.
        sha256: of the profile or trace; None when durations are measured as they happen.
        profile: the profile, if it is one.
    """

    name: str
    of: Callable[[Mode], CostSource]
    sha256: str | None
    profile: CostProfile | None


def costing(log: Log, config: RunConfig, model: Model, *, fused: bool, say: Callable[[str], None]) -> Costing:
    """The cost source for `config`.

    Args:
        log, config, model: of the run.
        fused: whether a map stands beside the path.
        say: told what takes time.

    Raises:
        CostError: a profile or trace that cannot be used.
    """
    if config.costs == "measured":
        _refuse_measured(config)
        return Costing("measured", lambda mode: MeasuredCosts(hostclock.wall_ns), None, None)
    if config.costs == "auto":
        return _of_profile("auto", _calibrated(log, config, model, fused, say), log, config)
    path = Path(config.costs)
    try:
        data = path.read_bytes()
    except OSError as err:
        raise CostError(f"The costs {path} cannot be read: {err.strerror or err}; give a profile or a trace.") from err
    if is_trace(data):
        if config.sustainable:
            raise UsageError("--sustainable needs a cost profile; a trace knows only the jobs of one run.")
        durations, sha256 = read_durations(path)
        return Costing("trace of an earlier run", lambda mode: TraceCosts(durations, mode.name, sha256), sha256, None)
    profile = load_profile(path)
    return _of_profile(f"profile of {profile.machine}", profile, log, config)


def _refuse_measured(config: RunConfig) -> None:
    """Raise UsageError for what makes no sense with durations measured as they happen."""
    wrong = {
        "--count-decode": config.count_decode,
        "--model oracle (it costs what the default network costs)": config.is_oracle,
        "--sustainable": config.sustainable,
        "--repeat": config.repeat > 1,
    }
    if asked := [name for name, wanted in wrong.items() if wanted]:
        raise UsageError(f"{asked[0]} needs a cost profile; give --costs auto or a file instead of measured.")


def _of_profile(name: str, profile: CostProfile, log: Log, config: RunConfig) -> Costing:
    source = ProfileCosts(profile, config.seed, log.info.sha256)
    return Costing(name, lambda mode: source, profile.sha256, profile)


def subject(
    log: Log, config: RunConfig, model: Model, cores: tuple[int, ...], *, fused: bool, track: bool = False
) -> Subject:
    """What a profile for this configuration must hold; `cores`: how many the network may claim; `track`: with SLAM."""
    network: Network = model.network or at_precision(load_network(DEFAULT), config.precision)
    decode = _decoder(log, depth="depth" in needed_roles(model, config, fused=fused)) if config.count_decode else None
    method = PROPAGATIONS[config.propagation].make(model.classes, config.seed)
    return Subject(
        network, config.backend, config.precision, cores, config.propagation, method, policy_of(config), config.seed,
        decode,
        _ThereAndBack(log) if track else None,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _ThereAndBack:
    """The first frames of the log, forwards and then backwards, decoded as they are asked for."""

    log: Log

    def __iter__(self) -> Iterator[Frame]:
        there, any_decoded = range(min(len(self.log.plans), _TRACKED_FRAMES)), False
        for index in (*there, *reversed(there[1:-1])):
            with contextlib.suppress(DecodeError):
                yield self.log.frame(index, depth=True, previous=False)
                any_decoded = True
        if not any_decoded:
            raise CostError(f"None of the first {len(there)} frames can be decoded; give a profile with --costs.")


def calibration_frames(log: Log, needs: frozenset[str], tracker: Tracker | None = None) -> list[Frame]:
    """The first decodable frames of the log that lack nothing, or, when there are too few of them, the first at all.

    Args:
        log: opened.
        needs: roles that stages look at (`needed_roles`).
        tracker: gives the frames their poses; None for those of the log.

    Raises:
        CostError: fewer than two frames can be decoded.
    """
    found: list[Frame] = []
    indices = [plan.index for plan in sorted(log.plans, key=lambda plan: bool(plan.missing(needs)))]
    with contextlib.closing(log.frames(indices, depth="depth" in needs, previous=True, truth=False)) as supply:
        while len(found) < _CALIBRATION_FRAMES and (loaded := next(supply, None)) is not None:
            if loaded.frame is not None:
                found.append(loaded.frame)
    if len(found) < 2:
        raise CostError("Costs cannot be measured on fewer than two decodable frames; give a profile with --costs.")
    return found if tracker is None else [posed(frame, tracker.prepare(frame)()) for frame in found]


def _calibrated(log: Log, config: RunConfig, model: Model, fused: bool, say: Callable[[str], None]) -> CostProfile:
    tracks = posing(log, config).tracks
    cores = tuple(sorted({mode.cores(config.cores, tracks=tracks) for mode in config.modes}))
    wanted = subject(log, config, model, cores, fused=fused, track=tracks)
    tracker = SlamTracker(log.camera, config.seed) if tracks and log.camera is not None else None
    frames = calibration_frames(log, needed_roles(model, config, fused=fused), tracker)
    distribution = BACKENDS[wanted.backend].distribution
    about = {
        "machine": hostclock.machine_name(), "network": wanted.network.sha256, "size": frames[0].size,
        "backend": [wanted.backend, wanted.precision], "cores": wanted.network_cores,
        "propagation": config.propagation, "register": registers(wanted.policy, wanted.method.needs),
        "fused": fused, "decode": config.count_decode,
        distribution: importlib.metadata.version(distribution),
        "opencv": importlib.metadata.version("opencv-python-headless"), "stsem": __version__,
    }  # fmt: skip
    if tracks:
        about["track"] = True
    digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()[:16]
    path = cache_root() / "costs" / f"{digest}.json"
    if config.cache and (kept := _kept(path)) is not None:
        return kept
    say("Measuring what the stages cost on this machine (once; kept in the cache folder) ...")
    profile = measure(wanted, frames)
    if config.cache:
        _keep(profile, path)
    return profile


def _kept(path: Path) -> CostProfile | None:
    """The profile of an earlier run; None when there is none, or when it is damaged."""
    try:
        return load_profile(path) if path.is_file() else None
    except CostError:
        return None


def _keep(profile: CostProfile, path: Path) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as err:
        raise OutputError(
            f"The cache folder {path.parent} cannot be made ({err.strerror}); set STSEM_CACHE, or use --no-cache."
        ) from err
    profile.save(path)


def _decoder(log: Log, *, depth: bool) -> Callable[[], object]:
    """Decodes the frames of the log in turn, so far apart in time that none is still in memory."""
    supply = itertools.cycle([plan.index for plan in log.plans][:_DECODED_FRAMES])

    def decode() -> object:
        try:
            return log.frame(next(supply), depth=depth, previous=False)
        except DecodeError:
            return None

    return decode
