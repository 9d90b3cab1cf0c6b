"""ICL-NUIM in its TUM-compatible form: rendered living room and office (doc.ic.ac.uk/~ahanda/VaFRIC/iclnuim.html).

Its camera has fy = -480: y of the camera points up, and camera and world are left-handed. Both are mirrored in y here:
with F = diag(1, -1, 1, 1) the optical frame is p' = F p, the world is w' = F w, so fy becomes +480 and the pose
T_WC = F T F, a rotation again.
"""

import re
from itertools import chain
from pathlib import Path

import numpy as np

from stsem.camera import Camera
from stsem.convert.depthfiles import metres
from stsem.convert.imagefiles import Capture, count, events, files, image_size
from stsem.convert.lists import rows, stamped_pose
from stsem.convert.recording import Loss, Options, Recording, even_stamp_ns
from stsem.errors import ConversionError
from stsem.pose import Pose

ASSOCIATIONS, POSES = "associations.txt", "*.gt.freiburg"
UNITS_PER_METRE, RATE_HZ = 5000.0, 30.0
CAMERA = Camera(640, 480, 481.2, 480.0, 319.5, 239.5)
MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])
MAX_INDEX = 10**7


def detect(source: Path) -> bool:
    """Whether it is a folder with associations.txt or a *.gt.freiburg file, and without the rgb.txt of TUM RGB-D."""
    if not source.is_dir() or (source / "rgb.txt").is_file():
        return False
    return (source / ASSOCIATIONS).is_file() or bool(_pose_files(source))


def read(source: Path, options: Options) -> Recording:
    """The frames of associations.txt, else of the folders rgb and depth, at 30 Hz by their numbers.

    Raises:
        ConversionError: there is no frame, several pose files, or a file that is no text.
    """
    losses: list[Loss] = []
    notes = ["The data set is left-handed (fy = -480): camera and world were mirrored in y."]
    rate_hz = options.rate_hz or RATE_HZ
    pairs = _associated(source, losses) if (source / ASSOCIATIONS).is_file() else _numbered(source)
    if not pairs:
        raise ConversionError(f"{source} has no frame: {ASSOCIATIONS}, or the folders rgb and depth, were expected.")
    poses = _poses(source, losses, notes)
    captures = [
        Capture(even_stamp_ns(index, rate_hz), color=color, depth=depth, T_WC=poses.pop(index, None))
        for index, (color, depth) in sorted(pairs.items())
    ]
    without = sum(capture.T_WC is None for capture in captures)
    if without and without < len(captures):
        losses.append(Loss("frames without a pose", count=without))
    size = image_size(captures, source)
    if size not in (None, (CAMERA.width, CAMERA.height)):
        notes.append("The images are not 640x480: the calibration was scaled.")
    return Recording(
        events=chain(losses, events(captures, source, notes, depth=metres(options.depth_scale or UNITS_PER_METRE))),
        count=len(losses) + count(captures),
        camera=CAMERA.scaled(*size) if size else None,
        notes=notes,
    )


Pairs = dict[int, tuple[Path | None, Path | None]]


def _associated(source: Path, losses: list[Loss]) -> Pairs:
    """Frame number -> (colour, depth) by lines such as `0 depth/0.png 0 rgb/0.png`, in either order."""
    pairs: Pairs = {}
    for words in rows(source / ASSOCIATIONS, source):
        try:
            first, one, second, other = words
            color, depth = (other, one) if one.startswith("depth") else (one, other)
            index = _index(second if color == other else first)
            pairs[index] = (source / color, source / depth)
        except ValueError:
            losses.append(Loss(f"lines of {ASSOCIATIONS} that are not `0 depth/0.png 0 rgb/0.png`"))
    return pairs


def _numbered(source: Path) -> Pairs:
    colors, depths = ({_number(path): path for path in files(source / name)} for name in ("rgb", "depth"))
    return {index: (path, depths.get(index)) for index, path in colors.items() if index is not None}


def _number(path: Path) -> int | None:
    match = re.search(r"(\d{1,7})$", path.stem)
    return int(match[1]) if match else None


def _index(word: str) -> int:
    """A frame number, also where it was written as a float."""
    value = float(word)
    if not (0 <= value < MAX_INDEX and value == int(value)):
        raise ValueError(f"{word} is not the number of a frame")
    return int(value)


def _pose_files(source: Path) -> list[Path]:
    try:
        return sorted(source.glob(POSES))
    except OSError:
        return []


def _poses(source: Path, losses: list[Loss], notes: list[str]) -> dict[int, Pose]:
    """Frame number -> T_WC, right-handed."""
    found = _pose_files(source)
    if not found:
        notes.append(f"There is no {POSES} file: the log has no poses.")
        return {}
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise ConversionError(f"{source} has several trajectories ({names}); leave the one of these images there.")
    poses: dict[int, Pose] = {}
    for words in rows(found[0], source):
        try:
            poses[_index(words[0])] = MIRROR @ stamped_pose(words[1:]) @ MIRROR
        except ValueError:
            losses.append(Loss(f"lines of {found[0].name} that are not a number and a pose"))
    return poses
