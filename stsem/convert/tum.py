"""TUM RGB-D: lists of stamped images, and poses of the colour camera (cvg.cit.tum.de/data/datasets/rgbd-dataset)."""

import re
from collections.abc import Callable, Iterator
from itertools import chain, pairwise
from pathlib import Path

from stsem.camera import Camera
from stsem.convert.depthfiles import metres
from stsem.convert.imagefiles import Capture, count, events, image_size
from stsem.convert.lists import numbers, rows, stamp_ns, stamped_pose
from stsem.convert.recording import Loss, Options, Recording
from stsem.errors import ConversionError

COLOR, DEPTH, POSES, CALIBRATION = "rgb.txt", "depth.txt", "groundtruth.txt", "calibration.txt"
UNITS_PER_METRE = 5000.0
SIZE = (640, 480)

CAMERAS: dict[str, Camera] = {
    "freiburg1": Camera(
        *SIZE, 517.3, 516.5, 318.6, 255.3, (0.2624, -0.9531, -0.0054, 0.0026, 1.1633), "plumb_bob"
    ),
    "freiburg2": Camera(
        *SIZE, 520.9, 521.0, 325.1, 249.7, (0.2312, -0.7849, -0.0033, -0.0001, 0.9172), "plumb_bob"
    ),
    "freiburg3": Camera(*SIZE, 535.4, 539.2, 320.1, 247.6),
}  # fmt: skip
"""Intrinsics and lens distortion as the authors calibrated them; freiburg3 came undistorted."""

DEFAULT = Camera(*SIZE, 525.0, 525.0, 319.5, 239.5)
"""What OpenNI drivers assume, and the authors propose where nothing better is known."""


def detect(source: Path) -> bool:
    """Whether it is a folder with an rgb.txt."""
    return (source / COLOR).is_file()


def read(source: Path, options: Options) -> Recording:
    """Depth and poses keep the stamps of their own; depth is pixel for pixel that of colour.

    Raises:
        ConversionError: rgb.txt is missing, is no text, or lists nothing.
    """
    notes: list[str] = []
    losses: list[Loss] = []
    color = _listed(source, COLOR, lambda stamp, name: Capture(stamp, color=source / name), losses, notes)
    if not color:
        raise ConversionError(
            f"{source / COLOR} lists no image; lines such as `1305031102.1753 rgb/1.png` belong there."
        )
    depth = _listed(source, DEPTH, lambda stamp, name: Capture(stamp, depth=source / name), losses, notes)
    captures = sorted([*_poses(source, losses, notes), *color, *depth], key=lambda capture: capture.stamp_ns)
    to_metres = metres(options.depth_scale or UNITS_PER_METRE)
    return Recording(
        events=chain(losses, events(captures, source, notes, depth=to_metres)),
        count=len(losses) + count(captures),
        camera=_camera(source, image_size(color, source), notes),
        notes=notes,
    )


def _listed(
    source: Path, name: str, capture: Callable[[int, str], Capture], losses: list[Loss], notes: list[str]
) -> list[Capture]:
    """The captures of a list of stamps and files; in its order, which should be that of time."""
    if not (source / name).is_file():
        notes.append(f"There is no {name}.")
        return []
    found: list[Capture] = []
    for words in rows(source / name, source):
        try:
            stamp, file = words
            found.append(capture(stamp_ns(stamp), file))
        except ValueError:
            losses.append(Loss(f"lines of {name} that are not a stamp and a file"))
    if any(later.stamp_ns < earlier.stamp_ns for earlier, later in pairwise(found)):
        notes.append(f"The stamps of {name} do not ascend: its lines were sorted.")
    return found


def _poses(source: Path, losses: list[Loss], notes: list[str]) -> Iterator[Capture]:
    if not (source / POSES).is_file():
        notes.append(f"There is no {POSES}: the log has no poses.")
        return
    for words in rows(source / POSES, source):
        try:
            yield Capture(stamp_ns(words[0]), T_WC=stamped_pose(words[1:]))
        except ValueError:
            losses.append(Loss(f"lines of {POSES} that are not a stamp and a pose"))


def _camera(source: Path, size: tuple[int, int] | None, notes: list[str]) -> Camera | None:
    """By calibration.txt (fx fy cx cy, as in ETH3D), by the name of the folder, or the default."""
    if size is None:
        return None
    if (source / CALIBRATION).is_file():
        try:
            fx, fy, cx, cy = numbers(rows(source / CALIBRATION, source)[0][:4])
            return Camera(*size, fx, fy, cx, cy)
        except (ValueError, IndexError):
            notes.append(f"{CALIBRATION} is not `fx fy cx cy` and was not used.")
    match = re.search(r"(?:freiburg|fr)([123])(?!\d)", source.resolve().name.lower())
    if size != SIZE:
        notes.append(f"No calibration is known for images of {size[0]}x{size[1]}: the log has none.")
        return None
    if match:
        return CAMERAS[f"freiburg{match[1]}"]
    notes.append(
        "The calibration is the default of TUM RGB-D (525, 525, 319.5, 239.5), as the folder's name does not say "
        "freiburg1, 2 or 3."
    )
    return DEFAULT
