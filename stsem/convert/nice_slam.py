"""Replica as NICE-SLAM rendered it: results/frame000000.jpg, results/depth000000.png, traj.txt.

The poses of traj.txt are camera to world in optical axes (x right, y down, z forward): the loader of NICE-SLAM turns
them into those of OpenGL by two signs, so the file is taken as it is.
"""

import json
import re
from itertools import chain
from pathlib import Path
from typing import Any

from stsem.camera import Camera
from stsem.convert.depthfiles import metres
from stsem.convert.imagefiles import Capture, count, events, files, image_size, read_text
from stsem.convert.lists import matrix_pose, numbers, rows
from stsem.convert.recording import Loss, Options, Recording, even_stamp_ns
from stsem.convert.rigid import is_rigid
from stsem.errors import ConversionError
from stsem.pose import Pose

RESULTS, POSES, PARAMETERS = "results", "traj.txt", "cam_params.json"
RATE_HZ, UNITS_PER_METRE = 30.0, 6553.5
MAX_SIDE = 1 << 16
CAMERA = Camera(1200, 680, 600.0, 600.0, 599.5, 339.5)
_NAME = re.compile(r"(frame|depth)(\d{1,9})")


def detect(source: Path) -> bool:
    """Whether it is a folder with results/frame*."""
    return any(path.name.startswith("frame") for path in files(source / RESULTS))


def read(source: Path, options: Options) -> Recording:
    """Image k has the pose in line k of traj.txt and, at 30 Hz, the stamp of its number.

    Raises:
        ConversionError: there is no image, or a file of text is none.
    """
    found = _images(source)
    if not found["frame"]:
        raise ConversionError(f"{source} has no images; {RESULTS}/frame000000.jpg and so on were expected.")
    losses: list[Loss] = []
    notes: list[str] = []
    rate_hz = options.rate_hz or RATE_HZ
    poses = _poses(source, losses, notes)
    captures = [
        Capture(even_stamp_ns(index, rate_hz), path, depth=found["depth"].get(index), T_WC=poses.get(index))
        for index, path in sorted(found["frame"].items())
    ]
    if options.rate_hz is None:
        notes.append(f"The data set has no stamps: {RATE_HZ:g} images per second were assumed (--rate HZ).")
    camera, scale = _camera(source, image_size(captures, source), notes)
    to_metres = metres(options.depth_scale or scale)
    return Recording(
        events=chain(losses, events(captures, source, notes, depth=to_metres)),
        count=len(losses) + count(captures),
        camera=camera,
        notes=notes,
    )


def _images(source: Path) -> dict[str, dict[int, Path]]:
    """`frame` and `depth` -> number -> file."""
    found: dict[str, dict[int, Path]] = {"frame": {}, "depth": {}}
    for path in files(source / RESULTS):
        if match := _NAME.fullmatch(path.stem):
            found[match[1]][int(match[2])] = path
    return found


def _poses(source: Path, losses: list[Loss], notes: list[str]) -> dict[int, Pose]:
    if not (source / POSES).is_file():
        notes.append(f"There is no {POSES}: the log has no poses.")
        return {}
    poses: dict[int, Pose] = {}
    for index, words in enumerate(rows(source / POSES, source)):
        try:
            pose = matrix_pose(words)
            if not is_rigid(pose):
                raise ValueError("not a rotation")
            poses[index] = pose
        except ValueError:
            losses.append(Loss(f"lines of {POSES} that are not a 4x4 pose"))
    return poses


def _camera(source: Path, size: tuple[int, int] | None, notes: list[str]) -> tuple[Camera | None, float]:
    """(intrinsics, units of depth per metre) by cam_params.json in the folder, else those of all of Replica."""
    if (source / PARAMETERS).is_file():
        return camera_file(source / PARAMETERS, source)
    if size == (CAMERA.width, CAMERA.height):
        notes.append(f"There is no {PARAMETERS} in the folder: that of all scenes of Replica was assumed.")
        return CAMERA, UNITS_PER_METRE
    notes.append(
        f"There is no {PARAMETERS} in the folder, and the images are not 1200x680: the log has no calibration."
    )
    return None, UNITS_PER_METRE


def camera_file(path: Path, root: Path) -> tuple[Camera, float]:
    """(intrinsics, units of depth per metre) of `{"camera": {"w", "h", "fx", "fy", "cx", "cy", "scale"}}`.

    Raises:
        ConversionError: it is not such a file.
    """
    try:
        document: Any = json.loads(read_text(path, root))
        told = document.get("camera", document)
        fx, fy, cx, cy, scale = numbers(
            [str(told[k]) for k in ("fx", "fy", "cx", "cy")] + [str(told.get("scale", 1000))]
        )
        width, height = (int(told.get(short, told.get(long))) for short, long in (("w", "width"), ("h", "height")))
        if min(fx, fy, scale, width, height) <= 0 or max(width, height) > MAX_SIDE:
            raise ValueError("a number is not above zero, or no image is so large")
        return Camera(width, height, fx, fy, cx, cy), scale
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as err:
        form = '{"camera": {"w": 1200, "h": 680, "fx": 600, "fy": 600, "cx": 599.5, "cy": 339.5, "scale": 6553.5}}'
        raise ConversionError(f"{path} is not a camera ({err}); it should look like {form}.") from err
