"""The straight line of `stsem train`: plan, read, train stage by stage, export, say how to replay."""

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from stsem.classes import NO_LABEL, ClassSet
from stsem.cli.console import note, progress
from stsem.cli.recordings import check_once, recordings
from stsem.cli.stagebar import drawn, shown, stopping_in_order
from stsem.cli.training_plan import Wanted, chosen_recipe, chosen_stages, parse_size
from stsem.errors import TrainingStoppedError, UsageError
from stsem.inference.network import Network
from stsem.inference.sidecar import Difference, Sidecar
from stsem.inference.threads import set_threads
from stsem.log.classtable import read_class_map
from stsem.log.container.source import without_secrets
from stsem.models.network import SegmentationNetwork
from stsem.models.zoo import build
from stsem.replay.settings import parse_topics
from stsem.report.wording import plural
from stsem.train.dataset import Pairs
from stsem.train.job import Job, Stage, stages_of
from stsem.train.machine import machine
from stsem.train.publish import load_checkpoint, publish
from stsem.train.recipe import Recipe
from stsem.train.sources import Reading, Source, classes_of, join, open_source
from stsem.train.stages import CHECKPOINT, finished, train_stage
from stsem.train.starts import given_weights

MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of ImageNet's images, RGB in 0..1: what weights from elsewhere expect."""
DIFFERENCE_SCALE = 4.0


@dataclass(frozen=True, eq=False)
class Read:
    """The data, opened.

    Args:
        classes: of the network.
        pairs, validation: with labels in ids of `classes`.
        size: (width, height) of the first image.
    """

    classes: ClassSet
    pairs: Pairs
    validation: Pairs | None
    size: tuple[int, int]


def train_all(wanted: Wanted) -> int:
    """Train, or go on; every error is one sentence.

    Raises:
        StsemError: something cannot be.
    """
    stages = chosen_stages(wanted)
    job = Job(wanted.architecture, "fused", _sidecar_like(wanted), chosen_recipe(wanted), wanted.seed,
              machine=machine(wanted.device, wanted.precision, wanted.workers))  # fmt: skip
    set_threads(1)
    try:
        read = _read(wanted, stages[-1][1])
        job = _fitted(wanted, job, read, stages[-1][1])
        checkpoint = _train(wanted, job, read, stages)
        note("Exporting the network.")
        published = _publish(wanted, job, checkpoint, stages[-1][1])
    except KeyboardInterrupt as err:
        raise TrainingStoppedError(f"Stopped; the same command goes on from what is in {wanted.out}.") from err
    except TrainingStoppedError as err:
        raise TrainingStoppedError(f"{err} The same command goes on from there.") from err
    _print(published, wanted)
    return 0


def _sidecar_like(wanted: Wanted) -> Sidecar:
    """Before the data is known: one class, any size."""
    size = (1, 1) if wanted.size is None else parse_size(wanted.size, "--size")
    return Sidecar(size, MEAN, STD, ClassSet(("unknown",)), Difference(DIFFERENCE_SCALE))


def _read(wanted: Wanted, architecture: str) -> Read:
    check_once((*wanted.data, *wanted.validation))
    class_map = read_class_map(wanted.class_map) if wanted.class_map else {}
    depth = "depth" in build(architecture, 2).inputs
    sources, others = (_open_all(wanted, given, depth=depth) for given in (wanted.data, wanted.validation))
    classes = classes_of(sources, class_map)
    prints = {one.pairs.fingerprint for one in sources}
    if twice := [one.name for one in others if one.pairs.fingerprint in prints]:
        raise UsageError(f"{twice[0]} is to be trained on and validated with; validate with other data.")
    if not others:
        note("No validation data was given (--validation): nothing will tell whether the network knows more than "
             "what it was trained on.")  # fmt: skip
    pairs = join(sources, classes, class_map)
    note(f"{plural(len(pairs), 'pair')} of {plural(len(sources), 'data set')}, "
         f"{plural(len(classes), 'class')}.")  # fmt: skip
    validation = join(others, classes, class_map) if others else None
    if validation is not None and not any(_has_truth(validation, index) for index in range(len(validation))):
        raise UsageError("No pixel of the validation data has a label that is learned; give data with truth.")
    return Read(classes, pairs, validation, sources[0].size)


def _has_truth(pairs: Pairs, index: int) -> bool:
    return bool((pairs.pair(index).labels != NO_LABEL).any())


def _open_all(wanted: Wanted, given: Sequence[str], *, depth: bool) -> list[Source]:
    sources = []
    for parts in recordings(given):
        with progress(f"Decoding {Path(parts[0]).name}") as step:
            how = Reading(wanted.out / "frames", wanted.classes, depth, parse_topics(list(wanted.topics)) or None, step)
            sources.append(open_source(parts, how))
        for line in sources[-1].notes:
            note(f"Note: {line}")
    return sources


