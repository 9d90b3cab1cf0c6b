"""A recorded log, opened: what it is, how its frames are made, and random access to frames and truth."""

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from stsem.camera import Camera
from stsem.classes import ClassSet, Labels
from stsem.errors import ChannelError, DecodeError
from stsem.frame import Depth, Frame, Image
from stsem.log.assemble import Assembly, assemble
from stsem.log.classtable import ClassTable, Translator
from stsem.log.container.damage import Damage
from stsem.log.container.files import Given, find_files, left_out, missing_files
from stsem.log.container.store import Store
from stsem.log.describe import channel_infos, describe
from stsem.log.info import ChannelInfo, LogInfo
from stsem.log.pairing import pair_all, plan_all
from stsem.log.pixels import decode
from stsem.log.pixels.look import ImageMessage
from stsem.log.plan import UNKNOWN_PERIOD_NS, FramePlan, median_period_ns, window
from stsem.log.prefetch import AHEAD, Recent, prefetched
from stsem.log.remark import Remark
from stsem.log.scan import Scan, scan
from stsem.pose import Trajectory

IMAGES_KEPT = AHEAD + 4


@dataclass(frozen=True, eq=False)
class Loaded:
    """A frame as `Log.frames` gives it.

    Args:
        index: position among the colour frames of the window.
        frame: None when its colour image cannot be decoded.
        error: why it cannot.
        truth: (H, W) uint8 labels in the ids of `Log.classes`; None when not asked for or not there.
    """

    index: int
    frame: Frame | None
    error: DecodeError | None
    truth: Labels | None


