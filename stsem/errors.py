"""Everything that can go wrong in a way a user can mend.

    StsemError                 exit code 1
    |-- UsageError             2   a flag, a config key or a value that cannot be
    |-- LogError               1   the log as a whole cannot be read
    |   |-- ChannelError       1   a channel is missing, ambiguous or of the wrong kind
    |   |   `-- UndecodableError 5   none of a channel's images can be decoded: nothing can be measured
    |   `-- DecodeError        1   one message cannot be decoded (survivable: the frame is `undecodable`)
    |-- ClassTableError        1   the class names of a log, a file or a network
    |-- NetworkError           1   an ONNX file, its sidecar, or what it returns
    |-- TrainingError          1   training pairs or a checkpoint
    |   `-- TrainingStoppedError 130 a training was stopped in order, and can go on
    |-- ConversionError        1   a data set that cannot become a log
    |-- CostError              1   a cost profile
    |-- OutputError            1   a folder or file that cannot be written
    |-- MissingExtraError      1   an optional dependency that is not installed
    |-- NotRepeatableError     1   two replays of one log differ
    `-- NothingMeasuredError   5   nothing measured, no baseline, or not comparable

Every message is one sentence that says what came, what was expected and what to do.
"""

from typing import ClassVar

EXIT_FINE = 0
EXIT_ERROR = 1
EXIT_USAGE = 2
EXIT_LOSSY = 3
EXIT_GATE_FAILED = 4
EXIT_NOTHING_MEASURED = 5
EXIT_STOPPED = 130


class StsemError(Exception):
    """Root of the tree; `exit_code` is what the command line returns for it."""

    exit_code: ClassVar[int] = EXIT_ERROR


class UsageError(StsemError):
    """A flag, a configuration key or a value that cannot be."""

    exit_code = EXIT_USAGE


class LogError(StsemError):
    """The log as a whole cannot be read."""


class ChannelError(LogError):
    """A channel is missing, ambiguous or of the wrong kind.

    Args:
        message: the sentence.
        role: what it was wanted for: color, depth, pose or labels; "" for none of them.
        rivals: topics with an equal claim to the role; empty when the trouble is another.
    """

    def __init__(self, message: str, role: str = "", rivals: tuple[str, ...] = ()) -> None:
        self.role, self.rivals = role, rivals
        super().__init__(message)


class UndecodableError(ChannelError):
    """None of the colour images can be decoded, so nothing can be measured."""

    exit_code = EXIT_NOTHING_MEASURED


class DecodeError(LogError):
    """One message cannot be decoded.

    Args:
        topic: where it was published.
        stamp_ns: capture stamp if known, else the log time; None when neither is known.
        reason: what came and what was expected, without a full stop.
    """

    def __init__(self, topic: str, stamp_ns: int | None, reason: str) -> None:
        self.topic, self.stamp_ns, self.reason = topic, stamp_ns, reason
        at = "" if stamp_ns is None else f" at {stamp_ns} ns"
        super().__init__(f"{topic}{at}: {reason}.")


class ClassTableError(StsemError):
    """The class names of a log, a file or a network cannot be used."""


class NetworkError(StsemError):
    """An ONNX file, its sidecar, or what it returns, is not what DESIGN 11 accepts."""


class TrainingError(StsemError):
    """Training pairs or a checkpoint that cannot be used."""


class TrainingStoppedError(TrainingError):
    """A training was stopped in order; the same command goes on."""

    exit_code = EXIT_STOPPED


class ConversionError(StsemError):
    """A data set or a foreign recording that cannot become a log."""


class CostError(StsemError):
    """A cost profile is unreadable or lacks a stage."""


class OutputError(StsemError):
    """A folder or file cannot be written."""


class MissingExtraError(StsemError):
    """An optional dependency is not installed.

    Args:
        extra: name of the extra, as in `pip install 'stsem[extra]'`.
        purpose: what it is needed for, e.g. "rendering logs".
    """

    def __init__(self, extra: str, purpose: str) -> None:
        super().__init__(f"{purpose} needs the extra '{extra}': pip install 'stsem[{extra}]'.")


class NotRepeatableError(StsemError):
    """Two replays of the same log with the same configuration differ."""


class NothingMeasuredError(StsemError):
    """Nothing was measured, there is no baseline, or two reports are not comparable."""

    exit_code = EXIT_NOTHING_MEASURED
