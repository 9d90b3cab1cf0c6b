"""How much narrower colour sees than depth: the ratio of their focal lengths, where a log states one camera for both.

Depth alone gives a motion, and so the flow f that points of a keyframe should show; m is the flow that colour shows.
A wrong focal length scales all flow, so that s = sum f.m / sum m.m (least squares over frames) sets it right.
"""

import numpy as np

from stsem.slam.rotations import F64

ENOUGH = 40
"""Frames after which the ratio is settled."""
FIRST = 12
"""Frames from which it is used."""
MIN_FLOW_PX = 6.0
MIN_DEVIATION, MIN_SURENESS = 0.01, 4.0
"""A ratio nearer to 1, in itself or in its standard errors, is 1."""
UNKNOWN_SPREAD = 0.1
"""As long as nothing is known."""
FARTHEST = 0.25
"""A ratio farther from 1 is a mistake."""


class Zoom:
    """Estimates the ratio, frame by frame, until it is settled.

    Attributes:
        ratio: multiplies distances of colour's pixels from the principal point to make them depth's.
        spread: what is left of the difference, as a share of the flow: errors of registration that all points share.
        settled: they will not change any more.
    """

    def __init__(self) -> None:
        self.ratio, self.spread, self.settled = 1.0, UNKNOWN_SPREAD, False
        self._expected: list[F64] = []
        self._shown: list[F64] = []

    def add(self, expected: F64, shown: F64) -> None:
        """One frame: flow (n, 2) in pixels that the motion of depth expects, and that points show at the ratio 1."""
        if self.settled or len(shown) < 20:
            return
        f, m = np.median(expected, axis=0), np.median(shown, axis=0)
        if float(np.hypot(*m)) < MIN_FLOW_PX:
            return
        self._expected.append(f)
        self._shown.append(m)
        self.settled = len(self._shown) >= ENOUGH
        if len(self._shown) >= FIRST:
            self._estimate()

    def _estimate(self) -> None:
        f, m = np.array(self._expected), np.array(self._shown)
        of_frame = (f * m).sum(axis=1) / (m * m).sum(axis=1)
        usual = np.abs(of_frame - np.median(of_frame)) <= 3 * 1.4826 * np.median(np.abs(of_frame - np.median(of_frame)))
        f, m = f[usual], m[usual]
        ratio = float((f * m).sum() / (m * m).sum())
        error = float(np.sqrt(np.square(f - ratio * m).sum() / (2 * len(m) * (m * m).sum())))
        sure = abs(ratio - 1) > max(MIN_DEVIATION, MIN_SURENESS * error)
        self.ratio = ratio if sure and abs(ratio - 1) < FARTHEST else 1.0
        self.spread = float(np.sqrt(np.square(f - self.ratio * m).sum() / np.square(f).sum()))
