"""From a configuration and a log to the objects of a run. The only place where stages get their numbers."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from stsem.classes import NO_LABEL, ClassSet, Labels, translation
from stsem.errors import ChannelError, ClassTableError
from stsem.inference.backends import choose_backend
from stsem.inference.cache import CachedInferencer, OutputCache, cache_root
from stsem.inference.network import Network, load_network
from stsem.inference.variant import at_precision
from stsem.log.classtable import read_class_map
from stsem.log.log import Log
from stsem.log.plan import NEEDS
from stsem.replay.answer import AnswerRule, Prediction
from stsem.replay.config import RunConfig
from stsem.replay.hosttimes import StageTimes, TimedInferencer, TimedPropagation, TimedRegister
from stsem.replay.memo import Memo
from stsem.replay.modes import Mode
from stsem.stages.candidate import KeyframePolicy
from stsem.stages.propagate import AUTO, IN_SPACE, IN_THE_IMAGE, PROPAGATIONS
from stsem.stages.propagation.method import Propagation
from stsem.stages.register import Register
from stsem.stages.segment import NetworkSegmenter, OracleSegmenter, Segmenter
from stsem.stages.select import parse_policy

NETWORK_THREADS = 2
"""Threads of the network on two or more simulated cores; its output does not depend on them."""


@dataclass(frozen=True, eq=False)
class Model:
    """What segments keyframes, and in which classes.

    Args:
        name: as given, files without their folder.
        network: None for the oracle.
        classes: of every label image in the run: the log's, or the network's when the log's cannot be used.
        translation: (256,) from the network's ids to `classes`; None for the oracle.
        reason: why accuracy cannot be measured; "" when it can.
        segmenter: makes the segmenter for a number of threads, timed into the given times.
    """

    name: str
    network: Network | None
    classes: ClassSet
    translation: Labels | None
    reason: str
    segmenter: Callable[[int, StageTimes], Segmenter]


def needed_roles(model: Model, config: RunConfig, *, fused: bool) -> frozenset[str]:
    """Roles beside colour whose messages a frame waits for: the union over the modes (DESIGN 3).

    Args:
        model, config: of the run.
        fused: whether a map is built, which takes depth and poses.
    """
    depth = frozenset({"depth"}) if model.network is not None and model.network.has_depth else frozenset[str]()
    needs = depth | NEEDS if fused or _predicts_in_space(config) else depth
    return needs - {"pose"} | {"depth"} if config.pose == "slam" else needs


def _predicts_in_space(config: RunConfig) -> bool:
    predicts = any(not mode.segments_every_frame for mode in config.modes)
    return predicts and PROPAGATIONS[config.propagation].needs.space


def build_model(log: Log, config: RunConfig) -> Model:
    """The network or the oracle, and how its classes meet those of the log.

    Raises:
        UsageError: there is no such backend or precision; it is said of the oracle, too, which needs none.
        MissingExtraError: the backend is not installed.
        NetworkError: the network cannot be used, or has no variant for the precision.
        ClassTableError: the oracle without truth, or a class map that cannot be read or names unknown classes.
        ChannelError: the network or the propagation takes depth, but the log has none that can be used; or the
            propagation takes poses or a camera, and the log lacks them.
    """
    choose_backend(config.backend, config.precision)
    _check_space(log, config)
    class_map = read_class_map(config.class_map) if config.class_map else {}
    if config.is_oracle:
        return _oracle(log)
    network = at_precision(load_network(config.model), config.precision)
    _check_depth(network, log)
    classes, table, reason = _meeting(network.classes, log, class_map)
    make = partial(_network_segmenter, network, table, log, config)
    return Model(Path(config.model).name, network, classes, table, reason, make)


def build_rule(mode: Mode, segmenter: Segmenter, classes: ClassSet, config: RunConfig, times: StageTimes) -> AnswerRule:
    """The steps of `mode`, with a memory of their own; `classes`: of the labels."""
    if mode.segments_every_frame:
        return AnswerRule(segmenter, None)
    policy, method = policy_of(config), PROPAGATIONS[config.propagation].make(classes, config.seed)
    register = registering(policy, method, config.seed)
    timed = None if register is None else TimedRegister(register, times)
    return AnswerRule(segmenter, Prediction(policy, TimedPropagation(method, times), timed))


def registering(policy: KeyframePolicy, method: Propagation, seed: int) -> Register | None:
    """What a policy and a method ask of `register`; None if nothing."""
    points, follows = policy.needs_homography or method.needs.points, method.needs.follows
    foretells = policy.needs_coverage
    if not (points or follows or foretells):
        return None
    return Register(seed, points, method if follows else None, method if foretells else None)


def policy_of(config: RunConfig) -> KeyframePolicy:
    """The keyframe policy with its numbers, for one run.

    What a method loses is what it does not cover only where it knows the pixels in space: a chain of flows that never
    left the image, or the outline of a homography, says little about what is right (docs/keyframes.md).
    """
    return parse_policy(
        config.keyframes,
        rotation=config.keyframe_rotation,
        translation=config.keyframe_translation,
        time_ns=round(config.keyframe_time_s * 1e9),
        covers=PROPAGATIONS[config.propagation].needs.space,
    )


def truth_frames(log: Log) -> frozenset[int]:
    """Log indices of the frames that carry truth."""
    return frozenset(plan.index for plan in log.plans if plan.has_truth)


def _has_truth(log: Log) -> bool:
    return any(plan.has_truth for plan in log.plans)


def _oracle(log: Log) -> Model:
    if log.classes is None or not _has_truth(log):
        damage = log.info.damage
        raise ClassTableError(
            f"The oracle needs truth, but {log.info.name} has "
            f"{'no label channel' if log.info.choice.labels is None else 'no class table or no labelled frame'}"
            f"{f' (the log is damaged: {damage})' if damage.lossy else ''}; choose a network with --model."
        )
    segmenter = OracleSegmenter(lambda index: log.plans[index].has_truth, log.truth)
    return Model("oracle", None, log.classes, None, "", lambda threads, times: Memo(segmenter))


def settled(log: Log, config: RunConfig) -> RunConfig:
    """`config` with the propagation that `auto` means for this log."""
    if config.propagation != AUTO:
        return config
    return config.model_copy(update={"propagation": IN_THE_IMAGE if _lacking(log, config) else IN_SPACE})


def _lacking(log: Log, config: RunConfig) -> str | None:
    """The first thing that a propagation in space takes and no frame of the log has."""
    choice, camera = log.info.choice, log.camera
    lacking = {
        "depth": choice.depth is None, "pose": choice.pose is None and config.pose == "log",
        "camera": camera is None or camera.is_distorted,
    }  # fmt: skip
    return next((role for role, absent in lacking.items() if absent), None)


def _check_space(log: Log, config: RunConfig) -> None:
    """Raise ChannelError where the propagation takes what no frame of the log has."""
    if not _predicts_in_space(config):
        return
    if missing := _lacking(log, config):
        what = "calibrated camera without distortion" if missing == "camera" else f"{missing} channel"
        hint = "" if missing == "camera" else f"name one with --topic {missing}=TOPIC, or "
        raise ChannelError(
            f"--propagation {config.propagation} takes depth, poses and a calibrated camera, but {log.info.name} has "
            f"no {what} that can be used{_said_of(log, missing)}; {hint}choose another propagation.",
            missing,
        )


def _said_of(log: Log, role: str) -> str:
    """What the log's warnings say about `role`, in brackets."""
    return next((f" ({str(said).rstrip('.')})" for said in log.info.warnings if role in said), "")


