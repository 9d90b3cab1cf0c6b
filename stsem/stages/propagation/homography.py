"""One homography for the whole image: from the keyframe at once (equation 2), or frame by frame."""

from dataclasses import dataclass

import cv2
import numpy as np

from stsem.frame import Frame, Segmentation
from stsem.geometry.homography import Matrix3, is_sane
from stsem.geometry.warp import warp_covered, warp_extended
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagation.hold import uncovered
from stsem.stages.propagation.method import Memoryless, Needs, Predicted
from stsem.stages.register import Anchor, Registration, between

LOST = "no homography"


@dataclass(frozen=True)
class _Outline:
    """A selected keyframe: its log index and the (width, height) of its image."""

    index: int
    size: tuple[int, int]


class HomographyWarp(Memoryless):
    """Warps the keyframe's labels by the homography from it; what it does not cover gets the label of its border.

    That is right more often than the same pixel of the keyframe, or no label (docs/propagation.md). Without a
    trustworthy homography the whole keyframe is copied.

    Args:
        seed: of the robust estimation.
    """

    needs = Needs(points=True)

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._newest: _Outline | None = None

    def selected(self, frame: Frame, registration: Registration | None) -> None:
        """Its outline is kept, to foretell coverage."""
        self._newest = _Outline(frame.index, frame.size)

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """Warped labels, extended at the border of the keyframe."""
        return _warped(source, frame, self._from(source, frame, registration))

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        """The share of the image that the outline of the newest keyframe, mapped, fills."""
        newest = self._newest
        found = None if newest is None else registration.homographies.get(newest.index)
        return _filled(newest, frame, None if found is None else found.H)

    def _from(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Matrix3 | None:
        if registration is None:
            return None
        if source.index in registration.homographies:
            found = registration.homographies[source.index]
        elif source.features is None or registration.features is None:
            return None
        else:  # the keyframe was finished after this frame had been registered
            anchor = Anchor(source.index, source.features)
            found = between(anchor, frame.index, registration.features, self._seed)
        return None if found is None else found.H


class ChainedHomography:
    """The same by the product of the homographies between the frames since; a link that fails breaks the chain.

    From a broken chain the whole keyframe is copied.

    Args:
        seed: of the robust estimation.
    """

    needs = Needs(points=True, follows=True)

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._last: Anchor | None = None
        self._chains: dict[int, Matrix3 | None] = {}
        self._newest: _Outline | None = None

    def see(self, frame: Frame, registration: Registration) -> None:
        """One link more in every chain."""
        link = self._link(frame, registration) if self._chains else None
        self._chains = {index: _product(link, H, frame.size) for index, H in self._chains.items()}
        self._last = None if registration.features is None else Anchor(frame.index, registration.features)

    def selected(self, frame: Frame, registration: Registration | None) -> None:
        """A chain begins."""
        self._chains[frame.index] = np.eye(3)
        self._newest = _Outline(frame.index, frame.size)

    def finished(self, keyframe: Keyframe) -> None:
        """See `Propagation.finished`."""

    def forgotten(self, index: int) -> None:
        """Its chain is let go."""
        self._chains.pop(index, None)

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """Warped labels, extended at the border of the keyframe."""
        return _warped(source, frame, self._chains.get(source.index))

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        """The share of the image that the outline of the newest keyframe, mapped, fills."""
        newest = self._newest
        return _filled(newest, frame, None if newest is None else self._chains.get(newest.index))

    def _link(self, frame: Frame, registration: Registration) -> Matrix3 | None:
        """From the frame before to this one."""
        last = self._last
        if last is None or registration.features is None:
            return None
        if last.index in registration.homographies:
            found = registration.homographies[last.index]
        else:
            found = between(last, frame.index, registration.features, self._seed)
        return None if found is None else found.H


def _product(link: Matrix3 | None, chain: Matrix3 | None, size: tuple[int, int]) -> Matrix3 | None:
    """`link` after `chain`, H33 = 1; None if either is missing, or if they cannot show the image from its front."""
    if link is None or chain is None:
        return None
    # Written out: BLAS may round differently with other thread counts.
    H: Matrix3 = (link[:, :, None] * chain[None, :, :]).sum(axis=1)
    return H / H[2, 2] if is_sane(H, *size) else None


def _warped(source: Keyframe, frame: Frame, H: Matrix3 | None) -> Predicted:
    segmentation = source.segmentation
    if H is None:
        return Predicted(uncovered(segmentation, frame.size), source.index, LOST)
    labels, sure = warp_extended(segmentation.labels, H, frame.size), segmentation.confidence
    confidence = None if sure is None else warp_extended(sure, H, frame.size)
    covered = warp_covered(segmentation.labels.shape, H, frame.size)
    return Predicted(Segmentation(labels, confidence, covered=covered), source.index)


def _filled(keyframe: _Outline | None, frame: Frame, H: Matrix3 | None) -> float:
    """Share of the image that the outline of the keyframe fills, 0..1; 0 without a homography."""
    if keyframe is None or H is None:
        return 0.0
    (width, height), (w, h) = keyframe.size, frame.size
    outline = np.array([[[0, 0], [width, 0], [width, height], [0, height]]], np.float64) - 0.5
    mapped = cv2.perspectiveTransform(outline, H)[0].astype(np.float32)
    image = np.array([[0, 0], [w, 0], [w, h], [0, h]], np.float32) - np.float32(0.5)
    area, _ = cv2.intersectConvexConvex(mapped, image)
    return min(1.0, max(0.0, area / (w * h)))
