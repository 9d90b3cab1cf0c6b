"""From what a calibration message says to the intrinsics of the image as it was sent; the same for all families."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from stsem.camera import Camera
from stsem.log.schemas.messages import Calibration
from stsem.plain import plain

MODELS = {
    "plumb_bob": "plumb_bob",
    "rational_polynomial": "rational_polynomial",
    "equidistant": "equidistant",
    "fisheye": "equidistant",
    "kannala_brandt": "equidistant",
}
"""Name in a log -> name in a Camera; other models keep the log's name."""

MAX_SIDE = 1 << 16
MAX_PIXELS = 1e7
MAX_COEFFICIENTS = 64


@dataclass(frozen=True)
class Readout:
    """Which part of the sensor was sent, and how coarsely.

    Args:
        binning: (x, y) pixels of the sensor per pixel of the image; 0 means 1.
        offset: (x, y) of the region of interest, in pixels of the sensor.
        size: (width, height) of the region, in pixels of the sensor; 0 means all of it.
    """

    binning: tuple[int, int] = (1, 1)
    offset: tuple[int, int] = (0, 0)
    size: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Intrinsics:
    """What a calibration message says of the full sensor.

    Args:
        width, height: of the full image.
        K: 9 numbers, row by row; none, or K[0] = 0, means uncalibrated.
        D: distortion coefficients; as many as the model has, or none.
        model: distortion model, as the log names it.
        P: 12 numbers, row by row, of the projection after rectification; none, or P[0] = 0, means that there is none.
        readout: of the image that goes with the message.
    """

    width: int
    height: int
    K: Sequence[float]
    D: Sequence[float] = ()
    model: str = ""
    P: Sequence[float] = ()
    readout: Readout = Readout()


def calibration(stamp_ns: int | None, frame_id: str, sensor: Intrinsics) -> Calibration:
    """Intrinsics of the image that was sent, before and after rectification.

    Raises:
        ValueError: K or P of another length, or a number that no camera has.
    """
    width, height = _sent_size(sensor)
    k, p = _numbers("K", sensor.K, 9), _numbers("P", sensor.P, 12)
    camera = _pinhole("K", width, height, (k[0], k[4], k[2], k[5]), sensor.readout)
    rectified = _pinhole("P", width, height, (p[0], p[5], p[2], p[6]), sensor.readout)
    if camera:
        distortion, model = _distortion(sensor)
        camera = replace(camera, distortion=distortion, model=model)
    return Calibration(stamp_ns, plain(frame_id.lstrip("/")), camera, rectified)


def _sent_size(sensor: Intrinsics) -> tuple[int, int]:
    """(width, height) of the image after region of interest and binning; 0 where the message does not tell."""
    region, binning = sensor.readout.size, sensor.readout.binning
    full = (region[0] or sensor.width, region[1] or sensor.height)
    x, y = sensor.readout.offset
    if max(*full, x, y) > MAX_SIDE:
        raise ValueError(f"an image of {full[0]}x{full[1]} pixels at {x}, {y} is announced")
    sent = (full[0] // (binning[0] or 1), full[1] // (binning[1] or 1))
    if any(before and not after for before, after in zip(full, sent, strict=True)):
        raise ValueError(f"binning by {binning[0]}x{binning[1]} leaves nothing of {full[0]}x{full[1]} pixels")
    return sent


def _numbers(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    """`values` if there are `count` of them; zeros if there are none."""
    if len(values) not in (0, count):
        raise ValueError(f"{name} has {len(values)} numbers instead of {count}")
    return tuple(values) or (0.0,) * count


def _distortion(sensor: Intrinsics) -> tuple[tuple[float, ...], str]:
    """(coefficients, model); nothing where there is no distortion. A fisheye is one even with coefficients of zero."""
    if len(sensor.D) > MAX_COEFFICIENTS:
        raise ValueError(f"D has {len(sensor.D)} numbers, more than any lens model")
    coefficients = tuple(sensor.D)
    if not all(math.isfinite(value) for value in coefficients):
        raise ValueError("D has a number that is not finite")
    model = MODELS.get(sensor.model.strip().lower(), sensor.model)
    bent = any(coefficients) or (model == "equidistant" and coefficients)
    return (coefficients, model) if bent else ((), "")


def _pinhole(
    name: str, width: int, height: int, focal_and_centre: tuple[float, float, float, float], readout: Readout
) -> Camera | None:
    """The camera of the sent image from fx, fy, cx, cy of the sensor; None when a focal length is zero."""
    fx, fy, cx, cy = focal_and_centre
    if fx == 0 or fy == 0:
        return None
    if not all(abs(value) < MAX_PIXELS for value in focal_and_centre):
        raise ValueError(f"{name} has a number that no camera has (fx {fx:g}, fy {fy:g}, cx {cx:g}, cy {cy:g})")
    if fx < 1e-3 or abs(fy) < 1e-3:
        raise ValueError(f"{name} has a focal length that no camera has (fx {fx:g}, fy {fy:g})")
    bx, by = readout.binning[0] or 1, readout.binning[1] or 1
    x, y = readout.offset
    return Camera(width, height, fx / bx, fy / by, (cx - x + 0.5) / bx - 0.5, (cy - y + 0.5) / by - 0.5)
