"""The pinhole camera."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Camera:
    """Intrinsics of an undistorted or distorted pinhole camera, in pixels; pixel centres at integer coordinates.

    Args:
        width, height: image size the numbers belong to.
        fx, fy, cx, cy: focal lengths and principal point.
        distortion: coefficients in OpenCV order; empty or all zero means none.
        model: distortion model as the log names it, "" when there is none.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    model: str = ""

    @property
    def K(self) -> npt.NDArray[np.float64]:
        """(3, 3) calibration matrix."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]], np.float64)

    @property
    def is_distorted(self) -> bool:
        """Whether straight lines are bent: a coefficient differs from zero, or it is a fisheye with coefficients."""
        return any(self.distortion) or (self.model == "equidistant" and bool(self.distortion))

    def scaled(self, width: int, height: int) -> "Camera":
        """The same camera for an image resized to (`width`, `height`); pixel centres at integers (shift by half)."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self, width=width, height=height, fx=self.fx * sx, fy=self.fy * sy,
            cx=(self.cx + 0.5) * sx - 0.5, cy=(self.cy + 0.5) * sy - 0.5,
        )  # fmt: skip
