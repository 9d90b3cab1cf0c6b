"""A cost profile for this machine, measured on frames of the log (`--costs auto`, `stsem costs measure`)."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import count

from stsem import hostclock
from stsem.frame import Frame, Segmentation
from stsem.inference.inferencer import Inferencer
from stsem.inference.network import Network
from stsem.inference.threads import set_threads
from stsem.mapping.cloud import LabelledCloud
from stsem.sim.profile import CostProfile, key
from stsem.slam.system import Slam
from stsem.stages.candidate import KeyframePolicy
from stsem.stages.fuse import Fuse
from stsem.stages.keyframe import Keyframe, view_of
from stsem.stages.propagation.method import Needs, Propagation
from stsem.stages.register import Anchor, Register
from stsem.stages.track import fitting

SAMPLES = 12
LIMIT_NS = 10 * 10**9
_WARM_UP = 2
_MEMORY = 40
"""Keyframes before the newest: more than any method remembers."""
_BATCH_NS = 250 * 10**6
_OTHER_WORK = 0.10
"""Share of one core: a batch during which the rest of the machine used more is dropped."""


_Stage = tuple[str, int, Iterable[Frame], Callable[[Frame], object]]
"""(stage, cores, frames to measure it on, its work)."""


@dataclass(frozen=True)
class Subject:
    """What to measure.

    Args:
        network: the network; for the oracle, the default one.
        backend, precision: how it runs.
        network_cores: core counts to measure the network with.
        propagation: the method between keyframes.
        method: its object, which nobody else uses.
        policy: of keyframes, which may ask `register` for more.
        seed: of registration.
        decode: decodes some frame of the log anew; None to leave decoding out.
        walk: frames to track, each near the one before, and the last near the first; None to leave tracking out.
    """

    network: Network
    backend: str
    precision: str
    network_cores: tuple[int, ...]
    propagation: str
    method: Propagation
    policy: KeyframePolicy
    seed: int
    decode: Callable[[], object] | None = None
    walk: Iterable[Frame] | None = None


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
        "backend": f"{subject.backend} {subject.precision}", "propagation": subject.propagation,
        "register": registers(subject.policy, subject.method.needs),
    }  # fmt: skip
    return CostProfile(hostclock.machine_name(), found, disturbed, made_for)


def _stages(subject: Subject, frames: list[Frame]) -> Iterator[_Stage]:
    """Every stage that there is a cost for."""
    answer = None
    for cores in subject.network_cores:
        network = Inferencer(subject.network, backend=subject.backend, precision=subject.precision, threads=cores)
        answer = network.infer(frames[0])
        yield "segment", cores, frames, network.infer
    if answer is None:
        raise ValueError("a profile needs the network on at least one number of cores")
    fuse, labels = Fuse(LabelledCloud()), answer
    yield from _between_keyframes(subject, frames, answer)
    if (decode := subject.decode) is not None:
        yield "decode", 1, frames, lambda frame: decode()
    if fusable := [frame for frame in frames if fuse.can_fuse(frame)]:
        yield "fuse", 1, fusable, lambda frame: fuse(frame, labels)
    if subject.walk is not None:
        yield "track", 1, subject.walk, _tracking(subject.seed)


def _tracking(seed: int) -> Callable[[Frame], object]:
    """Tracks the frames it is given as if they were one long log."""
    started: list[Slam] = []
    numbers = count()

    def track(frame: Frame) -> object:
        if frame.camera is None:
            raise ValueError("tracking needs a camera")
        if not started:
            started.append(Slam(frame.camera, seed))
        return started[0].track(replace(fitting(frame, frame.camera), index=next(numbers)))

    return track


def registers(policy: KeyframePolicy, needs: Needs) -> str:
    """What the stage `register` does, in words, as a profile's `made_for` has it."""
    parts = {
        "points": policy.needs_homography or needs.points,
        "the method's own": needs.follows,
        "coverage": policy.needs_coverage,
    }
    return " and ".join(name for name, does in parts.items() if does) or "points"


def _between_keyframes(subject: Subject, frames: list[Frame], answer: Segmentation) -> Iterator[_Stage]:
    """`register` and `propagate` from the first frame as the newest keyframe, with the method's memory full."""
    method, needs = subject.method, subject.method.needs
    follower = method if needs.follows else None
    foreteller = method if subject.policy.needs_coverage else None
    points = subject.policy.needs_homography or needs.points
    register = Register(subject.seed, points or not (follower or foreteller), follower, foreteller)
    first = register(frames[0], ())
    method.selected(frames[0], first)
    for i in range(_MEMORY, -1, -1):
        frame = frames[i % len(frames)]
        keyframe = Keyframe(frame.index, frames[0].stamp_ns - i, answer, first.features, view_of(frame), frame.image)
        method.finished(keyframe)
    anchors = () if first.features is None else (Anchor(frames[0].index, first.features),)
    last = register(frames[1], anchors)
    yield "register", 1, frames, lambda frame: register(frame, anchors)
    yield "propagate", 1, frames, lambda frame: method.predict(keyframe, frame, last)


def _sample(
    work: Callable[[Frame], object], frames: Iterable[Frame], wanted: int, limit_ns: int
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
    while True:
        yield from frames
