"""CamVid: driving videos at 30 Hz, 11 classes, as the SegNet tutorial ships them or as they were published."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, ClassSet, Labels
from stsem.convert.imagefiles import (
    Capture,
    chosen,
    count,
    events,
    files,
    first_folders,
    read_text,
    walk,
)
from stsem.convert.recording import Options, Recording, even_stamp_ns
from stsem.convert.truth import Truth, stated_truth, truth_of
from stsem.errors import ConversionError
from stsem.log.container.files import natural

RATE_HZ = 30.0
_LEVELS = 2
_SPLITS = ("train", "val", "test")
_RAW, _LABELLED, _COLOURS = "701_StillsRaw_full", "LabeledApproved_full", "label_colors.txt"
_NAME = re.compile(r"(?P<sequence>[A-Za-z0-9]+)_f?(?P<frame>\d{1,9})")

CLASSES = ClassSet(
    names=("sky", "building", "pole", "road", "pavement", "tree", "sign", "fence", "car", "pedestrian", "bicyclist"),
    colours=((128, 128, 128), (128, 0, 0), (192, 192, 128), (128, 64, 128), (0, 0, 192), (128, 128, 0),
             (192, 128, 128), (64, 64, 128), (64, 0, 128), (64, 64, 0), (0, 128, 192)),
)  # fmt: skip
"""The 11 classes that are evaluated; their order is that of the ids of the SegNet tutorial."""

PUBLISHED: dict[str, tuple[tuple[int, int, int], str | None]] = {
    "Animal": ((64, 128, 64), "pedestrian"), "Archway": ((192, 0, 128), "building"),
    "Bicyclist": ((0, 128, 192), "bicyclist"), "Bridge": ((0, 128, 64), "building"),
    "Building": ((128, 0, 0), "building"), "Car": ((64, 0, 128), "car"),
    "CartLuggagePram": ((64, 0, 192), "pedestrian"), "Child": ((192, 128, 64), "pedestrian"),
    "Column_Pole": ((192, 192, 128), "pole"), "Fence": ((64, 64, 128), "fence"),
    "LaneMkgsDriv": ((128, 0, 192), "road"), "LaneMkgsNonDriv": ((192, 0, 64), "road"),
    "Misc_Text": ((128, 128, 64), "sign"), "MotorcycleScooter": ((192, 0, 192), "bicyclist"),
    "OtherMoving": ((128, 64, 64), "car"), "ParkingBlock": ((64, 192, 128), "pavement"),
    "Pedestrian": ((64, 64, 0), "pedestrian"), "Road": ((128, 64, 128), "road"),
    "RoadShoulder": ((128, 128, 192), "pavement"), "Sidewalk": ((0, 0, 192), "pavement"),
    "SignSymbol": ((192, 128, 128), "sign"), "Sky": ((128, 128, 128), "sky"),
    "SUVPickupTruck": ((64, 128, 192), "car"), "TrafficCone": ((0, 0, 64), "pole"),
    "TrafficLight": ((0, 64, 64), "sign"), "Train": ((192, 64, 128), "car"),
    "Tree": ((128, 128, 0), "tree"), "Truck_Bus": ((192, 128, 192), "car"),
    "Tunnel": ((64, 0, 64), "building"), "VegetationMisc": ((192, 192, 0), "tree"),
    "Void": ((0, 0, 0), None), "Wall": ((64, 192, 0), "building"),
}  # fmt: skip
"""The 32 classes as published: name -> (colour, which of the 11 it counts as). The grouping is that of SegNet."""


def detect(source: Path) -> bool:
    """Whether it has `train` and `trainannot` (or val, test), or `701_StillsRaw_full`."""
    return source.is_dir() and any(_raw_folder(folder) or _splits(folder) for folder in first_folders(source, _LEVELS))


def read(source: Path, options: Options) -> Recording:
    """One sequence (`0001TP`, `0006R0`, `0016E5`, `Seq05VD`), over all splits, its stamps from the frame numbers.

    Raises:
        ConversionError: no images, no clear choice of a sequence, or colours that cannot be read.
    """
    images, labels, published = _folders(source)
    sequences: dict[str, list[tuple[int, Path]]] = {}
    for path in (path for folder in images for path in files(folder)):
        if match := _NAME.fullmatch(path.stem):
            sequences.setdefault(match["sequence"], []).append((int(match["frame"]), path))
    if not sequences:
        raise ConversionError(
            f"{source} is no CamVid folder: train/ with trainannot/, or {_RAW}/, was expected, "
            "with images named like 0001TP_006690.png."
        )
    name = chosen(sequences, options, source)
    annotations = {path.stem.removesuffix("_L"): path for folder in labels for path in files(folder, (".png",))}
    rate = options.rate_hz or RATE_HZ
    captures = [
        Capture(even_stamp_ns(frame, rate), path, annotations.get(path.stem))
        for frame, path in sorted(sequences[name], key=lambda item: (item[0], natural(item[1].name)))
    ]
    labelled = sum(c.truth is not None for c in captures)
    notes = [f"{labelled} of {len(captures)} images are labelled."]
    named = sum(bool((match := _NAME.fullmatch(stem)) and match["sequence"] == name) for stem in annotations)
    if named > labelled:
        notes.append(f"{named - labelled} label images belong to no colour image: left out.")
    truth = _published_truth(source, labels, options, notes) if published else _tutorial_truth(options, notes)
    return Recording(
        events=events(captures, source, notes, truth=truth),
        count=count(captures),
        classes=truth.classes if labelled else None,
        notes=notes,
    )


def _raw_folder(folder: Path) -> bool:
    return (folder / _RAW).is_dir()


def _splits(folder: Path) -> list[str]:
    return [s for s in _SPLITS if (folder / s).is_dir() and (folder / f"{s}annot").is_dir()]


def _folders(source: Path) -> tuple[list[Path], list[Path], bool]:
    """(folders of images, folders of label images, whether the labels are the published colours)."""
    for folder in walk(source, _LEVELS):
        if _raw_folder(folder):
            below = [f for f in walk(folder, 2) if f.name == _LABELLED]
            return list(walk(folder / _RAW, 1)), below, True
        if splits := _splits(folder):
            return [folder / s for s in splits], [folder / f"{s}annot" for s in splits], False
    return [], [], False


def _tutorial_truth(options: Options, notes: list[str]) -> Truth:
    """Ids 0 to 10; 11 is unlabelled."""
    return truth_of(options, CLASSES, {i: i for i in range(len(CLASSES))}, notes)


def _published_truth(source: Path, labels: list[Path], options: Options, notes: list[str]) -> Truth:
    """Colours of `label_colors.txt`, or the published ones without such a file, grouped into the 11 classes."""
    if options.classes_file is not None:
        return stated_truth(options.classes_file, notes)
    colours = dict(PUBLISHED.values())
    near = {folder for label in labels for folder in (label, label.parent)} | {source}
    path = next((p for f in sorted(near) if (p := f / _COLOURS).is_file()), None)
    if path is not None:
        colours = _colours(path, source)
    return Truth(CLASSES, _grouping(colours))


def _colours(path: Path, source: Path) -> dict[tuple[int, int, int], str | None]:
    """RGB -> group, from lines `r g b name`."""
    colours: dict[tuple[int, int, int], str | None] = {}
    for line in read_text(path, source).splitlines():
        match line.split():
            case []:
                continue
            case [r, g, b, name] if name in PUBLISHED and all(v.isdecimal() and int(v) < 256 for v in (r, g, b)):
                colours[int(r), int(g), int(b)] = PUBLISHED[name][1]
            case _:
                raise ConversionError(
                    f"{path} has the line {line[:60]!r}, but 'r g b name' with a name of CamVid's 32 classes was "
                    "expected; mend the file or remove it."
                )
    return colours


def _grouping(colours: dict[tuple[int, int, int], str | None]) -> Callable[[npt.NDArray[Any]], Labels]:
    table = np.full(1 << 24, NO_LABEL, np.uint8)
    for (r, g, b), group in colours.items():
        found = None if group is None else CLASSES.find(group)
        table[r << 16 | g << 8 | b] = NO_LABEL if found is None else found

    def labels(raw: npt.NDArray[Any]) -> Labels:
        if raw.ndim != 3:
            raise ValueError("it holds one channel, but the published colours were expected")
        wide = raw.astype(np.int32)
        return np.asarray(table[wide[:, :, 0] << 16 | wide[:, :, 1] << 8 | wide[:, :, 2]], np.uint8)

    return labels
