"""From a data set to a log, event by event: memory holds one image at a time."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

from stsem.convert.recording import (
    ColorEvent,
    DepthEvent,
    Loss,
    Options,
    PoseEvent,
    Progress,
    Recording,
    Summary,
    TruthEvent,
)
from stsem.convert.rigid import is_rigid
from stsem.errors import ConversionError
from stsem.frame import Image
from stsem.log.pixels import decode, formats
from stsem.log.schemas.messages import CompressedImage
from stsem.log.writer import COLOR, LogWriter

MAX_STAMP_NS = (1 << 32) * 10**9
_Measured = ColorEvent | DepthEvent | TruthEvent | PoseEvent
_NAMES: dict[type[_Measured], str] = {
    ColorEvent: "colour images", DepthEvent: "depth images", TruthEvent: "label images", PoseEvent: "poses"
}  # fmt: skip


def dataset(read: Callable[[Path, Options], Recording]) -> Callable[[Path, Path, Options, Progress], Summary]:
    """The conversion of a data set that `read` opens."""

    def convert(source: Path, out: Path, options: Options, progress: Progress) -> Summary:
        return write_recording(read(source, options), out, progress)

    return convert


def write_recording(recording: Recording, out: Path, progress: Progress) -> Summary:
    """Write a data set as a log; log times are the stamps, as files do not say when a message arrived.

    An event that is not what it should be (see `_Check`) is left out and counted.

    Raises:
        ConversionError: there is no colour image in it; OutputError: the file cannot be written.
    """
    losses: Counter[str] = Counter()
    check = _Check()
    with LogWriter(out, recording.classes, declared=()) as log:
        for done, event in enumerate(recording.events, 1):
            if isinstance(event, Loss):
                losses[event.what] += event.count
            elif fault := check(event):
                losses[f"{_NAMES[type(event)]} {fault}"] += 1
            else:
                if not log.counts:
                    _write_cameras(log, recording, event.stamp_ns)
                _write(log, event)
            progress(min(done, recording.count), recording.count)
        if not log.counts.get(COLOR):
            lost = "; ".join(f"{count} {what}" for what, count in losses.items())
            raise ConversionError(f"No colour image could be read ({lost or 'there is none'}): no log was written.")
        counts = dict(log.counts)
    return Summary(counts, dict(losses), tuple(recording.notes))


class _Check:
    """What is wrong with an event, "" when nothing is: every one is checked before it is written.

    Colour images are decoded once, so that a log from stsem never holds an image that stsem cannot read.
    """

    def __init__(self) -> None:
        self._sizes: dict[type[_Measured], tuple[int, ...]] = {}
        self._last_ns = 0

    def __call__(self, event: _Measured) -> str:
        if not 0 <= event.stamp_ns < MAX_STAMP_NS:
            return "with a stamp before 1970 or after 2106"
        if event.stamp_ns < self._last_ns:
            return "whose stamp is behind the one before"
        if isinstance(event, PoseEvent):
            fault = "" if is_rigid(event.T_WC) else "that are none (not finite, or not a rotation)"
        else:
            fault = self._image_fault(event)
        if not fault:
            self._last_ns = event.stamp_ns
        return fault

    def _image_fault(self, event: ColorEvent | DepthEvent | TruthEvent) -> str:
        try:
            shape = _shape(event)
        except ValueError:
            return "that cannot be decoded"
        if shape != self._sizes.setdefault(type(event), shape):
            return "of another size than the first"
        return ""


def _shape(event: ColorEvent | DepthEvent | TruthEvent) -> tuple[int, ...]:
    match event:
        case ColorEvent(image=image):
            return (decode.colour(_message(image)) if isinstance(image, bytes) else image).shape
        case DepthEvent(depth=depth):
            return depth.shape
        case TruthEvent(labels=labels):
            return labels.shape


def _message(data: bytes) -> CompressedImage:
    return CompressedImage(None, "", "", memoryview(data))


def _write_cameras(log: LogWriter, recording: Recording, stamp_ns: int) -> None:
    if recording.camera is not None:
        log.calibration(stamp_ns, stamp_ns, recording.camera)
    if recording.depth_camera is not None:
        log.depth_camera(stamp_ns, stamp_ns, recording.depth_camera, recording.T_color_depth)


def _write(log: LogWriter, event: _Measured) -> None:
    stamp = event.stamp_ns
    match event:
        case ColorEvent(image=image):
            _write_color(log, stamp, image)
        case DepthEvent(depth=depth):
            log.depth_metres(stamp, stamp, depth)
        case TruthEvent(labels=labels):
            log.labels(stamp, stamp, labels)
        case PoseEvent(T_WC=T_WC):
            log.pose(stamp, stamp, T_WC)


def _write_color(log: LogWriter, stamp_ns: int, image: bytes | Image) -> None:
    if isinstance(image, bytes):
        log.color_file(stamp_ns, stamp_ns, image, formats.file_format(_message(image)))
    else:
        log.color_pixels(stamp_ns, stamp_ns, image)