def _fitted(wanted: Wanted, job: Job, read: Read, architecture: str) -> Job:
    """The job with the classes of the data, and with sizes that suit the network."""
    network, recipe = build(architecture, len(read.classes)), job.recipe
    crop = _nearest(network, recipe.crop)
    if crop != recipe.crop:
        note(f"The crop {recipe.crop[0]}x{recipe.crop[1]} becomes {crop[0]}x{crop[1]}: the sides of {architecture} are "
             f"{network.side_rule}.")  # fmt: skip
    size = job.sidecar.size if wanted.size else _nearest(network, _usual_size(recipe, read.size))
    if size != _nearest(network, size):
        raise UsageError(f"--size {wanted.size} does not fit {architecture}, whose sides are {network.side_rule}; use "
                         "{}x{}.".format(*_nearest(network, size)))  # fmt: skip
    if recipe.pretrained and wanted.weights is None:
        note(f"The recipe {recipe.name} presumes weights that were trained elsewhere (--weights FILE), and none were "
             "given: expect little of it, or take --recipe scratch.")  # fmt: skip
    return replace(
        job, recipe=replace(recipe, crop=crop), sidecar=replace(job.sidecar, size=size, classes=read.classes)
    )


def _nearest(network: SegmentationNetwork, size: tuple[int, int]) -> tuple[int, int]:
    return network.nearest_side(size[0]), network.nearest_side(size[1])


def _usual_size(recipe: Recipe, image: tuple[int, int]) -> tuple[int, int]:
    """The image at the middle of the scales that the network is trained on."""
    middle = math.sqrt(recipe.scales[0] * recipe.scales[1])
    width = image[0] * middle if recipe.of_image else recipe.crop[0] * middle
    return round(width), round(width * image[1] / image[0])


def _train(wanted: Wanted, job: Job, read: Read, stages: Sequence[tuple[Stage, str]]) -> Path:
    """The checkpoint of the last stage."""
    done = _done_before(wanted, job, [stage for stage, _ in stages])
    for stage, architecture in stages:
        starts = _starts(wanted, stage, architecture, done)
        this = replace(job, architecture=architecture, stage=stage, starts=starts)
        if "weights" in starts:
            network = build(architecture, len(read.classes))
            for line in given_weights(network, this, this.sidecar.for_inputs(network.inputs)).lines():
                note(f"{wanted.weights}: {line}")
        folder = wanted.out / stage
        with shown(this) as report, stopping_in_order() as stopping, drawn(folder) as draw:
            done[stage] = train_stage(
                this, read.pairs, read.validation, folder, lambda now: draw(report(now)), stopping
            )
    return done[stages[-1][0]]


def _done_before(wanted: Wanted, job: Job, stages: Sequence[Stage]) -> dict[str, Path]:
    """The colour stream that an earlier command finished in this folder, where a difference stream is to be trained."""
    known = dict(stages_of(wanted.architecture))
    if "difference" not in stages or "colour" in stages or "colour" not in known:
        return {}
    weights = {} if wanted.weights is None else {"weights": wanted.weights}
    colour = finished(replace(job, architecture=known["colour"], stage="colour", starts=weights), wanted.out / "colour")
    if colour is None:
        return {}
    note(f"The colour stream is the finished one in {colour}.")
    return {"colour": colour}


def _starts(wanted: Wanted, stage: Stage, architecture: str, done: dict[str, Path]) -> dict[str, Path]:
    """What a stage begins with: the stages before it, else the weights that were given."""
    if stage == "fused" and {"colour", "difference"} <= done.keys():
        return dict(done)
    if stage == "difference" and "colour" in done:
        if dict(stages_of(wanted.architecture))["colour"].replace("-spatial", "-temporal") == architecture:
            return dict(done)
        note("The difference stream has another width than the colour stream, so it begins with random weights.")
        return {}
    if wanted.weights is not None:
        return {"weights": wanted.weights}
    known = [name for name, _ in stages_of(wanted.architecture)]
    if before := known[: known.index(stage)]:
        there = [name for name in before if (wanted.out / name / CHECKPOINT).exists()]
        but = f", and what {wanted.out} has of it is not finished, or of another training" if there else ""
        note(f"The stage {stage} begins with random weights: --stages leaves out {' and '.join(before)}{but}.")
    return {}


def _publish(wanted: Wanted, job: Job, checkpoint: Path, architecture: str) -> Network:
    network = load_checkpoint(checkpoint, len(job.sidecar.classes))
    words = f"{architecture}, trained with recipe {job.recipe.name}, seed {job.seed}"
    return publish(
        network, replace(job.sidecar.for_inputs(network.inputs), note=words), wanted.out / f"{architecture}.onnx"
    )


def _print(published: Network, wanted: Wanted) -> None:
    width, height = published.size
    size = published.path.stat().st_size / 1e6
    log = next((name for name in (*wanted.validation, *wanted.data) if name.endswith(".mcap")), "LOG")
    command = shlex.join(["stsem", "replay", without_secrets(log), "--model", str(published.path)])
    print(f"Network: {published.path} ({size:.1f} MB, {plural(len(published.classes), 'class')}, {width}x{height})")
    print(f"Replay:  {command}")
