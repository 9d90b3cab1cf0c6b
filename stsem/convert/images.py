"""Plain folders of images: colour, and if there are any depth, labels and poses, told by the names of the folders."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from stsem.camera import Camera
from stsem.convert.depthfiles import metres
from stsem.convert.imagefiles import Capture, count, events, files, read_text
from stsem.convert.lists import matrix_pose, rows, stamp_ns, stamped_pose
from stsem.convert.names import Keys, keys_of
from stsem.convert.nice_slam import camera_file
from stsem.convert.recording import Loss, Options, Recording, even_stamp_ns
from stsem.convert.truth import Truth, stated_truth, table_truth
from stsem.errors import ConversionError
from stsem.log.classtable import parse
from stsem.pose import Pose

COLOR = ("rgb", "color", "colour", "images", "image")
DEPTH = ("depth", "depths")
LABELS = ("labels", "label", "gt", "semantic", "semantics", "segmentation")
POSES = ("poses.txt", "traj.txt", "trajectory.txt", "groundtruth.txt")
CLASSES = ("classes.json", "classes.toml", "classes.txt")
CAMERAS = ("camera.json", "cam_params.json")
RATE_HZ, UNITS_PER_METRE = 30.0, 1000.0


@dataclass
class _Found:
    """What has been read, and what has to be said about it."""

    source: Path
    keys: Keys
    losses: list[Loss] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def detect(source: Path) -> bool:
    """Whether it is a folder of images, or one with a folder rgb, color or images."""
    return source.is_dir() and bool(_color(source))


def read(source: Path, options: Options) -> Recording:
    """Stamps are in the names of the images, else they follow each other at `options.rate_hz`.

    Raises:
        ConversionError: there is no image, or a text file that cannot be read.
        ClassTableError: a class table that cannot be used.
    """
    colors = _color(source)
    if not colors:
        raise ConversionError(f"{source} has no images (png, jpg or webp), neither in it nor in {', '.join(COLOR)}.")
    found = _Found(source, keys_of(colors))
    if twins := len(colors) - len(found.keys.files):
        found.losses.append(Loss("colour images of the same name as another one", count=twins))
    stamps = _stamps(found, options.rate_hz)
    truth = _truth(found, options)
    labels = _partners(found, LABELS, "label images") if truth else {}
    depths = _partners(found, DEPTH, "depth images")
    camera, scale = _camera(found)
    if depths and not (options.depth_scale or scale):
        found.notes.append(f"Depth is taken as {UNITS_PER_METRE:g} units per metre (--depth-scale S).")
    images = [
        Capture(stamps[key], color=path, truth=labels.get(key), depth=depths.get(key))
        for key, path in found.keys.files.items()
    ]
    captures = sorted([*_poses(found, list(stamps.values())), *images], key=lambda capture: capture.stamp_ns)
    to_metres = metres(options.depth_scale or scale or UNITS_PER_METRE)
    return Recording(
        events=chain(
            found.losses,
            events(captures, source, found.notes, truth=truth, depth=to_metres),
        ),
        count=len(found.losses) + count(captures),
        classes=truth.classes if truth and labels else None,
        camera=camera,
        notes=found.notes,
    )


def _color(source: Path) -> list[Path]:
    return next((images for name in COLOR if (images := files(source / name))), files(source))


def _first(source: Path, names: Sequence[str]) -> Path | None:
    return next((source / name for name in names if (source / name).is_file()), None)


def _stamps(found: _Found, rate_hz: float | None) -> dict[int | str, int]:
    """Key -> stamp; a stated rate goes before the names."""
    if found.keys.stamped and rate_hz is None:
        return {key: int(key) for key in found.keys.files}
    if rate_hz is None:
        found.notes.append(f"The images have no stamps: {RATE_HZ:g} images per second were assumed (--rate HZ).")
    return {key: even_stamp_ns(k, rate_hz or RATE_HZ) for k, key in enumerate(found.keys.files)}


def _partners(found: _Found, folders: Sequence[str], what: str) -> dict[int | str, Path]:
    """Key of a colour image -> the image of that stamp, number or name in the first of the `folders` that has any."""
    images = next((images for name in folders if (images := files(found.source / name))), [])
    of_key = found.keys.match(images)
    lost = len(images) - sum(key in found.keys.files for key in of_key)
    if lost:
        found.losses.append(Loss(f"{what} that belong to no colour image", count=lost))
    return {key: path for key, path in of_key.items() if key in found.keys.files}


def _truth(found: _Found, options: Options) -> Truth | None:
    count = next((len(images) for name in LABELS if (images := files(found.source / name))), 0)
    table = options.classes_file or _first(found.source, CLASSES)
    if not count:
        return None
    if table is None:
        found.losses.append(Loss("label images that no class table names (--classes FILE)", count=count))
        return None
    if table.suffix.lower() != ".txt":
        return stated_truth(table, found.notes)
    names = [line.strip() for line in read_text(table, table.parent).splitlines() if line.strip()]
    return table_truth(parse(names, str(table)), found.notes)


def _camera(found: _Found) -> tuple[Camera | None, float | None]:
    path = _first(found.source, CAMERAS)
    if path is not None:
        return camera_file(path, found.source)
    found.notes.append(f"There is no {' or '.join(CAMERAS)}: the log has no calibration.")
    return None, None


def _poses(found: _Found, stamps: Sequence[int]) -> list[Capture]:
    """Lines `stamp tx ty tz qx qy qz qw`, or a 3x4 or 4x4 matrix for each image: camera to world, optical axes."""
    path = _first(found.source, POSES)
    if path is None:
        return []
    lines = rows(path, found.source)
    captures: list[Capture] = []
    for k, words in enumerate(lines):
        try:
            stamp, pose = _pose(words, k, stamps, stamped=found.keys.stamped)
            captures.append(Capture(stamp, T_WC=pose))
        except (ValueError, IndexError):
            found.losses.append(Loss(f"lines of {path.name} that are not a pose, or that of no image"))
    if not found.keys.stamped and len(lines) < len(stamps):
        found.losses.append(Loss("images without a pose", count=len(stamps) - len(lines)))
    found.notes.append(f"The poses of {path.name} are taken as camera to world in optical axes (z forward).")
    return captures


def _pose(words: list[str], index: int, stamps: Sequence[int], *, stamped: bool) -> tuple[int, Pose]:
    """(stamp, T_WC); without stamps in the names of the images line k belongs to image k."""
    if len(words) == 8:
        return stamp_ns(words[0]) if stamped else stamps[index], stamped_pose(words[1:])
    return stamps[index], matrix_pose(words)
