"""Cityscapes: 30-frame snippets of driving videos at 17 Hz, the 20th frame of each labelled."""

import json
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.classes import ClassSet
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
from stsem.convert.truth import truth_of
from stsem.errors import ConversionError
from stsem.frame import Depth

RATE_HZ = 17.0
PUBLISHED_SIZE = (2048, 1024)
"""Width and height that the camera files are for; images may have been made smaller."""
_LEVELS = 3

CLASSES = ClassSet(
    names=("road", "sidewalk", "building", "wall", "fence", "pole", "traffic light", "traffic sign", "vegetation",
           "terrain", "sky", "person", "rider", "car", "truck", "bus", "train", "motorcycle", "bicycle"),
    colours=((128, 64, 128), (244, 35, 232), (70, 70, 70), (102, 102, 156), (190, 153, 153), (153, 153, 153),
             (250, 170, 30), (220, 220, 0), (107, 142, 35), (152, 251, 152), (70, 130, 180), (220, 20, 60),
             (255, 0, 0), (0, 0, 142), (0, 0, 70), (0, 60, 100), (0, 80, 100), (0, 0, 230), (119, 11, 32)),
)  # fmt: skip
"""The 19 classes that are evaluated; their order is that of the trainIds."""

LABEL_IDS = (7, 8, 11, 12, 13, 17, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 31, 32, 33)
"""The id of each class in a `labelIds` image; all others are void."""

COLOR, TRAIN_IDS, IDS, CAMERA, DISPARITY = (
    "leftImg8bit.png", "gtFine_labelTrainIds.png", "gtFine_labelIds.png", "camera.json", "disparity.png"
)  # fmt: skip
_KINDS = "|".join(re.escape(kind) for kind in (COLOR, TRAIN_IDS, IDS, CAMERA, DISPARITY))
_NAME = re.compile(rf"(?P<sequence>.+_\d+)_(?P<frame>\d{{1,9}})_(?P<kind>{_KINDS})")


@dataclass
class _Found:
    """Files of one sequence: kind -> frame number -> path."""

    of: dict[str, dict[int, Path]] = field(default_factory=dict)

    def get(self, kind: str) -> dict[int, Path]:
        return self.of.get(kind, {})


def detect(source: Path) -> bool:
    """Whether a file named like `aachen_000000_000019_leftImg8bit.png` lies in it."""
    return source.is_dir() and any(kind == COLOR for _, _, kind, _ in _listing(first_folders(source, _LEVELS)))


def read(source: Path, options: Options) -> Recording:
    """One sequence `<city>_<seq>`, its stamps from the frame numbers, so that gaps between snippets stay.

    Raises:
        ConversionError: no images, no clear choice of a sequence, or a camera file that cannot be read.
    """
    sequences: dict[str, _Found] = {}
    for sequence, frame, kind, path in _listing(walk(source, _LEVELS)):
        sequences.setdefault(sequence, _Found()).of.setdefault(kind, {}).setdefault(frame, path)
    sequences = {name: found for name, found in sequences.items() if found.get(COLOR)}
    if not sequences:
        raise ConversionError(
            f"{source} is no Cityscapes folder: leftImg8bit_sequence/<split>/<city>/*_leftImg8bit.png was expected."
        )
    found = sequences[chosen(sequences, options, source)]
    captures = _captures(found, options.rate_hz or RATE_HZ)
    notes = _notes(found)
    raw_ids = range(len(CLASSES)) if found.get(TRAIN_IDS) else LABEL_IDS
    truth = truth_of(options, CLASSES, {raw: own for own, raw in enumerate(raw_ids)}, notes)
    camera, to_metres = _calibration(source, found, captures)
    return Recording(
        events=events(captures, source, notes, truth=truth, depth=to_metres),
        count=count(captures),
        classes=truth.classes if any(c.truth for c in captures) else None,
        camera=camera,
        notes=notes,
    )


def _listing(folders: Iterable[Path]) -> Iterator[tuple[str, int, str, Path]]:
    """(sequence, frame number, kind, path) of everything that is named as in Cityscapes."""
    for folder in folders:
        for path in files(folder, (".png", ".json")):
            if match := _NAME.fullmatch(path.name):
                yield match["sequence"], int(match["frame"]), match["kind"], path


def _captures(found: _Found, rate_hz: float) -> list[Capture]:
    truth = found.get(TRAIN_IDS) or found.get(IDS)
    depth = found.get(DISPARITY) if found.get(CAMERA) else {}
    return [
        Capture(even_stamp_ns(frame, rate_hz), path, truth.get(frame), depth.get(frame))
        for frame, path in sorted(found.get(COLOR).items())
    ]


def _notes(found: _Found) -> list[str]:
    colors, truth = set(found.get(COLOR)), set(found.get(TRAIN_IDS) or found.get(IDS))
    notes = [f"{len(truth & colors)} of {len(colors)} images are labelled."]
    if not truth:
        notes = ["No label image of this sequence (gtFine) lies in the source: the log has no truth."]
    if astray := len(truth - colors):
        notes.append(f"{astray} label images belong to no colour image: left out.")
    if not found.get(CAMERA):
        notes.append("No camera file of this sequence lies in the source: the log has no intrinsics and no depth.")
    return notes


def _calibration(
    source: Path, found: _Found, captures: list[Capture]
) -> tuple[Camera | None, Callable[[npt.NDArray[Any]], Depth] | None]:
    """(intrinsics, from disparity samples to metres), both from the sequence's first camera file."""
    path = next((path for _, path in sorted(found.get(CAMERA).items())), None)
    if path is None:
        return None, None
    try:
        document = json.loads(read_text(path, source))
        fx, fy, cx, cy = (float(document["intrinsic"][key]) for key in ("fx", "fy", "u0", "v0"))
        baseline = float(document["extrinsic"]["baseline"])
        usable = np.isfinite([fx, fy, cx, cy, baseline]).all() and fx > 0 and fy > 0
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError):
        usable = False
    if not usable:
        raise ConversionError(
            f"{path} is no Cityscapes camera: intrinsic.fx fy u0 v0 and extrinsic.baseline were expected as numbers; "
            "mend or remove the file."
        )
    size = image_size(captures, source)
    camera = Camera(*PUBLISHED_SIZE, fx, fy, cx, cy).scaled(*size) if size else None
    return camera, lambda raw: _metres(raw, abs(baseline) * fx)


def _metres(raw: npt.NDArray[Any], baseline_fx: float) -> Depth:
    """Depth of a 16-bit disparity image: 0 is unknown, p is a disparity of (p - 1) / 256 pixels."""
    if raw.dtype != np.uint16 or raw.ndim != 2:
        raise ValueError("one channel of 16 bits was expected")
    disparity = (raw.astype(np.float64) - 1) / 256
    disparity[disparity <= 0] = np.nan
    return (baseline_fx / disparity).astype(np.float32)
