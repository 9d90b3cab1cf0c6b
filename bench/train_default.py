"""How the shipped network is made: train on rendered pairs, publish, judge. See docs/training.md for the commands.

python bench/train_default.py train   --pairs .scratch/pairs --checkpoint .scratch/a.pt --crop 329 185 --iterations 4000
python bench/train_default.py publish --checkpoint .scratch/a.pt --size 473 281 --out default.onnx
python bench/train_default.py judge   --network default --pairs .scratch/validation
python bench/train_default.py judge   --network default --log logs/office.mcap
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

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
from stsem.train.augment import Augmentation
from stsem.train.dataset import PairFolder, class_shares
from stsem.train.loop import Progress, Schedule, Training
from stsem.train.objective import Objective, class_weights
from stsem.train.publish import load_checkpoint, publish

ARCHITECTURE = "pspnet-r18-w4-w2"
MEAN, STD, SCALE = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225), 4.0


def _sidecar(size: tuple[int, int], note: str = "") -> Sidecar:
    return Sidecar(size, MEAN, STD, OFFICE, Difference(SCALE), note)


def _train(args: argparse.Namespace) -> None:
    set_threads(1)
    torch.set_num_threads(1)  # the workers are the parallelism
    pairs = PairFolder(args.pairs, args.prefix)
    crop = tuple(args.crop)
    schedule = Schedule(
        args.iterations, batch=args.batch, rate=args.rate, warm_up=args.warm_up, seed=args.seed, workers=args.threads
    )
    objective = Objective(class_weights(class_shares(pairs, len(OFFICE))), bf16=args.bf16)
    how = Augmentation(crop, tuple(args.scales), plain=args.plain)
    training = Training(args.architecture, _sidecar(crop), objective, how, schedule)
    if args.checkpoint.is_file():
        training.resume(args.checkpoint)
    elif args.init:
        training.start_from(args.init)
    print(f"{len(pairs)} pairs, from iteration {training.iteration}", flush=True)
    begun, first = hostclock.wall_ns(), training.iteration

    def report(now: Progress) -> None:
        seconds = (hostclock.wall_ns() - begun) / 1e9
        left = seconds / (now.iteration - first) * (now.iterations - now.iteration)
        where = f"{now.iteration}/{now.iterations} loss {now.loss:.4f} rate {now.rate:.2e}"
        print(f"{where}, {seconds:.0f} s, {left:.0f} s left", flush=True)

    training.run(pairs, args.checkpoint, report)


def _publish(args: argparse.Namespace) -> None:
    network = load_checkpoint(args.checkpoint, len(OFFICE))
    args.out.parent.mkdir(parents=True, exist_ok=True)
    print(publish(network, _sidecar(tuple(args.size), args.note), args.out).sha256)


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
    return _of_log(args.log) if args.log else _of_pairs(args.pairs, args.prefix)


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
    train = verbs.add_parser("train")
    train.set_defaults(run=_train)
    train.add_argument("--architecture", default=ARCHITECTURE)
    train.add_argument("--init", type=Path, help="begin with the weights of this checkpoint")
    train.add_argument("--crop", type=int, nargs=2, default=(329, 185))
    train.add_argument("--scales", type=float, nargs=2, default=(1.0, 2.0))
    train.add_argument("--iterations", type=int, required=True)
    train.add_argument("--batch", type=int, default=8)
    train.add_argument("--rate", type=float, default=2e-3)
    train.add_argument("--warm-up", type=int, default=200)
    train.add_argument("--seed", type=int, default=0)
    train.add_argument("--bf16", action="store_true")
    train.add_argument("--plain", action="store_true")
    export = verbs.add_parser("publish")
    export.set_defaults(run=_publish)
    export.add_argument("--size", type=int, nargs=2, default=(473, 281))
    export.add_argument("--out", type=Path, required=True)
    export.add_argument("--note", default="")
    judge = verbs.add_parser("judge")
    judge.set_defaults(run=_judge)
    judge.add_argument("--network", default="default")
    streams = verbs.add_parser("streams")
    streams.set_defaults(run=_streams)
    streams.add_argument("--size", type=int, nargs=2, default=(473, 281))
    for verb in (judge, streams):
        verb.add_argument("--log", type=Path)
    for verb in (train, export, streams):
        verb.add_argument("--checkpoint", type=Path, required=True)
    for verb in (train, judge, streams):
        verb.add_argument("--pairs", type=Path)
        verb.add_argument("--prefix", default="")
        verb.add_argument("--threads", type=int, default=2)
    return parser.parse_args()


if __name__ == "__main__":
    given = _arguments()
    given.run(given)
