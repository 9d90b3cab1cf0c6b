"""Whether a run knows when it is wrong: calibration of its confidence, and what its measures of uncertainty find."""

from typing import Literal

from pydantic import Field

from stsem.document.part import Count, Part, Share

Judged = Literal["offline", "delivered"]


class ReliabilityBin(Part):
    """The pixels of one bin of the confidence."""

    lower: Share
    """Lower edge, exclusive but for the first bin. Fraction."""
    upper: Share
    """Upper edge, inclusive. Fraction."""
    pixels: Count = 0
    """Judged pixels in it."""
    confidence: Share = None
    """Mean confidence of these pixels; null without any. Fraction."""
    accuracy: Share = None
    """Share of these pixels that are right; null without any. Fraction."""


class Calibration(Part):
    """How well the stated confidence agrees with the share of right pixels, over one part of the answers."""

    judged: Judged
    """The pass whose answers were judged."""
    ece: Share = None
    """Expected calibration error: |accuracy - mean confidence| of 15 bins, weighted by pixels. Fraction."""
    mce: Share = None
    """Maximum calibration error: the largest of those differences, however few pixels its bin has. Fraction."""
    confidence: Share = None
    """Mean confidence of the judged pixels. Fraction."""
    accuracy: Share = None
    """Share of the judged pixels that are right; above `confidence`, the network is too modest. Fraction."""
    pixels: Count = 0
    """Judged pixels."""
    n: Count = 0
    """Frames with truth and a stated confidence."""
    bins: tuple[ReliabilityBin, ...] = ()
    """The 15 equal bins of the confidence, ascending."""


class ErrorDetection(Part):
    """How well measures of uncertainty tell wrong pixels from right ones, over frames segmented by the network."""

    judged: Judged
    """The pass whose answers were judged."""
    auc: dict[str, Share] = Field(default_factory=dict)
    """Area under the ROC curve of each measure: the chance that a wrong pixel gets a higher value than a right one. \
0.5 is no better than a coin; null without wrong, or without right pixels."""
    wrong_share: Share = None
    """Share of the judged pixels that are wrong. Fraction."""
    pixels: Count = 0
    """Judged pixels."""
    n: Count = 0
    """Segmented frames with truth."""
