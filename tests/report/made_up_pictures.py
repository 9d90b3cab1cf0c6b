"""Made-up pictures of an office: labels, an image of them, and answers that are a little wrong."""

import numpy as np

from stsem.chance import generator
from stsem.classes import NO_LABEL, ClassSet, Labels
from stsem.frame import Image
from stsem.report.inputs import StripFrame, UnsureFrame
from stsem.uncertainty import MEASURES, Uncertainty

CLASSES = (
    "bed",
    "books",
    "ceiling",
    "chair",
    "floor",
    "furniture",
    "objects",
    "painting",
    "sofa",
    "table",
    "tv",
    "wall",
    "window",
)


def strip_frame(index: int, truth: bool) -> StripFrame:
    """One frame of the strip, with answers that are a little wrong."""
    labels = scene(index)
    shift = 3 + index % 7
    keyframe = np.roll(labels, shift, axis=1)
    keyframe[:, :shift] = NO_LABEL
    answers = {"per-frame": _blurred(labels, index), "keyframe": _blurred(keyframe, index + 1000)}
    return StripFrame(index, picture(labels, index), labels if truth else None, answers, {"keyframe": index % 6})


def unsure_frame(index: int, truth: bool) -> UnsureFrame:
    """The network's own answer to a frame, and doubts that grow towards the right."""
    frame = strip_frame(index, truth)
    levels = np.broadcast_to(np.linspace(0, 200, 480).astype(np.uint8), (3, 270, 480))
    said = Uncertainty(MEASURES, levels, len(CLASSES))
    confidence = np.broadcast_to(np.linspace(1, 0.25, 480, dtype=np.float32), (270, 480))
    return UnsureFrame("per-frame", index, frame.image, frame.truth, frame.answers["per-frame"], confidence, said)


def scene(index: int) -> Labels:
    """(270, 480) labels of an office wall with a door, pictures, a table and a chair, moving with `index`."""
    labels = np.full((270, 480), CLASSES.index("wall"), np.uint8)
    labels[:40], labels[190:] = CLASSES.index("ceiling"), CLASSES.index("floor")
    boxes = (
        ("window", 60, 150, 60, 140),
        ("painting", 70, 120, 250, 300),
        ("furniture", 110, 210, 330, 400),
        ("tv", 75, 125, 170, 235),
        ("table", 160, 185, 90, 230),
        ("table", 185, 235, 95, 103),
        ("table", 185, 235, 217, 225),
        ("chair", 150, 230, 250, 300),
        ("objects", 145, 160, 130, 150),
        ("books", 100, 110, 345, 385),
    )
    for name, top, bottom, left, right in boxes:
        offset = (3 * index) % 90 - 40
        labels[top:bottom, max(0, left - offset) : max(0, right - offset)] = CLASSES.index(name)
    labels[262:, :] = NO_LABEL
    return labels


def picture(labels: Labels, index: int) -> Image:
    """A shaded, noisy picture of `labels`."""
    colours = np.array(ClassSet(CLASSES).palette(), np.float64)[labels] * 0.35 + 105
    shade = np.linspace(1.15, 0.7, 270)[:, None, None] * np.linspace(0.85, 1.1, 480)[None, :, None]
    noise = generator(5, index).normal(0, 6, labels.shape)[..., None]
    return np.clip(colours * shade + noise, 0, 255).astype(np.uint8)


def _blurred(labels: Labels, key: int) -> Labels:
    """`labels` with ragged edges, as a network draws them."""
    chance = generator(6, key)
    rows = np.clip(np.arange(270)[:, None] + chance.integers(-2, 3, (270, 480)), 0, 269)
    columns = np.clip(np.arange(480)[None, :] + chance.integers(-3, 4, (270, 480)), 0, 479)
    answer: Labels = labels[rows, columns]
    answer[answer == NO_LABEL] = CLASSES.index("floor")
    answer[200:222, 20:60] = CLASSES.index("chair")
    return answer
