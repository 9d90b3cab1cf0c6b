"""The words of the doctor: what was examined, a check, a finding."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from stsem.log.doctor.summaries import CameraSummary, DepthSummary, FramesSummary, PoseSummary, TruthSummary
from stsem.log.info import LogInfo
from stsem.log.remark import Remark
from stsem.log.tracks import Int64
from stsem.pose import Trajectory


@dataclass(frozen=True)
class Finding:
    """One thing that looks wrong.

    Args:
        name: stable words in kebab-case, for programs.
        what: was seen, with its numbers; one sentence.
        do: what to do about it; one sentence.
    """

    name: str
    what: str
    do: str


@dataclass(frozen=True, eq=False)
class Examined:
    """All that checks look at.

    Args:
        info: with everything that was said while the log was opened and its frames were looked at.
        stamps_ns: (n,) of the colour frames, ascending.
        path: the camera's; None without poses.
        frames, camera, depth, truth, pose: the summaries; None where the log has no such thing.
    """

    info: LogInfo
    stamps_ns: Int64
    path: Trajectory | None
    frames: FramesSummary
    camera: CameraSummary | None
    depth: DepthSummary | None
    truth: TruthSummary | None
    pose: PoseSummary | None

    @property
    def calibration_topics(self) -> frozenset[str]:
        """Topics whose messages are calibrations."""
        words = ("CameraInfo", "CameraCalibration")
        return frozenset(channel.topic for channel in self.info.channels if channel.schema.endswith(words))

    def said(self, *names: str) -> tuple[str, ...]:
        """The sentences of these names that were said while the log was opened."""
        return tuple(str(text) for text in self.info.warnings if isinstance(text, Remark) and text.name in names)


See = Callable[[Examined], Iterable[str]]


@dataclass(frozen=True)
class Check:
    """A row of the table of checks.

    Args:
        name: of its findings.
        when: there is a finding, for people.
        do: what to do about it; "" when nothing needs to be done, and it is a note.
        see: gives a sentence for each finding; None when it is only said while the log is opened.
    """

    name: str
    when: str
    do: str
    see: See | None = None

    def findings(self, examined: Examined) -> tuple[Finding, ...]:
        """What was said under its name, and what it sees."""
        seen = self.see(examined) if self.see else ()
        return tuple(Finding(self.name, what, self.do) for what in (*examined.said(self.name), *seen))
