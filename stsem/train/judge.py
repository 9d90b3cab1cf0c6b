"""A network in training, judged by the metrics of the reports (stsem.metrics)."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from torch.nn.functional import interpolate

from stsem.classes import Labels
from stsem.inference.preprocess import labels_at, network_inputs
from stsem.inference.sidecar import Sidecar
from stsem.metrics.confusion import ConfusionMatrix
from stsem.models.network import SegmentationNetwork
from stsem.train.dataset import Pair, Pairs

_AHEAD = 16


def judge(
    network: SegmentationNetwork, sidecar: Sidecar, pairs: Pairs, *, device: str = "cpu", workers: int = 1,
    most: int | None = None,
) -> ConfusionMatrix:  # fmt: skip
    """The confusion matrix of the labelled frames of pairs, as the exported network would answer.

    Of a pair whose frames are both labelled the second is judged, with the first before it, as in a replay; where only
    the first is labelled, the second stands before it. So a frame of a log counts once.

    Args:
        network: put into evaluation mode here.
        sidecar: its size is what the network sees; labels are brought back to the images' size.
        pairs: with truth.
        device: where the network is.
        workers: threads, each with frames of its own; the result does not depend on it.
        most: at most so many pairs, spread over the data; None for all.
    """
    sidecar = sidecar.for_inputs(network.inputs)
    matrix = ConfusionMatrix(len(sidecar.classes))
    network.eval()
    count = len(pairs) if most is None else min(most, len(pairs))
    chosen = np.linspace(0, len(pairs) - 1, count).round().astype(int).tolist()

    def answered(index: int) -> list[tuple[Labels, Labels]]:
        pair = pairs.pair(index)
        return [(pair.labels[now], _answer(network, sidecar, pair, now, device)) for now in pair.labelled[-1:]]

    with ThreadPoolExecutor(workers, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        for begin in range(0, count, _AHEAD):  # so that answers do not pile up
            for answers in pool.map(answered, chosen[begin : begin + _AHEAD]):
                for truth, labels in answers:
                    matrix.update(truth, labels)
    return matrix


def _answer(network: SegmentationNetwork, sidecar: Sidecar, pair: Pair, now: int, device: str) -> Labels:
    """(H, W) uint8 labels of frame `now`."""
    image, depth = pair.images[now], None if pair.depths is None else pair.depths[now]
    inputs = network_inputs(image, pair.images[1 - now], sidecar, depth)
    with torch.inference_mode():
        probabilities = network(*(torch.from_numpy(inputs[name]).to(device) for name in network.inputs))
        full = interpolate(probabilities, size=sidecar.size[::-1], mode="bilinear", align_corners=True)
        labels = full.argmax(1)[0].to(torch.uint8).cpu().numpy()
    return labels_at(labels, (image.shape[1], image.shape[0]))
