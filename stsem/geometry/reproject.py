"""Which pixel of a keyframe shows the same point of the scene: the exact backward warp by depth and pose.

Each pixel of the current frame is taken into space by its own depth, moved into the keyframe and projected there:
z_k (u_k, v_k, 1) = K_k (R z K^-1 (u, v, 1) + t), with (R, t) = T_keyframe<-current. It is a gather, so there are no
holes between pixels; what another surface hid from the keyframe fails the test of its depth there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.frame import Depth
from stsem.geometry.carried import Bools
from stsem.geometry.packed import Rows, packed
from stsem.geometry.shadow import filled
from stsem.pose import Pose, inverse

Float32 = npt.NDArray[np.float32]
Places = npt.NDArray[np.int16]
"""(h, w, 2) int16 column and row of the keyframe."""
Pixels = tuple[Float32, Float32, Float32]
"""Column, row and depth of some pixels; they broadcast to the shape (h, w) of the depths."""
Value = TypeVar("Value", np.uint8, np.float32)

STRIP_PIXELS = 1 << 15
NEIGHBOURS = ((-1, 0), (1, 0), (0, -1), (0, 1))
"""(column, row) steps to the pixels beside one, in the order in which they are tried."""
SQUARE = np.ones((3, 3), np.uint8)


@dataclass(frozen=True, eq=False)
class View:
    """Where the pixels of one frame are in space.

    Args:
        depth: (H, W) float32 metres along z, NaN unknown.
        T_WC: (4, 4) world from camera.
        camera: of the size of `depth`, without distortion.

    Raises:
        ValueError: the camera is distorted or of another size.
    """

    depth: Depth
    T_WC: Pose
    camera: Camera

    def __post_init__(self) -> None:
        size = (self.camera.height, self.camera.width)
        if self.depth.shape != size or self.camera.is_distorted:
            raise ValueError(
                f"depth {self.depth.shape} must have the size of an undistorted camera, but it is {size}, "
                f"distortion {self.camera.distortion}"
            )

    @cached_property
    def T_CW(self) -> Pose:
        """(4, 4) camera from world."""
        return inverse(self.T_WC)

    @cached_property
    def rays(self) -> npt.NDArray[np.float64]:
        """(3, 3) inverse of the camera's matrix: the point at z = 1 of a pixel (u, v, 1)."""
        return np.asarray(np.linalg.inv(self.camera.K), np.float64)

    def lit(self) -> "View":
        """The same frame with depth in the shadows of the projector, by guess."""
        return View(filled(self.depth), self.T_WC, self.camera)


@dataclass(frozen=True)
class Agreement:
    """How far apart two depths of one point may be: z (share + per_m z) metres at the distance z.

    The second term is the axial noise of cameras that triangulate, which grows with the square of the distance. The
    defaults are chosen by measurement (docs/propagation.md).
    """

    share: float = 0.02
    per_m: float = 0.0


DEFAULT_AGREEMENT = Agreement()


@dataclass(frozen=True, eq=False)
class Correspondence:
    """Pixels of the current frame with their partners in a keyframe; made by `correspond`.

    Args:
        partners: (h, w, 2) int16 pixels of the keyframe, without meaning where not `found`.
        found: (h, w) bool.
        rows: (h * w,) the pixels of the current frame, counted row by row, that the entries stand for, the last one
            repeated at the end; None where they are the whole image.
    """

    partners: Places
    found: Bools
    rows: Rows | None

    def fetch(self, values: npt.NDArray[Value], onto: npt.NDArray[Value]) -> None:
        """Write the `values` (H, W) of the keyframe into `onto` (H, W) at the pixels that were found."""
        if not self.found.size:
            return
        fetched = np.asarray(cv2.remap(values, self.partners, None, cv2.INTER_NEAREST), values.dtype)  # type: ignore[call-overload]
        if self.rows is None:
            cv2.copyTo(fetched, self.found.view(np.uint8), onto)
        else:
            onto.reshape(-1)[self.rows[self.found.reshape(-1)]] = fetched[self.found]


