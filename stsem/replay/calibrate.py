"""A cost profile for this machine, measured on frames of the log (`--costs auto`, `stsem costs measure`)."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from stsem import hostclock
from stsem.frame import Frame
from stsem.geometry.features import Features
from stsem.inference.inferencer import Inferencer
from stsem.inference.network import Network
from stsem.inference.threads import set_threads
from stsem.mapping.cloud import LabelledCloud
from stsem.sim.profile import CostProfile, key
from stsem.stages.fuse import Fuse
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagate import Propagation
from stsem.stages.register import Register

SAMPLES = 12
LIMIT_NS = 10 * 10**9
_WARM_UP = 2
_BATCH_NS = 250 * 10**6
_OTHER_WORK = 0.10
"""Share of one core: a batch during which the rest of the machine used more is dropped."""


@dataclass(frozen=True)
class Subject:
    """What to measure.

    Args:
        network: the network; for the oracle, the default one.
        backend, precision: how it runs.
        network_cores: core counts to measure the network with.
        propagation: the method between keyframes.
        seed: of registration.
        decode: decodes some frame of the log anew; None to leave decoding out.
    """

    network: Network
    backend: str
    precision: str
    network_cores: tuple[int, ...]
    propagation: Propagation
    seed: int
    decode: Callable[[], object] | None = None


def measure(subject: Subject, frames: list[Frame], *, samples: int = SAMPLES, limit_ns: int = LIMIT_NS) -> CostProfile:
    """Measure every stage on `frames`, which are used in turn.

    Args:
        subject: what to measure.
        frames: at least two decoded frames of the log.
        samples: undisturbed samples wanted per stage.
        limit_ns: wall-clock time per stage after which what there is must do.
    """
    found: dict[str, tuple[int, ...]] = {}
    disturbed = False
    for name, cores, usable, work in _stages(subject, frames):
        set_threads(cores)
        kept, was_disturbed = _sample(work, usable, samples, limit_ns)
        found[key(name, cores)] = kept
        disturbed |= was_disturbed
    set_threads(1)
    width, height = frames[0].size
    made_for = {
        "network": subject.network.name, "model_sha256": subject.network.sha256, "image": f"{width}x{height}",
        "backend": f"{subject.backend} {subject.precision}",
    }  # fmt: skip
    return CostProfile(hostclock.machine_name(), found, disturbed, made_for)


def _stages(subject: Subject, frames: list[Frame]) -> Iterator[tuple[str, int, list[Frame], Callable[[Frame], object]]]:
    """(stage, cores, frames to measure it on, its work)."""
    register = Register(subject.seed)
    features: Features = register(frames[0], None, None).features
    answer = None
    for cores in subject.network_cores:
        network = Inferencer(subject.network, backend=subject.backend, precision=subject.precision, threads=cores)
        answer = network.infer(frames[0])
        yield "segment", cores, frames, network.infer
    if answer is None:
        raise ValueError("a profile needs the network on at least one number of cores")
    keyframe = Keyframe(frames[0].index, frames[0].stamp_ns, answer)
    last = register(frames[1], features, frames[0].index).homography
    fuse, labels = Fuse(LabelledCloud()), answer
    yield "register", 1, frames, lambda frame: register(frame, features, frames[0].index)
    yield "propagate", 1, frames, lambda frame: subject.propagation.propagate(keyframe, frame, last)
    if (decode := subject.decode) is not None:
        yield "decode", 1, frames, lambda frame: decode()
    if fusable := [frame for frame in frames if fuse.can_fuse(frame)]:
        yield "fuse", 1, fusable, lambda frame: fuse(frame, labels)


def _sample(
    work: Callable[[Frame], object], frames: list[Frame], wanted: int, limit_ns: int
) -> tuple[tuple[int, ...], bool]:
    """(durations in ns, whether too few of them were undisturbed)."""
    supply = _forever(frames)
    for _ in range(_WARM_UP):
        work(next(supply))
    kept: list[int] = []
    spoiled: list[int] = []
    started = hostclock.wall_ns()
    while len(kept) < wanted and hostclock.wall_ns() - started < limit_ns:
        durations, quiet = _batch(work, supply)
        (kept if quiet else spoiled).extend(durations)
    if len(kept) >= wanted or not spoiled:
        return _thinned(kept, wanted), False
    return _thinned(kept + spoiled, wanted), True


def _thinned(durations: list[int], wanted: int) -> tuple[int, ...]:
    """At most `wanted` of them, ascending: the middles of as many equal shares. Quick stages give tens of thousands."""
    ascending, count = sorted(durations), min(wanted, len(durations))
    return tuple(ascending[(2 * i + 1) * len(ascending) // (2 * count)] for i in range(count))


def _batch(work: Callable[[Frame], object], supply: Iterator[Frame]) -> tuple[list[int], bool]:
    """Durations over a quarter of a second, and whether the machine did little else meanwhile."""
    durations: list[int] = []
    busy, own, began = hostclock.machine_busy_ns(), hostclock.process_cpu_ns(), hostclock.wall_ns()
    while hostclock.wall_ns() - began < _BATCH_NS:
        frame = next(supply)
        before = hostclock.wall_ns()
        work(frame)
        durations.append(hostclock.wall_ns() - before)
    after = hostclock.machine_busy_ns()
    if busy is None or after is None:
        return durations, True
    wall = hostclock.wall_ns() - began
    others = (after - busy) - (hostclock.process_cpu_ns() - own)
    return durations, others <= _OTHER_WORK * wall


def _forever(frames: Iterable[Frame]) -> Iterator[Frame]:
    kept = list(frames)
    while True:
        yield from kept
