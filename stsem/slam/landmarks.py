"""Points of an image with their places in space, and the pose of a camera that sees them again (ORB and PnP)."""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.frame import Depth, Image
from stsem.pose import Pose, inverse
from stsem.slam.planes import FARTHEST_M, NEAREST_M

WORKING_SIDE = 320
"""Longer side of the image in which points are sought: a quarter of the time at 640, and depth refines the pose."""
SMALLEST = 33
"""Pixels of an image within whose margins a point can lie."""
FEW, MANY = 300, 600
"""Points of a frame that is followed, and of one that is kept or has to be recognised."""
MAX_DISTANCE = 64
"""Bits of 256 by which partners may differ; unrelated points differ by 128 on average."""
MIN_MATCHES = 8
REPROJECTION_PX = 2.0
"""Largest error of an inlier, in pixels of the image searched."""
CONFIDENCE, ITERATIONS = 0.99, 300


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Points of one image.

    Args:
        xy: (n, 2) float32 pixels of the full-size image, pixel centres at integers.
        descriptors: (n, 32) uint8, compared by Hamming distance.
        xyz: (n, 3) float32 metres in the camera; NaN where the depth is not known.
    """

    xy: npt.NDArray[np.float32]
    descriptors: npt.NDArray[np.uint8]
    xyz: npt.NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.xy)


NOTHING = Landmarks(np.empty((0, 2), np.float32), np.empty((0, 32), np.uint8), np.empty((0, 3), np.float32))


@dataclass(frozen=True, eq=False)
class Resection:
    """A pose from points seen again.

    Args:
        T_KC: (4, 4), the camera in that of the keyframe.
        inliers: points that agree with it.
        xyz: (n, 3) matched points in the keyframe, metres.
        xy: (n, 2) where they are seen, pixels.
    """

    T_KC: Pose
    inliers: int
    xyz: npt.NDArray[np.float64]
    xy: npt.NDArray[np.float64]

    @property
    def matches(self) -> int:
        """Points it was estimated from."""
        return len(self.xy)


def find_landmarks(image: Image, depth: Depth | None, camera: Camera, *, most: int = MANY) -> Landmarks:
    """ORB points of an (H, W, 3) RGB image, placed by its depth; none in an image without texture; at most `most`."""
    height, width = image.shape[:2]
    scale = min(1.0, WORKING_SIDE / max(width, height))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    grey = cv2.cvtColor(cv2.resize(image, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)
    if min(size) < SMALLEST:
        return NOTHING
    keypoints, descriptors = _detector(most).detectAndCompute(grey, None)
    if descriptors is None or not keypoints:
        return NOTHING
    grain = np.array([width / size[0], height / size[1]], np.float32)
    xy = (np.array([keypoint.pt for keypoint in keypoints], np.float32) + 0.5) * grain - 0.5
    return Landmarks(xy, descriptors.astype(np.uint8, copy=False), _placed(xy, depth, camera))


def zoomed(landmarks: Landmarks, ratio: float, depth: Depth | None, camera: Camera) -> Landmarks:
    """The landmarks with pixels `ratio` times as far from the principal point, placed anew by the depth there."""
    centre = np.array([camera.cx, camera.cy], np.float32)
    xy = (landmarks.xy - centre) * np.float32(ratio) + centre
    return Landmarks(xy, landmarks.descriptors, _placed(xy, depth, camera))


def resect(keyframe: Landmarks, current: Landmarks, camera: Camera, *, seed: int) -> Resection | None:
    """The pose of the current camera against a keyframe whose points are known in space; None when there is none.

    Args:
        keyframe, current: points of the two images; depth of the current one is not used.
        camera: of both, without distortion.
        seed: of this job, 0 to 2^31 - 1.
    """
    known = np.flatnonzero(np.isfinite(keyframe.xyz[:, 2]))
    if len(known) < MIN_MATCHES or len(current) < MIN_MATCHES:
        return None
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(keyframe.descriptors[known], current.descriptors)
    good = [pair for pair in pairs if pair.distance < MAX_DISTANCE]
    if len(good) < MIN_MATCHES:
        return None
    xyz = keyframe.xyz[known[[pair.queryIdx for pair in good]]].astype(np.float64)
    xy = current.xy[[pair.trainIdx for pair in good]].astype(np.float64)
    threshold = REPROJECTION_PX * max(1.0, max(camera.width, camera.height) / WORKING_SIDE)
    try:
        found, _, rvec, tvec, inliers = cv2.solvePnPRansac(xyz, xy, camera.K, None, params=_usac(seed, threshold))
        if not found or inliers is None or len(inliers) < MIN_MATCHES:
            return None
        agreed = inliers.reshape(-1)
        rvec, tvec = cv2.solvePnPRefineLM(xyz[agreed], xy[agreed], camera.K, None, rvec, tvec)
    except cv2.error:  # points on which no pose can be computed, such as all at one place
        return None
    T_CK = np.eye(4)
    T_CK[:3, :3], T_CK[:3, 3] = cv2.Rodrigues(rvec)[0], tvec.reshape(3)
    return Resection(inverse(T_CK), len(agreed), xyz, xy) if np.isfinite(T_CK).all() else None


def _placed(xy: npt.NDArray[np.float32], depth: Depth | None, camera: Camera) -> npt.NDArray[np.float32]:
    if depth is None:
        return np.full((len(xy), 3), np.nan, np.float32)
    column, row = np.rint(xy[:, 0]).astype(np.intp), np.rint(xy[:, 1]).astype(np.intp)
    inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    z = depth[np.where(inside, row, 0), np.where(inside, column, 0)]
    z = np.where(inside & (z > NEAREST_M) & (z < FARTHEST_M), z, np.float32(np.nan))
    x, y = (xy[:, 0] - camera.cx) / camera.fx * z, (xy[:, 1] - camera.cy) / camera.fy * z
    return np.stack([x, y, z], axis=1).astype(np.float32)


@lru_cache(maxsize=4)
def _detector(most: int) -> cv2.ORB:
    return cv2.ORB.create(nfeatures=most, nlevels=5, edgeThreshold=16, fastThreshold=7)


def _usac(seed: int, threshold_px: float) -> cv2.UsacParams:
    params = cv2.UsacParams()
    params.confidence = CONFIDENCE
    params.isParallel = False
    params.maxIterations = ITERATIONS
    params.sampler = cv2.SAMPLING_UNIFORM
    params.score = cv2.SCORE_METHOD_MSAC
    params.loMethod = cv2.LOCAL_OPTIM_NULL
    params.threshold = threshold_px
    params.randomGeneratorState = seed
    return params
