"""Lens distortion, undone: images of a real lens resampled as a pinhole camera with the same K would have seen them.

The maps are computed once for a camera. Each pixel of the result fetches, so that there are no holes.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.classes import NO_LABEL, Labels
from stsem.frame import Depth, Image

Float64 = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]
Maps = tuple[Float32, Float32]

MAX_SIDE = (1 << 15) - 2
"""cv2.remap counts in 16 bits."""
MIN_SHARE = 0.5
RADII = 4096


@dataclass(frozen=True)
class Lens:
    """A distortion model.

    Args:
        counts: how many coefficients it may have, in OpenCV's order.
        radius: (distance from the axis in the pinhole image / f, coefficients) -> distance in the real one.
        maps: (K, coefficients, (width, height)) -> x and y in the real image for each pixel of the pinhole image.
    """

    counts: tuple[int, ...]
    radius: Callable[[Float64, Float64], Float64]
    maps: Callable[[Float64, Float64, tuple[int, int]], Maps]


def _radius_brown(r: Float64, d: Float64) -> Float64:
    """Radial part of k1 k2 p1 p2 k3 k4 k5 k6 (Brown 1966; rational: Claus and Fitzgibbon 2005, as in OpenCV)."""
    k1, k2, _, _, k3, k4, k5, k6 = np.pad(d, (0, 14))[:8]
    s = r * r
    grown: Float64 = r * (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
    return grown


def _radius_fisheye(r: Float64, d: Float64) -> Float64:
    """Angle polynomial of Kannala and Brandt (2006), equation 6 with k1 = 1."""
    angle = np.arctan(r)
    s = angle * angle
    grown: Float64 = angle * (1 + s * (d[0] + s * (d[1] + s * (d[2] + s * d[3]))))
    return grown


def _maps_brown(K: Float64, d: Float64, size: tuple[int, int]) -> Maps:
    return cv2.initUndistortRectifyMap(K, d, np.eye(3), K, size, cv2.CV_32FC1)  # type: ignore[return-value]


def _maps_fisheye(K: Float64, d: Float64, size: tuple[int, int]) -> Maps:
    return cv2.fisheye.initUndistortRectifyMap(K, d, np.eye(3), K, size, cv2.CV_32FC1)  # type: ignore[return-value]


BROWN = Lens((4, 5, 8, 12, 14), _radius_brown, _maps_brown)
LENSES = {
    "plumb_bob": BROWN,
    "rational_polynomial": BROWN,
    "equidistant": Lens((4,), _radius_fisheye, _maps_fisheye),
}


class Undistortion:
    """The resampling of the images of one camera; arrays must have the camera's size.

    Args:
        camera: with its distortion.

    Attributes:
        pinhole: the camera of the resampled images: the same K, no distortion.

    Raises:
        ValueError: a model that is not known, coefficients that are no lens, or a size that cannot be resampled. The
            text is the middle of a sentence.
    """

    def __init__(self, camera: Camera) -> None:
        self.pinhole = replace(camera, distortion=(), model="")
        x, y = _maps(camera)
        self._blended = cv2.convertMaps(x, y, cv2.CV_16SC2)
        self._nearest, _ = cv2.convertMaps(x, y, cv2.CV_16SC2, nninterpolation=True)

    def image(self, image: Image) -> Image:
        """(H, W, 3) uint8, bilinear; black where the lens did not see."""
        return np.asarray(cv2.remap(image, *self._blended, cv2.INTER_LINEAR), np.uint8)

    def labels(self, labels: Labels) -> Labels:
        """(H, W) uint8, nearest; NO_LABEL where the lens did not see."""
        seen = cv2.remap(labels, self._nearest, None, cv2.INTER_NEAREST, borderValue=NO_LABEL)  # type: ignore[call-overload]
        return np.asarray(seen, np.uint8)

    def depth(self, depth: Depth) -> Depth:
        """(H, W) float32 metres, nearest; NaN where the lens did not see. Depth along z is the same in both images."""
        seen = cv2.remap(depth, self._nearest, None, cv2.INTER_NEAREST, borderValue=np.nan)  # type: ignore[call-overload]
        return np.asarray(seen, np.float32)


def _maps(camera: Camera) -> Maps:
    """Where each pixel of the pinhole image is in the real one; outside the image where the lens does not tell."""
    lens = LENSES.get(camera.model)
    if lens is None:
        raise ValueError(f"the distortion model {camera.model!r} is not known, only {', '.join(LENSES)}")
    d = _coefficients(camera, lens)
    if not 0 < max(camera.width, camera.height) <= MAX_SIDE:
        raise ValueError(f"an image of {camera.width}x{camera.height} pixels cannot be resampled")
    with np.errstate(all="ignore"):
        radii = _radii(camera)
        x, y = lens.maps(camera.K, d, (camera.width, camera.height))
        told = np.isfinite(x) & np.isfinite(y) & (radii <= _reach(float(radii.max()), lens, d))
    seen = told & (x >= 0) & (x <= camera.width - 1) & (y >= 0) & (y <= camera.height - 1)
    if (share := float(seen.mean())) < MIN_SHARE:
        raise ValueError(f"the coefficients of {camera.model} are no lens: it would fill {share:.0%} of the image")
    # Two pixels outside: not even bilinear interpolation touches the image there.
    for far, values in ((camera.width + 1, x), (camera.height + 1, y)):
        values[~told] = -2
        np.clip(values, -2, far, out=values)
    return x, y


def _coefficients(camera: Camera, lens: Lens) -> Float64:
    """As many as the model may have; drivers fill messages up with zeros, which mean nothing."""
    d = np.array(camera.distortion, np.float64)
    for count in sorted(lens.counts, reverse=True):
        if count <= len(d) and not d[count:].any():
            return d[:count]
    wanted = " or ".join(str(count) for count in lens.counts)
    raise ValueError(f"{camera.model} has {wanted} coefficients, but {len(d)} came")


def _reach(end: float, lens: Lens, d: Float64) -> float:
    """Distance from the axis / f up to which the model grows on its way to `end`; beyond, it folds the image back."""
    radii = np.linspace(0, end, RADII)
    growing = np.diff(lens.radius(radii, d)) > 0
    return float("inf") if growing.all() else float(radii[int(growing.argmin())])


def _radii(camera: Camera) -> Float32:
    """(H, W) distance of each pixel from the axis, divided by f."""
    x = ((np.arange(camera.width) - camera.cx) / camera.fx).astype(np.float32)
    y = ((np.arange(camera.height) - camera.cy) / camera.fy).astype(np.float32)
    return np.asarray(np.hypot(x[None, :], y[:, None]), np.float32)