def _check_depth(network: Network, log: Log) -> None:
    if network.has_depth and log.info.choice.depth is None:
        raise ChannelError(
            f"The network {network.name} takes depth, but {log.info.name} has no depth channel that can be used"
            f"{_said_of(log, 'depth')}; name one with --topic depth=TOPIC, or choose another network with --model.",
            "depth",
        )


def _meeting(network: ClassSet, log: Log, class_map: dict[str, str]) -> tuple[ClassSet, Labels, str]:
    """(classes of the run, translation into them, why accuracy cannot be measured)."""
    own: Labels = np.arange(256, dtype=np.uint8)
    if log.info.choice.labels is None:
        return network, own, "the log has no label channel"
    if log.classes is None:
        return network, own, "the labels of the log have no class table; give one with --classes"
    if not _has_truth(log):
        return network, own, "no frame in the window has truth"
    table = translation(network, log.classes, class_map)
    if (table[: len(network)] == NO_LABEL).all():
        return network, own, (
            f"the network ({', '.join(network.names)}) and the log ({', '.join(log.classes.names)}) have no class in "
            "common; say which are the same with --class-map"
        )  # fmt: skip
    return log.classes, table, ""


def _network_segmenter(
    network: Network, table: Labels, log: Log, config: RunConfig, threads: int, times: StageTimes
) -> Segmenter:
    inferencer = TimedInferencer(
        network, backend=config.backend, precision=config.precision, threads=threads, times=times
    )
    if config.costs == "measured":
        return NetworkSegmenter(inferencer, table)
    if not config.cache or config.repeat > 1:  # an answer read back would hide that the network does not repeat
        return Memo(NetworkSegmenter(inferencer, table))
    cache = OutputCache(cache_root(), log.info.sha256, inferencer.identity)
    return Memo(NetworkSegmenter(CachedInferencer(inferencer, cache), table))
