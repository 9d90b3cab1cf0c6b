"""How right the answers are: scores, the split of the loss, by distance, by stratum."""

from pydantic import Field

from stsem.document.part import Count, Number, Part, Share


class Score(Part):
    """One confusion matrix, summed over all scored pixels of the run, and what follows from it (DESIGN 4)."""

    miou: Share = None
    """Mean of the IoU over the classes that have truth pixels; IoU = TP / (TP + FP + FN). Fraction."""
    miou_union: Share = None
    """As `miou`, but classes that are predicted and have no truth pixel count as 0. Fraction."""
    pixel_accuracy: Share = None
    """Right pixels over all scored pixels; a pixel without a label is wrong. Fraction."""
    classes_averaged: Count = 0
    """Number of classes that `miou` averages: those with truth pixels."""
    pixels: Count = 0
    """Scored pixels: those whose truth is not "ignore" (255)."""
    iou: dict[str, Share] = Field(default_factory=dict)
    """IoU of each class of the log; null for a class without truth pixels. Fraction."""
    misses: Count = 0
    """Scored frames without any answer to judge; all their pixels are wrong."""
    n: Count = 0
    """Frames with truth that were scored."""
    miou_common: Share = None
    """`miou` over the classes that the network and the log have in common. Fraction."""
    classes_common: Count = 0
    """Number of classes that `miou_common` averages."""
    class_pixels: dict[str, Count] = Field(default_factory=dict)
    """Truth pixels of each class: the basis of its IoU."""
    unlabelled_share: Share = None
    """Share of the scored pixels that got no label. Fraction."""


class LossParts(Part):
    """One number per part of the loss."""

    network: Count = 0
    """Frames behind the network's part."""
    prediction: Count = 0
    """Frames behind the prediction's part."""
    scheduling: Count = 0
    """Frames behind the scheduling's part."""
    staleness: Count = 0
    """Frames behind the staleness' part."""


class Loss(Part):
    """Where mIoU is lost on the way from 1 to the streaming score; the four parts add up exactly (DESIGN 4)."""

    network: Number = None
    """1 - offline mIoU of `per-frame`: what the network itself gets wrong. Fraction."""
    prediction: Number = None
    """Offline mIoU of `per-frame` minus that of this mode: what predicting instead of segmenting costs. Fraction."""
    scheduling: Number = None
    """Offline mIoU of this mode minus delivered: what other keyframes, and longer distances to them, cost. Fraction."""
    staleness: Number = None
    """Delivered mIoU minus streaming mIoU: what the world's moving on until an answer is there costs. Fraction."""
    n: LossParts = Field(default_factory=LossParts)
    """Scored frames behind the scarcer of the two scores of each part."""
    why: dict[str, str] = Field(default_factory=dict)
    """For each part that is null: why it was not measured."""


class DistanceRow(Part):
    """Accuracy of the frames at one distance from their keyframe."""

    frames: Count
    """Distance to the keyframe as a difference of log indices; 0 is the keyframe itself."""
    ms: Number = None
    """Mean time since the keyframe over these frames, milliseconds of capture time."""
    miou: Share = None
    """mIoU of the frames at this distance, as in `Score`. Fraction."""
    pixel_accuracy: Share = None
    """Pixel accuracy of the frames at this distance. Fraction."""
    n: Count = 0
    """Scored frames at this distance."""
    covered: Share = None
    """Share of the scored pixels that rest on evidence; null where the method does not say. Fraction."""
    covered_miou: Share = None
    """mIoU over those pixels alone. Fraction."""
    covered_pixel_accuracy: Share = None
    """Pixel accuracy over those pixels alone. Fraction."""


class DistanceSummary(Part):
    """Mean and minimum over the distances that have enough frames."""

    miou_mean: Share = None
    """Plain mean of `miou` over the distances with at least `min_frames` scored frames. Fraction."""
    miou_min: Share = None
    """Smallest `miou` over those distances. Fraction."""
    pixel_accuracy_mean: Share = None
    """Plain mean of the pixel accuracy over those distances. Fraction."""
    pixel_accuracy_min: Share = None
    """Smallest pixel accuracy over those distances. Fraction."""
    distances: Count = 0
    """How many distances have enough frames."""
    min_frames: Count = 10
    """Scored frames that a distance needs to be counted here."""


class Coverage(Part):
    """How much of the log the accuracy speaks for."""

    frames_with_truth: Count
    """Frames of the log that carry truth."""
    scored: Count
    """Frames whose answer was judged in this run (the pass with the most of them)."""
    frames: Count
    """Frames of the log, or of the chosen window."""


class Consistency(Part):
    """Temporal consistency of the answers."""

    score: Share = None
    """mIoU between each answer and the previous one carried into its frame, one matrix over all pairs. Fraction."""
    correspondence: str = ""
    """How the previous answer is carried into the frame: `identity` or `homography`."""
    pairs: Count = 0
    """Pairs of consecutive answers compared."""