def open_log(
    paths: Sequence[Given],
    *,
    topics: Mapping[str, str] | None = None,
    classes_file: Path | None = None,
    depth_registered: str = "auto",
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> "Log":
    """Scan a log once and say how its frames are made.

    Args:
        paths: files, folders of files, or (as strings) addresses, of one recording.
        topics: role (color, depth, pose, labels) -> topic, where the choice by schema and name is not wanted.
        classes_file: class table (JSON or TOML) instead of the log's own.
        depth_registered: whether depth pixels are colour pixels: yes, no (then only the log's extrinsic brings them
            there), or auto (see `registration.depth_reader`).
        start_s, end_s: window in seconds from the first colour stamp, half-open.
        progress: called with (bytes done, bytes in all) during the scan.

    Raises:
        LogError: nothing can be read; ChannelError: no or no clear choice of channels; ClassTableError: a class table
        that cannot be used; UsageError: a role, a window or a value that cannot be.
    """
    return scan_log(paths, progress).open(
        topics=topics, classes_file=classes_file, depth_registered=depth_registered, start_s=start_s, end_s=end_s
    )


def scan_log(paths: Sequence[Given], progress: Callable[[int, int], None] | None = None) -> "ScannedLog":
    """The first pass of `open_log`: what is in a log, before anything is chosen.

    Raises:
        LogError: nothing can be read.
    """
    scanned = scan(find_files(paths), progress)
    for name in missing_files(paths):
        scanned.damage.count("missing_file", name)
    return ScannedLog(paths, scanned)


class ScannedLog:
    """A log whose messages are known, and nothing of its images; made by `scan_log`.

    Args:
        paths: as they were given.
        scanned: what the first pass left.
    """

    def __init__(self, paths: Sequence[Given], scanned: Scan) -> None:
        self._paths, self._scan = paths, scanned

    @property
    def channels(self) -> tuple[ChannelInfo, ...]:
        """In order of topic, none of them used."""
        return channel_infos(self._scan)

    @property
    def damage(self) -> Damage:
        """What was found so far."""
        return self._scan.damage

    def open(
        self, *, topics: Mapping[str, str] | None = None, classes_file: Path | None = None,
        depth_registered: str = "auto", start_s: float | None = None, end_s: float | None = None,
    ) -> "Log":  # fmt: skip
        """Choose what is used; arguments and errors are those of `open_log`."""
        scanned, paths = self._scan, self._paths
        store = Store(scanned.files, scanned.chunks, scanned.opened)
        try:
            assembly = assemble(scanned, store, topics or {}, classes_file, depth_registered)
            rows = window(assembly.color.rows.stamp_ns, start_s, end_s)
            assembly.warnings += left_out(paths)
            info = describe(paths, scanned, assembly)
            assembly.images = ()  # lets go of the index of channels that are not used
            return Log(assembly, info, store, rows)
        except BaseException as err:
            store.close()
            if isinstance(err, ChannelError) and scanned.damage.lossy:
                sentence = f"{str(err).rstrip('.')}; the log is damaged: {scanned.damage}."
                raise type(err)(sentence, err.role, err.rivals) from err
            raise


class Log:
    """An opened log; made by `open_log`. Context manager; safe to be asked from several threads.

    Attributes:
        classes: of the truth; None without labels or without a class table.
        class_table: where they come from, with the ids of the label images; None likewise.
        camera: pinhole camera of the frames' images; None when the log has none, or one whose lens is not understood.
        plans: one per colour frame in the window, in order of index.
        period_ns: median distance of colour stamps.
    """

    def __init__(self, assembly: Assembly, info: LogInfo, store: Store, rows: slice) -> None:
        self._assembly, self._info, self._store, self._first = assembly, info, store, rows.start
        self._color, self._depth, self._poses = assembly.color, assembly.depth, assembly.poses
        self._rectifier = assembly.optics.rectifier
        self._labels = assembly.labels if assembly.table else None
        self._translate = Translator(assembly.table) if assembly.table else None
        self._colour_of = assembly.table.colour_of if assembly.table else {}
        self._unknown_pixels = np.zeros(len(assembly.labels) if assembly.labels else 0, np.int32)
        self._images: Recent[int, Image] = Recent(self._decode_image, IMAGES_KEPT)
        self._truths: Recent[int, Labels | None] = Recent(self._decode_truth, IMAGES_KEPT)
        self._partners, inexact = pair_all(assembly)
        self.camera: Camera | None = assembly.optics.camera
        self.class_table: ClassTable | None = assembly.table
        self.classes: ClassSet | None = assembly.table.classes if assembly.table else None
        self.period_ns: int = median_period_ns(self._color.rows) or UNKNOWN_PERIOD_NS
        self.plans: Sequence[FramePlan] = plan_all(assembly, self._partners, rows)
        if inexact:
            sentence = (
                f"{inexact} label images have no colour image of exactly their stamp and went to the nearest one."
            )
            self._info = replace(info, warnings=(*info.warnings, Remark("truth-inexact", sentence)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the files."""
        self._store.close()

    @cached_property
    def trajectory(self) -> Trajectory | None:
        """T_WC at the samples of the pose channel; of a chain of transforms: at the union of their stamps."""
        return self._poses.trajectory() if self._poses else None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the colour images."""
        return self._assembly.size

    @property
    def info(self) -> LogInfo:
        """What the log is; damage and warnings include what was met while frames and truth were read."""
        frames, total = int(np.count_nonzero(self._unknown_pixels)), int(self._unknown_pixels.sum())
        if not frames:
            return self._info
        sentence = f"{total} pixels in {frames} label images have an id or colour outside the class table: ignored."
        return replace(self._info, warnings=(*self._info.warnings, Remark("truth-unknown-ids", sentence)))

    def frame(self, index: int, *, depth: bool, previous: bool) -> Frame:
        """The frame at `index`; depth and the previous image are left out (None) where not asked for.

        Depth that cannot be decoded is None and counted as damage.

        Raises:
            DecodeError: the colour image cannot be decoded.
            LogError: the file changed or was closed.
        """
        plan, row = self.plans[index], self._first + index
        image = self._images.get(row)
        pose = self._poses.at(plan.stamp_ns) if self._poses else None
        return Frame(
            index=index,
            stamp_ns=plan.stamp_ns,
            image=image,
            previous=self._previous(row) if previous else None,
            depth=self._decode_depth(row) if depth else None,
            T_WC=pose.T_WC if pose else None,
            camera=self.camera,
        )

    def truth(self, index: int) -> Labels | None:
        """(H, W) uint8 labels in the ids of `classes`, 255 ignore, at their own size; None without truth.

        A label image that cannot be decoded is None and counted as damage.
        """
        row = int(self._partners.truth[self._first + index])
        return None if row < 0 else self._truths.get(row)

    def frames(
        self, indices: Iterable[int], *, depth: bool, previous: bool, truth: bool
    ) -> Generator[Loaded, None, None]:
        """The frames at `indices`, in that order, decoded ahead; nothing is left running however the loop ends."""

        def load(index: int) -> Loaded:
            labels = self.truth(index) if truth else None
            try:
                return Loaded(index, self.frame(index, depth=depth, previous=previous), None, labels)
            except DecodeError as err:
                return Loaded(index, None, err, labels)

        return prefetched(load, indices)

    def _decode_image(self, row: int) -> Image:
        def convert(message: ImageMessage) -> Image:
            return self._rectifier.image(decode.colour(message, self._assembly.size))

        return self._color.read(row, convert)

    def _decode_truth(self, row: int) -> Labels | None:
        if self._labels is None or self._translate is None:
            return None
        translate, colours = self._translate, self._colour_of

        def convert(message: ImageMessage) -> tuple[Labels, int]:
            labels, unknown = translate(decode.labels(message, colours))
            return self._rectifier.labels(labels), unknown

        try:
            labels, unknown = self._labels.read(row, convert)
        except DecodeError:
            return None
        self._unknown_pixels[row] = unknown
        return labels

    def _previous(self, row: int) -> Image | None:
        """The image of the last row before `row` that can be decoded."""
        for earlier in range(row - 1, -1, -1):
            try:
                return self._images.get(earlier)
            except DecodeError:
                continue
        return None

    def _decode_depth(self, row: int) -> Depth | None:
        partner = int(self._partners.depth[row])
        if partner < 0 or self._depth is None or self._assembly.depth_reader is None:
            return None
        try:
            return self._depth.read(partner, self._assembly.depth_reader)
        except DecodeError:
            return None
