"""What points say about a pose, for the same least squares as depth: reprojection errors in pixels.

Depth is silent along a corridor, where whatever moves on its own, as a person, would be all that holds the camera.
"""

from dataclasses import dataclass, replace

import numpy as np

from stsem.camera import Camera
from stsem.pose import Pose
from stsem.slam.landmarks import Resection
from stsem.slam.rotations import F64

NEAR_PX = 10.0
"""Largest error, at one of the poses that are likely, of a match that takes part."""
LEAST_PX = 1.0
"""The least standard deviation of a point that is believed."""
TUKEY = 5.0
"""Errors, in standard deviations as found, from which a match does not count."""
CORRELATED = 4.0
"""Points whose errors are one and the same. Information is divided by it."""
PATCHES = 4.0
"""Parts of the image whose errors of registration differ, beyond shift, scale and turn: n points count as so many."""
COMMON_AT = 0.3
"""Where in the image, in widths from its middle, a common scale or turn makes as much as a common shift."""
TURNED = 0.2
"""Error of flow to its side, as a share of that along it."""
RAYLEIGH_MEDIAN = 1.177
"""Median length of a vector of two numbers with standard deviation 1."""


@dataclass(frozen=True, eq=False)
class Sighting:
    """Points whose places are known, seen by a camera.

    Args:
        xyz: (n, 3) in the world, metres.
        xy: (n, 2) pixels of the camera.
        camera: without distortion.
        common_px: standard deviation of errors that all share, of colour against depth: of a shift across, of one
            down, and (their length) of a scale and a turn; none where 0.
    """

    xyz: F64
    xy: F64
    camera: Camera
    common_px: tuple[float, float] = (0.0, 0.0)

    def errors(self, T_WC: Pose) -> tuple[F64, F64]:
        """((n, 3) the points in a camera at `T_WC`, (n, 2) projected minus seen, pixels)."""
        p, camera = self.xyz - T_WC[:3, 3], self.camera
        p = np.asarray(p[:, :1] * T_WC[0, :3] + p[:, 1:2] * T_WC[1, :3] + p[:, 2:] * T_WC[2, :3])
        z = np.maximum(p[:, 2], 0.1)
        u, v = p[:, 0] / z * camera.fx + camera.cx, p[:, 1] / z * camera.fy + camera.cy
        return p, np.stack([u, v], axis=1) - self.xy

    def near(self, poses: list[Pose]) -> "Sighting":
        """Only those that are near where one of the poses expects them."""
        close = [np.square(self.errors(pose)[1]).sum(axis=1) < NEAR_PX**2 for pose in poses]
        kept = np.any(close, axis=0)
        return replace(self, xyz=self.xyz[kept], xy=self.xy[kept])

    def system(self, T_WC: Pose) -> tuple[F64, F64]:
        """Information (6, 6) and gradient (6,) by steps of the camera in its own axes, as `align.Agreement`.

        The weights are Tukey's biweight; the standard deviation is that of the errors, so that points that do not fit
        depth, as where colour and depth are badly registered, count for less.
        """
        p, r = self.errors(T_WC)
        if not len(p):
            return np.zeros((6, 6)), np.zeros(6)
        size = np.sqrt(np.square(r).sum(axis=1))
        sigma = max(LEAST_PX, float(np.median(size)) / RAYLEIGH_MEDIAN)
        inside = np.maximum(0.0, 1 - np.square(size / (TUKEY * sigma)))
        shared = len(p) / PATCHES * np.square(self.common_px)  # (2,)
        weight = (inside * inside)[:, None] / (sigma * sigma * CORRELATED + shared)
        J = np.concatenate([self._jacobians(p), self._common_modes(), r[..., None]], axis=2)
        whole = np.einsum("nki,nkj->ij", J * weight[..., None], J)
        return self._without_common(whole)

    def _without_common(self, whole: F64) -> tuple[F64, F64]:
        """Information and gradient of the pose alone: what all points share is solved for and left out (Schur)."""
        across, down = self.common_px
        length = np.hypot(across, down)
        if length == 0:
            return whole[:6, :6], whole[:6, 10]
        of_common = whole[6:10, 6:10] + np.diag(1 / np.square(np.maximum([across, down, length, length], 1e-3)))
        part = np.linalg.solve(of_common, whole[6:10])
        reduced = whole[:6] - whole[:6, 6:10] @ part
        return reduced[:, :6], reduced[:, 10]

    def _common_modes(self) -> F64:
        """(n, 2, 4) how pixels move by a shift across and down, a scale and a turn, each by a pixel."""
        reach = COMMON_AT * self.camera.width
        x, y = (self.xy[:, 0] - self.camera.cx) / reach, (self.xy[:, 1] - self.camera.cy) / reach
        one, zero = np.ones(len(x)), np.zeros(len(x))
        return np.stack([np.stack([one, zero, x, -y], axis=1), np.stack([zero, one, y, x], axis=1)], axis=1)

    def _jacobians(self, p: F64) -> F64:
        """(n, 2, 6) of the pixels: a step (d, w) of the camera moves a point by -d + p x w."""
        fx, fy, z = self.camera.fx, self.camera.fy, np.maximum(p[:, 2], 0.1)
        x, y, zero = p[:, 0] / z, p[:, 1] / z, np.zeros(len(p))
        across = [-fx / z, zero, fx * x / z, fx * x * y, -fx * (1 + x * x), fx * y]
        down = [zero, -fy / z, fy * y / z, fy * (1 + y * y), -fy * x * y, -fy * x]
        return np.stack([np.stack(across, axis=1), np.stack(down, axis=1)], axis=1)


def sighting(seen: Resection, T_WK: Pose, camera: Camera, poses: list[Pose], misregistered: float) -> Sighting:
    """The matches with a keyframe at `T_WK` that are near where one of the poses (T_WC) expects them.

    Args:
        seen, T_WK, camera, poses: as said.
        misregistered: errors of flow that all points share, as a share of the flow (`zoom.Zoom.spread`).
    """
    x, y, z = seen.xyz[:, :1], seen.xyz[:, 1:2], seen.xyz[:, 2:]
    xyz = x * T_WK[:3, 0] + y * T_WK[:3, 1] + z * T_WK[:3, 2] + T_WK[:3, 3]
    points = Sighting(xyz, seen.xy, camera).near(poses)
    flow = points.errors(T_WK)[1]
    across, down = (float(np.median(np.abs(flow[:, k]))) if len(flow) else 0.0 for k in (0, 1))
    turned = TURNED * float(np.hypot(across, down))  # what a turn of colour against depth makes of flow to the side
    return replace(points, common_px=(misregistered * (across + turned), misregistered * (down + turned)))