def correspond(current: View, keyframe: View, *, agreement: Agreement = DEFAULT_AGREEMENT) -> Correspondence:
    """The pixels of `current` that `keyframe` saw too.

    A pixel without depth in either frame has no partner. Where the depth of the nearest keyframe pixel disagrees, the
    first pixel beside it that agrees is taken: at an edge, rounding may fall on the wrong side.

    Args:
        current, keyframe: the two frames; their sizes may differ.
        agreement: the test against occlusion.
    """
    height, width = current.depth.shape
    x, y = np.arange(width, dtype=np.float32)[None, :], np.arange(height, dtype=np.float32)[:, None]
    partners, found = _partners((x, y, current.depth), current, keyframe, agreement)
    beside = np.asarray(cv2.dilate(found.view(np.uint8), SQUARE), np.uint8).view(np.bool_) & (current.depth > 0)
    _search_beside(np.flatnonzero(beside > found), current, keyframe, agreement, partners, found)
    return Correspondence(partners, found, rows=None)


def among(current: View, keyframe: View, rows: Rows, *, agreement: Agreement = DEFAULT_AGREEMENT) -> Correspondence:
    """`correspond` for the pixels `rows` (n,) of the current frame, counted row by row; none beside is tried."""
    if not len(rows):
        return Correspondence(np.empty((0, 1, 2), np.int16), np.empty((0, 1), np.bool_), rows)
    some = packed(rows)
    pixels = _pixels(current, some)
    return Correspondence(*_partners(pixels, current, keyframe, agreement), rows=some.reshape(-1))


def in_image(current: View, keyframes: Sequence[View], rows: Rows) -> Bools:
    """(k,) bool: whether any of the pixels `rows` (n,) of `current` falls into the image of each of `keyframes`.

    Where none does, `among` finds nothing; it costs a fifth of asking each of them.
    """
    if not len(rows) or not keyframes:
        return np.zeros(len(keyframes), np.bool_)
    x, y, depth = _pixels(current, rows)
    points = np.stack([x * depth, y * depth, depth, np.ones_like(depth)])
    # Not a matrix product: BLAS may round differently with other thread counts.
    u, v, z = np.einsum("kij,jn->ikn", np.stack([_matrix(current, keyframe) for keyframe in keyframes]), points)
    sizes = np.array([keyframe.depth.shape for keyframe in keyframes])[..., None] + 1
    inside = (z > 0) & (u > -z) & (v > -z) & (u < sizes[:, 1] * z) & (v < sizes[:, 0] * z)
    return np.asarray(inside.any(axis=1))


def looked_past(current: View, keyframe: View, rows: Rows, *, clearance_m: float) -> Bools:
    """(n,) bool for the pixels `rows` (n,) of `current`: the keyframe saw something farther away where they are now.

    Args:
        current, keyframe: the two frames.
        rows: counted row by row.
        clearance_m: how much farther away, in metres.
    """
    if not len(rows):
        return np.zeros(0, np.bool_)
    some = packed(rows)
    u, v, z = _projected(_pixels(current, some), _matrix(current, keyframe))
    partners, _ = cv2.convertMaps(u, v, cv2.CV_16SC2, nninterpolation=True)
    there = cv2.remap(keyframe.depth, partners, None, cv2.INTER_NEAREST, borderValue=np.nan)  # type: ignore[call-overload]
    return np.asarray((z > 0) & (there - z > clearance_m)).reshape(-1)[: len(rows)]


def _pixels(view: View, some: Rows) -> Pixels:
    """Column, row and depth, (h, w) each, of the pixels `some` (h, w)."""
    y, x = np.divmod(some.astype(np.int32), np.int32(view.camera.width))
    return x.astype(np.float32), y.astype(np.float32), view.depth.reshape(-1).take(some)


def _matrix(current: View, keyframe: View) -> Float32:
    """(3, 4): z_k (u_k, v_k, 1) = z (its first three columns) (u, v, 1) + its last one."""
    T, K = keyframe.T_CW @ current.T_WC, keyframe.camera.K
    moved = np.empty((3, 4), np.float32)
    moved[:, :3], moved[:, 3] = K @ T[:3, :3] @ current.rays, K @ T[:3, 3]
    return moved


