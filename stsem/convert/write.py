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
from stsem.errors import ConversionError
from stsem.frame import Image
from stsem.log.pixels import formats
from stsem.log.schemas.messages import CompressedImage
from stsem.log.writer import COLOR, LogWriter

MAX_STAMP_NS = (1 << 32) * 10**9
_Measured = ColorEvent | DepthEvent | TruthEvent | PoseEvent


def dataset(read: Callable[[Path, Options], Recording]) -> Callable[[Path, Path, Options, Progress], Summary]:
    """The conversion of a data set that `read` opens."""

    def convert(source: Path, out: Path, options: Options, progress: Progress) -> Summary:
        return write_recording(read(source, options), out, progress)

    return convert


def write_recording(recording: Recording, out: Path, progress: Progress) -> Summary:
    """Write a data set as a log; log times are the stamps, as files do not say when a message arrived.

    An event whose stamp is behind that of the one before, or cannot be written, is left out and counted.

    Raises:
        ConversionError: there is no colour image in it; OutputError: the file cannot be written.
    """
    losses: Counter[str] = Counter()
    last_ns: int | None = None
    with LogWriter(out, recording.classes, declared=()) as log:
        for done, event in enumerate(recording.events, 1):
            if isinstance(event, Loss):
                losses[event.what] += event.count
            elif not 0 <= event.stamp_ns < MAX_STAMP_NS:
                losses["messages with stamps before 1970 or after 2106"] += 1
            elif last_ns is not None and event.stamp_ns < last_ns:
                losses["messages whose stamp is behind the one before"] += 1
            else:
                if last_ns is None:
                    _write_cameras(log, recording, event.stamp_ns)
                _write(log, event)
                last_ns = event.stamp_ns
            progress(min(done, recording.count), recording.count)
        if not log.counts.get(COLOR):
            lost = "; ".join(f"{count} {what}" for what, count in losses.items())
            raise ConversionError(f"No colour image could be read ({lost or 'there is none'}): no log was written.")
        counts = dict(log.counts)
    return Summary(counts, dict(losses), tuple(recording.notes))


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
        form = formats.file_format(CompressedImage(None, "", "", memoryview(image)))
        log.color_file(stamp_ns, stamp_ns, image, form)
    else:
        log.color_pixels(stamp_ns, stamp_ns, image)
