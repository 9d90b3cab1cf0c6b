"""How the shipped network is published and judged; `stsem train` trains it. See docs/training.md for the commands.

python bench/train_default.py publish --checkpoint .scratch/a/fused/checkpoint.pt --size 713 425 --passes 4 --out a.onnx
python bench/train_default.py judge   --network default --pairs .scratch/validation
python bench/train_default.py judge   --network default --log logs/office.mcap --reduced 240 135
python bench/train_default.py passes  --networks with.onnx without.onnx --log logs/office.mcap
"""

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import torch
from torch.nn.functional import interpolate

from stsem import hostclock
from stsem.classes import Labels
from stsem.frame import Frame, Image
from stsem.inference.inferencer import Inferencer, segmentation
from stsem.inference.network import load_network
from stsem.inference.preprocess import labels_at, network_inputs
from stsem.inference.sidecar import Difference, Sidecar
from stsem.inference.threads import set_threads
from stsem.log.log import open_log
from stsem.metrics.confusion import ConfusionMatrix
from stsem.models.two_stream import PredictionFusion, prediction_sum
from stsem.synth.vocabulary import OFFICE
from stsem.train.dataset import PairFolder
from stsem.train.publish import load_checkpoint, publish

MEAN, STD, SCALE = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225), 4.0


def _sidecar(size: tuple[int, int], note: str = "") -> Sidecar:
    return Sidecar(size, MEAN, STD, OFFICE, Difference(SCALE), note)


def _publish(args: argparse.Namespace) -> None:
    network = load_checkpoint(args.checkpoint, len(OFFICE))
    args.out.parent.mkdir(parents=True, exist_ok=True)
    print(publish(network, _sidecar(tuple(args.size), args.note), args.out, passes=args.passes).sha256)


Sample = tuple[Image, Image | None, Labels]


def _of_pairs(folder: Path, prefix: str) -> Iterator[Sample]:
    pairs = PairFolder(folder, prefix)
    for index in range(len(pairs)):
        pair = pairs.pair(index)
        yield pair.images[1], pair.images[0], pair.labels[1]


def _of_log(path: Path) -> Iterator[Sample]:
    with open_log([path]) as log:
        for loaded in log.frames(range(len(log.plans)), depth=False, previous=True, truth=True):
            if loaded.frame is not None and loaded.truth is not None:
                yield loaded.frame.image, loaded.frame.previous, loaded.truth


def _samples(args: argparse.Namespace) -> Iterator[Sample]:
    samples = _of_log(args.log) if args.log else _of_pairs(args.pairs, args.prefix)
    return (_reduced(sample, tuple(args.reduced)) for sample in samples) if args.reduced else samples


def _reduced(sample: Sample, size: tuple[int, int]) -> Sample:
    """As a smaller camera would see it: the mean of the pixels that it merges, and the label of the middle one."""
    image, previous, truth = sample
    small, before = (None if x is None else np.asarray(cv2.resize(x, size, interpolation=cv2.INTER_AREA), np.uint8)
                     for x in (image, previous))  # fmt: skip
    assert small is not None
    return small, before, labels_at(truth, size)


def _show(name: str, matrix: ConfusionMatrix) -> None:
    scores = matrix.compute()
    print(f"{name}: mIoU {scores.miou:.2%} over {scores.classes_averaged} classes, "
          f"pixel accuracy {scores.pixel_accuracy:.2%}")  # fmt: skip
    print("  ".join(f"{name} {iou:.3f}" for name, iou in zip(OFFICE.names, scores.iou, strict=True)))


def _judge(args: argparse.Namespace) -> None:
    set_threads(1)
    inferencer = Inferencer(load_network(args.network), threads=args.threads)
    matrix = ConfusionMatrix(len(OFFICE))
    spent = []
    for image, previous, truth in _samples(args):
        begun = hostclock.wall_ns()
        output = inferencer.compute(Frame(0, 0, image, previous))
        spent.append(hostclock.wall_ns() - begun)
        matrix.update(truth, segmentation(output, (image.shape[1], image.shape[0])).labels)
    _show(f"{args.network}, {len(spent)} frames, median {np.median(spent) / 1e6:.0f} ms", matrix)


def _passes(args: argparse.Namespace) -> None:
    """What a pass through each graph takes on one thread, in turn on the same frames: the medians may be compared."""
    set_threads(1)
    runs = {path: Inferencer(load_network(path), threads=1) for path in args.networks}
    spent: dict[str, list[int]] = {path: [] for path in runs}
    for number, (image, previous, _) in enumerate(_samples(args)):
        for path, inferencer in runs.items():
            begun = time.process_time_ns()
            inferencer.compute(Frame(number, 0, image, previous))
            spent[path].append(time.process_time_ns() - begun)
    for path, samples in spent.items():
        print(f"{path}: median {np.median(samples) / 1e6:.1f} ms of CPU time, {len(samples)} frames")


def _streams(args: argparse.Namespace) -> None:
    """The fused answer beside each stream's own, in torch."""
    torch.set_num_threads(args.threads)
    network, sidecar = load_checkpoint(args.checkpoint, len(OFFICE)), _sidecar(tuple(args.size))
    assert isinstance(network, PredictionFusion)
    matrices = {name: ConfusionMatrix(len(OFFICE)) for name in ("fused", "colour", "difference")}
    for image, previous, truth in _samples(args):
        inputs = {name: torch.from_numpy(value) for name, value in network_inputs(image, previous, sidecar).items()}
        with torch.no_grad():
            colour = network.colour(inputs["image"]).softmax(1)
            difference = network.difference(inputs["difference"]).softmax(1)
        fused = prediction_sum(colour, difference)
        for name, probabilities in zip(matrices, (fused, colour, difference), strict=True):
            full = interpolate(probabilities, size=tuple(args.size)[::-1], mode="bilinear", align_corners=True)
            labels = full.argmax(1)[0].to(torch.uint8).numpy()
            matrices[name].update(truth, labels_at(labels, (image.shape[1], image.shape[0])))
    for name, matrix in matrices.items():
        _show(name, matrix)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True)
    export = verbs.add_parser("publish")
    export.set_defaults(run=_publish)
    export.add_argument("--size", type=int, nargs=2, default=(473, 281))
    export.add_argument("--out", type=Path, required=True)
    export.add_argument("--note", default="")
    export.add_argument("--passes", type=int, default=0, help="of Monte Carlo dropout, for maps of uncertainty")
    judge = verbs.add_parser("judge")
    judge.set_defaults(run=_judge)
    judge.add_argument("--network", default="default")
    streams = verbs.add_parser("streams")
    streams.set_defaults(run=_streams)
    streams.add_argument("--size", type=int, nargs=2, default=(473, 281))
    passes = verbs.add_parser("passes")
    passes.set_defaults(run=_passes)
    passes.add_argument("--networks", nargs="+", required=True)
    for verb in (judge, streams, passes):
        verb.add_argument("--log", type=Path)
        verb.add_argument("--reduced", type=int, nargs=2, help="width and height to reduce images and truth to")
    for verb in (export, streams):
        verb.add_argument("--checkpoint", type=Path, required=True)
    for verb in (judge, streams, passes):
        verb.add_argument("--pairs", type=Path)
        verb.add_argument("--prefix", default="")
        verb.add_argument("--threads", type=int, default=2)
    return parser.parse_args()


if __name__ == "__main__":
    given = _arguments()
    given.run(given)
