"""Points of an image that can be found again in another one (ORB, Rublee et al. 2011)."""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from stsem.frame import Image

WORKING_SIDE = 256
"""Longer side, in pixels, of the image in which points are sought, whatever size came (docs/decisions.md has why)."""
MARGIN = 16
"""No point is nearer to the border of that image, in pixels."""


@dataclass(frozen=True, eq=False)
class Features:
    """Points of one image.

    Args:
        xy: (n, 2) float32, pixels of the full-size image, pixel centres at integers.
        descriptors: (n, 32) uint8, compared by Hamming distance.
        width, height: size of the full-size image.
    """

    xy: npt.NDArray[np.float32]
    descriptors: npt.NDArray[np.uint8]
    width: int
    height: int

    def __len__(self) -> int:
        return len(self.xy)

    @property
    def working_pixel(self) -> float:
        """How many full-size pixels one pixel of the image searched is wide: the grain of `xy`."""
        return max(self.width, self.height) / WORKING_SIDE


def extract(image: Image, *, max_features: int = 1000) -> Features:
    """ORB points of `image`; none in an image without texture, or far longer than wide.

    Repeats to the bit, whatever the number of threads.

    Args:
        image: (H, W, 3) uint8 RGB.
        max_features: the strongest so many are kept.
    """
    height, width = image.shape[:2]
    scale = WORKING_SIDE / max(width, height)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    grey = cv2.resize(
        cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    )
    none = Features(np.empty((0, 2), np.float32), np.empty((0, 32), np.uint8), width, height)
    if min(size) <= 2 * MARGIN:  # OpenCV would fail on the pyramid of an image a few pixels wide
        return none
    keypoints, descriptors = _detector(max_features).detectAndCompute(grey, None)
    if descriptors is None or not keypoints:
        return none
    grain = np.array([width / size[0], height / size[1]], np.float32)
    xy = (np.array([keypoint.pt for keypoint in keypoints], np.float32) + 0.5) * grain - 0.5
    return Features(xy, descriptors.astype(np.uint8, copy=False), width, height)


@lru_cache(maxsize=4)
def _detector(max_features: int) -> cv2.ORB:
    """Points down to a weak corner (7 of 255) and up to 16 pixels from the border: indoor walls offer little else."""
    return cv2.ORB.create(nfeatures=max_features, edgeThreshold=MARGIN, fastThreshold=7)
