"""ScanNet: a `.sens` file, and when at hand the label images of its folder in the 20 evaluated classes of nyu40."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from stsem.convert import nyu40, sens
from stsem.convert.depthfiles import metres
from stsem.convert.imagefiles import (
    chosen,
    files,
    image_file,
    read_bytes,
    truth_labels,
    walk,
)
from stsem.convert.recording import (
    FIRST_STAMP_NS,
    ColorEvent,
    DepthEvent,
    Event,
    Loss,
    Options,
    PoseEvent,
    Recording,
    TruthEvent,
    even_stamp_ns,
)
from stsem.convert.rigid import is_rigid
from stsem.convert.truth import Truth, stated_truth, truth_of
from stsem.errors import ConversionError
from stsem.frame import Depth
from stsem.pose import Pose, inverse

RATE_HZ = 30.0
LABELS, TABLE = "label-filt", "scannetv2-labels.combined.tsv"
_LATEST_US = (1 << 32) * 10**6
_SAME_CLOCK_US = 10**6
ToMetres = Callable[[npt.NDArray[Any]], Depth]


def detect(source: Path) -> bool:
    """Whether it is a `.sens` file, or a folder with one in it or one level below."""
    return bool(_scans(source))


def read(source: Path, options: Options) -> Recording:
    """A scan. Stamps are the file's, or even ones at `rate_hz` when it has none.

    Raises:
        ConversionError: no `.sens` file, no clear choice, or one that is broken at its beginning.
        ClassTableError: the user's class table cannot be used.
    """
    scans = _scans(source)
    if not scans:
        raise ConversionError(f"{source} holds no .sens file; give a ScanNet scan: the file, or the folder it is in.")
    path = scans[chosen(scans, options, source)]
    notes: list[str] = []
    with _opened(path, source) as stream:
        header = sens.read_header(stream, path)
        index = sens.read_index(stream, header, path)
    if not len(index):
        raise ConversionError(f"{path} holds no whole frame: it is cut off, or there is nothing in it.")
    _note_header(header, notes)
    truth, labels = _truth(path, source, options, len(index), notes)
    color_ns, depth_ns = _stamps(index, options, notes)
    to_metres = _to_metres(header, options, notes)
    poses = _poses(index, header, notes)
    scan = _Scan(path, source, header, index, color_ns, depth_ns, poses, to_metres, truth, labels)
    own_depth = to_metres is not None and not _is_registered(header)
    return Recording(
        events=_events(scan, notes),
        count=len(index) * (1 if to_metres is None else 2) + len(poses) + len(labels),
        classes=truth.classes if truth else None,
        camera=header.color,
        depth_camera=header.depth if own_depth else None,
        T_color_depth=header.T_color_depth if own_depth else None,
        notes=notes,
    )


@dataclass(frozen=True, eq=False)
class _Scan:
    """All that the events are made of.

    Args:
        path, source: the file, and the folder (or the file itself) that was given.
        color_ns, depth_ns: (n,) stamps of the frames' images.
        poses: frame -> T_WC.
        to_metres: from samples of depth; None: depth is left out.
        labels: frame -> label image, by `truth`.
    """

    path: Path
    source: Path
    header: sens.Header
    index: sens.Index
    color_ns: npt.NDArray[np.int64]
    depth_ns: npt.NDArray[np.int64]
    poses: Mapping[int, Pose]
    to_metres: ToMetres | None
    truth: Truth | None
    labels: Mapping[int, Path]


def _events(scan: _Scan, notes: list[str]) -> Iterator[Event]:
    """Colour and depth images in the order of their stamps; pose and truth go with the colour image."""
    order = np.argsort(np.concatenate([scan.color_ns, scan.depth_ns]), kind="stable")
    with _opened(scan.path, scan.source) as stream:
        for entry in order.tolist():
            is_depth, frame = divmod(entry, len(scan.index))
            yield from _depth_event(scan, frame, stream) if is_depth else _color_events(scan, frame, stream)
    if len(scan.index) < scan.header.frames:
        notes.append(f"The file declares {scan.header.frames} frames, but {len(scan.index)} whole ones are in it.")
        missing = min(scan.header.frames - len(scan.index), sens.MAX_FRAMES)
        yield Loss("frames after the place where the file is cut off or broken", count=missing)


def _color_events(scan: _Scan, frame: int, stream: IO[bytes]) -> Iterator[Event]:
    stamp_ns = int(scan.color_ns[frame])
    if frame in scan.poses:
        yield PoseEvent(stamp_ns, scan.poses[frame])
    try:
        data = scan.index.read(stream, frame, "color_bytes")
        if scan.header.color_compression == sens.RAW:
            yield ColorEvent(stamp_ns, sens.raw_color(data, scan.header))
        else:
            yield ColorEvent(stamp_ns, image_file(data))
    except ValueError:
        yield Loss("colour images that cannot be read", stamp_ns)
    if scan.truth is not None and frame in scan.labels:
        try:
            data = read_bytes(scan.labels[frame], scan.source)
            yield TruthEvent(stamp_ns, truth_labels(scan.truth, data))
        except ValueError:
            yield Loss("label images that cannot be read", stamp_ns)


def _depth_event(scan: _Scan, frame: int, stream: IO[bytes]) -> Iterator[Event]:
    if scan.to_metres is None:
        return
    stamp_ns = int(scan.depth_ns[frame])
    try:
        raw = sens.depth_samples(scan.index.read(stream, frame, "depth_bytes"), scan.header)
        yield DepthEvent(stamp_ns, scan.to_metres(raw))
    except ValueError:
        yield Loss("depth images that cannot be read", stamp_ns)


def _scans(source: Path) -> dict[str, Path]:
    """Name -> `.sens` file."""
    if source.is_file():
        return {source.stem: source} if source.suffix.lower() == ".sens" else {}
    folders = walk(source, 1) if source.is_dir() else ()
    return {path.stem: path for folder in folders for path in files(folder, (".sens",))}


def _opened(path: Path, source: Path) -> IO[bytes]:
    try:
        if not path.resolve(strict=True).is_relative_to(source.resolve(strict=True)):
            raise ConversionError(f"{path} is a link that leads out of {source}; give the file itself.")
        return path.open("rb")
    except OSError as err:
        raise ConversionError(f"{path} cannot be read: {err.strerror or err}.") from err
    except RuntimeError as err:  # what Python before 3.13 makes of a circle of links
        raise ConversionError(f"{path} is a link to itself; give the file itself.") from err


def _note_header(header: sens.Header, notes: list[str]) -> None:
    if header.color is None:
        notes.append("The colour camera has no usable intrinsics: the log has none.")
    if header.T_color_depth is None:
        notes.append("The extrinsics are no poses: depth is not registered, and poses are those of the depth camera.")


def _stamps(index: sens.Index, options: Options, notes: list[str]) -> tuple[npt.NDArray[np.int64], ...]:
    """(of colour, of depth), ns. Stamps count when they ascend, those of depth when their clock is that of colour."""
    color_us, depth_us = index.frames["color_us"], index.frames["depth_us"]
    if not _ascend(color_us):
        rate = options.rate_hz or RATE_HZ
        notes.append(f"The file has no ascending stamps: frames are {rate:g} a second.")
        even = np.array([even_stamp_ns(i, rate) for i in range(len(index))], np.int64)
        return even, even
    color = color_us.astype(np.int64)
    depth = depth_us.astype(np.int64) if _ascend(depth_us) else color
    if depth is color or abs(depth - color).max() > _SAME_CLOCK_US:
        notes.append("The depth images have no stamps of colour's clock: they have those of their colour images.")
        depth = color
    shift_ns = FIRST_STAMP_NS if min(color[0], depth[0]) == 0 else 0
    return color * 1000 + shift_ns, depth * 1000 + shift_ns


def _ascend(stamps_us: npt.NDArray[np.uint64]) -> bool:
    return bool(0 < stamps_us.max() < _LATEST_US and (stamps_us[1:] > stamps_us[:-1]).all())


def _poses(index: sens.Index, header: sens.Header, notes: list[str]) -> dict[int, Pose]:
    """Frame -> T_WC of the colour camera; the file has those of the depth camera."""
    T_depth_color = np.eye(4) if header.T_color_depth is None else inverse(header.T_color_depth)
    with np.errstate(invalid="ignore"):
        matrices = index.frames["camera_to_world"].astype(np.float64)
    poses = {frame: T_WD @ T_depth_color for frame, T_WD in enumerate(matrices) if is_rigid(T_WD)}
    if lost := len(index) - len(poses):
        notes.append(f"{lost} of {len(index)} frames have no pose: the reconstruction lost them.")
    return poses


def _to_metres(header: sens.Header, options: Options, notes: list[str]) -> ToMetres | None:
    """None when there is no depth that can be used."""
    if header.depth_compression not in (sens.RAW_USHORT, sens.ZLIB_USHORT):
        notes.append("Depth is compressed in a way that is not read (only raw and zlib are): left out.")
        return None
    if header.depth is None:
        notes.append("The depth camera has no usable intrinsics: depth is left out.")
        return None
    units = options.depth_scale or header.depth_shift
    if not (np.isfinite(units) and units > 0):
        notes.append(f"A depth shift of {units} cannot be: depth is left out; state --depth-scale, 1000 is usual.")
        return None
    return metres(units)


def _is_registered(header: sens.Header) -> bool:
    """Whether a pixel of depth is the same pixel of colour."""
    same = header.T_color_depth is not None and np.allclose(header.T_color_depth, np.eye(4), atol=1e-9)
    return bool(same) and header.depth == header.color


def _truth(
    path: Path, source: Path, options: Options, frames: int, notes: list[str]
) -> tuple[Truth | None, dict[int, Path]]:
    """(the classes, frame -> label image)."""
    if source.is_file():
        return None, {}
    found = {int(p.stem): p for p in files(path.parent / LABELS, (".png",)) if p.stem.isdecimal()}
    labels = {frame: p for frame, p in found.items() if frame < frames}
    if len(labels) < len(found):
        notes.append(f"{len(found) - len(labels)} label images belong to no frame: left out.")
    if not labels:
        return None, {}
    if options.classes_file is not None:
        return stated_truth(options.classes_file, notes), labels
    table = next((p for folder in (path.parent, source) if (p := folder / TABLE).is_file()), None)
    if table is None:
        notes.append(f"{LABELS} is left out: {TABLE}, which gives its ids their classes, is not in {source}.")
        return None, {}
    return truth_of(options, nyu40.CLASSES, nyu40.raw_ids(table, source), notes), labels
