"""The plane-to-plane mapping between two views (equation 2 of the paper), and how far it moves the image.

H maps pixels of the keyframe to pixels of the current frame, H33 = 1.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stsem.geometry.features import Features

Matrix3 = npt.NDArray[np.float64]
"""(3, 3) float64."""
Points = npt.NDArray[np.float32]
"""(n, 2) float32 pixels."""

MIN_POINTS = 4
CONFIDENCE = 0.999
MAX_ITERATIONS = 2000


@dataclass(frozen=True, eq=False)
class Homography:
    """A trustworthy mapping from keyframe to current frame.

    Args:
        H: (3, 3) float64, keyframe pixels to current pixels, H33 = 1.
        inliers: matches that agree with it.
        matches: matches it was estimated from.
    """

    H: Matrix3
    inliers: int
    matches: int

    @property
    def inlier_share(self) -> float:
        """Share of the matches that agree, in 0..1."""
        return self.inliers / self.matches


def match(keyframe: Features, current: Features, *, max_ratio: float = 0.8) -> tuple[Points, Points]:
    """Points of the keyframe and their partners in the current frame, both (m, 2).

    Args:
        keyframe, current: points of the two images.
        max_ratio: the best partner must be nearer than this times the second best (Lowe 2004, section 7.1).
    """
    if len(keyframe) < 2 or len(current) < 2:
        return np.empty((0, 2), np.float32), np.empty((0, 2), np.float32)
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(keyframe.descriptors, current.descriptors, k=2)
    good = [best for best, second in pairs if best.distance < max_ratio * second.distance]
    return keyframe.xy[[pair.queryIdx for pair in good]], current.xy[[pair.trainIdx for pair in good]]


def estimate(
    keyframe: Features,
    current: Features,
    *,
    seed: int,
    threshold: float = 2.5,
    min_inliers: int = 16,
    min_inlier_share: float = 0.25,
) -> Homography | None:
    """The homography between two views by MAGSAC++ (Barath et al. 2020); None when none can be trusted.

    Args:
        keyframe, current: points of the two images.
        seed: of this job, 0 to 2^31 - 1 (`chance.hash31`); same points and seed, same bits.
        threshold: largest distance of an inlier, in pixels of the image that was searched (`Features.working_pixel`).
        min_inliers, min_inlier_share: less is not trusted. Unrelated images reached 15 inliers.
    """
    from_xy, to_xy = match(keyframe, current)
    if len(from_xy) < max(min_inliers, MIN_POINTS):
        return None
    found, mask = cv2.findHomography(from_xy, to_xy, _magsac(seed, threshold * current.working_pixel))
    inliers = int(np.count_nonzero(mask))
    if found is None or inliers < max(min_inliers, min_inlier_share * len(from_xy)):
        return None
    H = np.asarray(found, np.float64)
    if not is_sane(H, keyframe.width, keyframe.height):
        return None
    return Homography(H / H[2, 2], inliers, len(from_xy))


def is_sane(H: Matrix3, width: int, height: int, *, max_area_ratio: float = 16.0) -> bool:
    """Whether H shows the image from its front: all corners before the horizon, their order kept, the area plausible.

    Args:
        H: (3, 3), any scale.
        width, height: of the image it maps.
        max_area_ratio: how much larger or smaller the mapped image may be.
    """
    if not np.isfinite(H).all() or abs(H[2, 2]) < 1e-9:
        return False
    corners = np.array([[0, 0, 1], [width - 1, 0, 1], [width - 1, height - 1, 1], [0, height - 1, 1]], np.float64)
    mapped = corners @ (H / H[2, 2]).T
    if (mapped[:, 2] < 1e-3).any():
        return False
    xy = mapped[:, :2] / mapped[:, 2:]
    sides = np.roll(xy, -1, axis=0) - xy
    turns = _cross(sides, np.roll(sides, -1, axis=0))
    area = 0.5 * abs(float(_cross(xy, np.roll(xy, -1, axis=0)).sum())) / max(1, (width - 1) * (height - 1))
    return bool((turns > 0).all()) and 1 / max_area_ratio < area < max_area_ratio


def normalised(H: Matrix3, width: int, height: int) -> Matrix3:
    """H in coordinates centred on the image and divided by its WIDTH, H33 = 1: the same for every image size.

    Args:
        H: (3, 3), pixels to pixels.
        width, height: of both images.
    """
    to_centred = np.array(
        [[1 / width, 0, -0.5 * (width - 1) / width], [0, 1 / width, -0.5 * (height - 1) / width], [0, 0, 1]], np.float64
    )
    centred: Matrix3 = to_centred @ H @ np.linalg.inv(to_centred)
    centred /= centred[2, 2]
    return centred


def rotation_deviation(normalised_H: Matrix3) -> float:
    """|H[:2,:2] - I|_F: how far the paper's "rotation term" is from none. (Its own norm would be sqrt(2) at rest.)"""
    return float(np.linalg.norm(normalised_H[:2, :2] - np.eye(2)))


def translation_norm(normalised_H: Matrix3) -> float:
    """|H[:2,2]|: the paper's "translation term", in image widths."""
    return float(np.linalg.norm(normalised_H[:2, 2]))


def _magsac(seed: int, threshold_px: float) -> cv2.UsacParams:
    """The preset USAC_MAGSAC written out: the preset draws from one fixed seed and cannot be given another."""
    params = cv2.UsacParams()
    params.confidence = CONFIDENCE
    params.isParallel = False
    params.maxIterations = MAX_ITERATIONS
    params.sampler = cv2.SAMPLING_UNIFORM
    params.score = cv2.SCORE_METHOD_MAGSAC
    params.loMethod = cv2.LOCAL_OPTIM_SIGMA
    params.final_polisher = cv2.MAGSAC
    params.threshold = threshold_px
    params.randomGeneratorState = seed
    return params


def _cross(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    result: npt.NDArray[np.float64] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return result
