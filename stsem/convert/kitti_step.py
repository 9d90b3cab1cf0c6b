"""KITTI-STEP: KITTI tracking videos whose every frame is labelled with the Cityscapes classes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.classes import Labels
from stsem.convert.cityscapes import CLASSES
from stsem.convert.imagefiles import (
    Capture,
    chosen,
    count,
    events,
    files,
    first_folders,
    image_size,
    read_text,
    walk,
)
from stsem.convert.recording import Options, Recording, even_stamp_ns
from stsem.convert.rigid import is_rigid
from stsem.convert.truth import Truth, truth_of
from stsem.errors import ConversionError
from stsem.pose import Pose

RATE_HZ = 10.0
_LEVELS = 3
_Matrix = npt.NDArray[np.float64]


def detect(source: Path) -> bool:
    """Whether there is a folder `image_02` of sequences with `panoptic_maps` near it."""
    names = {folder.name for folder in first_folders(source, _LEVELS)} if source.is_dir() else set()
    return {"image_02", "panoptic_maps"} <= names


def read(source: Path, options: Options) -> Recording:
    """A sequence: `image_02/<seq>/*.png`, `panoptic_maps/<split>/<seq>/*.png`, and, when at hand, calib and poses.

    Raises:
        ConversionError: no images, no clear choice of a sequence, or a calibration or pose file that cannot be read.
    """
    sequences = _sequences(source)
    if not sequences:
        raise ConversionError(
            f"{source} is no KITTI-STEP folder: image_02/<sequence>/ with png images was expected in it or below it."
        )
    name = chosen(sequences, options, source)
    notes: list[str] = []
    projection = _projection(source, name, notes)
    poses = _poses(source, name, projection, notes)
    captures = _captures(source, sequences[name], name, options, poses, notes)
    _count_missing(captures, bool(poses), notes)
    truth = truth_of(options, CLASSES, {i: i for i in range(len(CLASSES))}, notes)
    by_red = Truth(truth.classes, lambda raw: truth.labels(_semantic(raw)))
    return Recording(
        events=events(captures, source, notes, truth=by_red),
        count=count(captures),
        classes=truth.classes if any(c.truth for c in captures) else None,
        camera=_camera(projection, image_size(captures, source)),
        notes=notes,
    )


def _sequences(source: Path) -> dict[str, Path]:
    """Name -> folder of images. The folder `image_02` lies in the source, or in `training` and the like below it."""
    found: dict[str, Path] = {}
    for folder in walk(source, _LEVELS):
        if folder.parent.name == "image_02" and files(folder):
            found.setdefault(folder.name, folder)
    return found


def _captures(
    source: Path, images: Path, name: str, options: Options, poses: Mapping[int, Pose], notes: list[str]
) -> list[Capture]:  # fmt: skip
    maps: dict[str, Path] = {}
    for folder in walk(source, _LEVELS + 1):
        if folder.name == name and "panoptic_maps" in folder.relative_to(source).parts:
            maps |= {path.stem: path for path in files(folder, (".png",))}
    rate = options.rate_hz or RATE_HZ
    paths = files(images)
    if astray := len(maps.keys() - {path.stem for path in paths}):
        notes.append(f"{astray} label images belong to no colour image: left out.")
    numbered = all(path.stem.isdecimal() for path in paths)
    numbers = [int(path.stem) for path in paths] if numbered else range(len(paths))
    return [
        Capture(even_stamp_ns(number, rate), path, maps.get(path.stem), None, poses.get(number))
        for number, path in zip(numbers, paths, strict=True)
    ]


def _count_missing(captures: list[Capture], has_poses: bool, notes: list[str]) -> None:
    unlabelled = sum(c.truth is None for c in captures)
    if unlabelled:
        notes.append(f"{unlabelled} of {len(captures)} images have no label image.")
    unposed = sum(c.T_WC is None for c in captures)
    if has_poses and unposed:
        notes.append(f"{unposed} of {len(captures)} images have no pose.")


def _semantic(raw: npt.NDArray[Any]) -> Labels:
    """The class of each pixel: the red channel; green and blue number the instances."""
    if raw.ndim != 3:
        raise ValueError("it holds one channel, but the class in red and the instance in green and blue were expected")
    return np.ascontiguousarray(raw[:, :, 0])


def _projection(source: Path, name: str, notes: list[str]) -> _Matrix | None:
    """P2 (3, 4) of the left colour camera; None without a calibration file."""
    path = _beside(source, "calib", name)
    if path is None:
        notes.append(f"There is no calib/{name}.txt: the log has no intrinsics.")
        return None
    for line in read_text(path, source).splitlines():
        key, _, rest = line.strip().partition(" ")
        if key.rstrip(":") == "P2":
            P = _numbers(rest, path)
            if P[0, 0] > 0 and P[1, 1] > 0 and P[1, 0] == 0 and (P[2, :3] == (0, 0, 1)).all():
                return P
            break
    raise ConversionError(f"{path} has no usable line 'P2: ' with 12 numbers; mend the file or remove it.")


def _poses(source: Path, name: str, P: _Matrix | None, notes: list[str]) -> dict[int, Pose]:
    """Frame number -> T_WC of camera 2. The file has those of camera 0, which P2 = K [I | t] leads to."""
    path = _beside(source, "poses", name)
    if path is None:
        return {}
    T_02 = np.eye(4)
    if P is None:
        notes.append("Without calib the poses are those of camera 0, some centimetres beside the images' camera.")
    else:
        T_02[:3, 3] = -np.linalg.solve(P[:, :3], P[:, 3])
    poses = {}
    for index, line in enumerate(line for line in read_text(path, source).splitlines() if line.strip()):
        T_W0 = np.vstack([_numbers(line, path), [0, 0, 0, 1]])
        if is_rigid(T_W0):
            poses[index] = T_W0 @ T_02
    return poses


def _beside(source: Path, folder_name: str, name: str) -> Path | None:
    paths = (folder / f"{name}.txt" for folder in walk(source, _LEVELS) if folder.name == folder_name)
    return next((path for path in paths if path.is_file()), None)


def _numbers(text: str, path: Path) -> _Matrix:
    try:
        matrix = np.array([float(word) for word in text.split()]).reshape(3, 4)
    except ValueError:
        matrix = np.full((3, 4), np.nan)
    if not np.isfinite(matrix).all():
        raise ConversionError(f"{path} has a line that is not 12 numbers ({text[:40]!r}); mend the file or remove it.")
    return matrix


def _camera(P: _Matrix | None, size: tuple[int, int] | None) -> Camera | None:
    if P is None or size is None:
        return None
    return Camera(*size, fx=float(P[0, 0]), fy=float(P[1, 1]), cx=float(P[0, 2]), cy=float(P[1, 2]))
