"""What a report is made from: the document, and what is too large for it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from stsem.classes import ClassSet, Labels
from stsem.document.schema import Document
from stsem.frame import Image
from stsem.pose import Trajectory
from stsem.result import FrameResult
from stsem.uncertainty import Confidence, Uncertainty


@dataclass(frozen=True, slots=True)
class FrameRow:
    """One frame of one run.

    Args:
        mode: the run.
        result: what became of the frame; its `labels` are not needed and best left out.
        log_stamp_ns: capture stamp as in the log.
        offline_keyframe: log index of the keyframe that the offline answer comes from; None without.
        offline, delivered, streaming: pixel accuracy of this frame in each pass, 0..1; None where not scored.
    """

    mode: str
    result: FrameResult
    log_stamp_ns: int
    offline_keyframe: int | None = None
    offline: float | None = None
    delivered: float | None = None
    streaming: float | None = None

    @property
    def latency_ns(self) -> int | None:
        """Answered minus arrived; None without an answer or a clock."""
        answered, arrived = self.result.answered_ns, self.result.arrival_ns
        return None if answered is None or arrived is None else answered - arrived

    def service_ns(self, stage: str) -> int | None:
        """Time that `stage` spent on the cores for this frame; None if it did not work for it."""
        times = [span.end_ns - span.start_ns for span in self.result.spans if span.stage == stage]
        return sum(times) if times else None

    def waiting_ns(self, stage: str) -> int | None:
        """Time that `stage` waited for cores for this frame; None if it did not work for it."""
        times = [span.start_ns - span.ready_ns for span in self.result.spans if span.stage == stage]
        return sum(times) if times else None


@dataclass(frozen=True, eq=False)
class StripFrame:
    """One frame of the picture strip: image, truth, and the answer of each mode.

    Args:
        index: log index.
        image: (H, W, 3) uint8 RGB.
        truth: (h, w) uint8 in the log's classes, 255 ignored; None without truth.
        answers: mode -> (H, W) or (h, w) uint8 labels; a mode without an answer is absent.
        distance: mode -> distance to the keyframe in frames, for the caption.
    """

    index: int
    image: Image
    truth: Labels | None
    answers: Mapping[str, Labels]
    distance: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class UnsureFrame:
    """The frame that the network is least sure of.

    Args:
        mode: whose answer it is.
        index: log index.
        image: (H, W, 3) uint8 RGB.
        truth: (h, w) uint8 in the log's classes, 255 ignored; None without truth.
        labels: (H, W) uint8, from the network.
        confidence: (H, W) float32; None where none is stated.
        uncertainty: maps (H, W).
    """

    mode: str
    index: int
    image: Image
    truth: Labels | None
    labels: Labels
    confidence: Confidence | None
    uncertainty: Uncertainty


@dataclass(frozen=True, eq=False)
class ReportInputs:
    """Everything that a report folder is made from.

    Args:
        document: the sealed document.
        frames: mode -> the rows of its run, by log index; they may be made when they are looked at.
        strip: up to about five frames worth looking at.
        strip_pass: which pass the strip's answers come from: `offline`, `delivered` or `streaming`.
        unsure: the frame that the network is least sure of; None where it gives no maps of uncertainty.
        trace: writes trace.json to a path; None without a clock.
        answer_classes: classes of the answers where the log has no class table; None where it has.
        trajectory: pieces of trajectory.txt; None without poses.
        paths: source of poses (`log`, `slam`) -> its trajectory, all in one world; empty where there is only the log's.
        point_cloud: the finished map.ply, copied into the folder; None without a map.
        annotated: the finished annotated.mcap, copied into the folder; None without `--annotate`.
        plots: whether pictures are drawn (`--no-plots`).
    """

    document: Document
    frames: Mapping[str, Sequence[FrameRow]] = field(default_factory=dict)
    strip: tuple[StripFrame, ...] = ()
    strip_pass: str = "offline"
    unsure: UnsureFrame | None = None
    trace: Callable[[Path], None] | None = None
    trajectory: Iterable[bytes] | None = None
    paths: Mapping[str, Trajectory] = field(default_factory=dict)
    answer_classes: ClassSet | None = None
    point_cloud: Path | None = None
    annotated: Path | None = None
    plots: bool = True

    def rows(self, mode: str) -> Sequence[FrameRow]:
        """The rows of one run."""
        return self.frames.get(mode, ())

    @property
    def class_set(self) -> ClassSet | None:
        """The log's classes, else those of the answers; None without either."""
        names, colours = self.document.input.classes, self.document.input.colours
        return ClassSet(names, colours) if names else self.answer_classes