def _partners(pixels: Pixels, current: View, keyframe: View, agreement: Agreement) -> tuple[Places, Bools]:
    """(partners, found) of `Correspondence` for some pixels of `current`."""
    (x, y, depth), moved = pixels, _matrix(current, keyframe)
    height, width = depth.shape
    partners, found = np.empty((height, width, 2), np.int16), np.empty((height, width), np.bool_)
    # Strip by strip, so that what is computed in between stays in the processor's cache.
    lines = max(1, STRIP_PIXELS // width)
    for top in range(0, height, lines):
        strip = slice(top, top + lines)
        some = x if len(x) == 1 else x[strip], y[strip], depth[strip]
        _partners_of_strip(some, moved, keyframe.depth, agreement, partners[strip], found[strip])
    return partners, found


def _partners_of_strip(
    pixels: Pixels, moved: Float32, depth: Depth, agreement: Agreement, partners: Places, found: Bools
) -> None:
    """Write `partners` and `found` for a few lines of pixels."""
    u, v, z = _projected(pixels, moved)
    cv2.convertMaps(u, v, cv2.CV_16SC2, partners, nninterpolation=True)
    found[:] = _agrees(depth, partners, z, _limit(z, agreement))


def _limit(z: Float32, agreement: Agreement) -> Float32:
    """How far another depth may be from z, metres."""
    limit = z * np.float32(agreement.per_m)
    limit += np.float32(agreement.share)
    limit *= z
    return limit


def _projected(pixels: Pixels, moved: Float32) -> tuple[Float32, Float32, Float32]:
    """Pixel (u, v) and depth z in the keyframe, (h, w) each, by the matrix `moved` (3, 4) of (z u, z v, z, 1).

    NaN where the current frame has no depth; z is not positive where the keyframe looks away.
    """
    x, y, depth = pixels
    # Written out instead of a matrix product: BLAS may round differently with other thread counts.
    u, v, z = ((b * y + c) + a * x for a, b, c, _ in moved)
    for ray, shift in zip((u, v, z), moved[:, 3], strict=True):
        ray *= depth
        ray += shift
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        per_z = 1 / z
        u *= per_z
        v *= per_z
    return u, v, z


def _agrees(depth: Depth, partners: Places, z: Float32, limit: Float32) -> Bools:
    """Whether `depth` at the partners is within `limit` of z; not outside the image and not where either is unknown."""
    there = cv2.remap(depth, partners, None, cv2.INTER_NEAREST, borderValue=np.nan)  # type: ignore[call-overload]
    there -= z
    np.abs(there, out=there)
    return np.asarray(there <= limit)


def _search_beside(
    rows: Rows, current: View, keyframe: View, agreement: Agreement, partners: Places, found: Bools
) -> None:
    """For the pixels `rows` of `current`, write the first of their partner's neighbours that agrees, if one does.

    They have no partner yet and lie beside pixels that have: an edge is thin, and far inside of what the keyframe did
    not see, nothing is sought.
    """
    if not len(rows):
        return
    some, pairs = packed(rows), partners.view(np.int32).reshape(-1)
    _, _, z = _projected(_pixels(current, some), _matrix(current, keyframe))
    limit, here = _limit(z, agreement), pairs[some].view(np.int16).reshape(*some.shape, 2)
    best, agreed = here.copy(), np.zeros(some.shape, np.bool_)
    for step in NEIGHBOURS[::-1]:
        there = here + np.array(step, np.int16)
        agrees = _agrees(keyframe.depth, there, z, limit)
        cv2.copyTo(there, agrees.view(np.uint8), best)
        agreed |= agrees
    height, width = keyframe.depth.shape
    agreed &= cv2.inRange(here, (0, 0), (width - 1, height - 1)) > 0
    hits = some[agreed]
    pairs[hits], found.reshape(-1)[hits] = best.view(np.int32)[..., 0][agreed], True
