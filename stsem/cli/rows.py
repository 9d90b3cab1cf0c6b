"""The rows of a run's frames: each is made when it is looked at, from columns of a few bytes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from operator import attrgetter
from typing import overload

from stsem.packed import IntByIndex
from stsem.replay.engine import Replayed
from stsem.replay.lanes import ModeRun
from stsem.replay.record import Record
from stsem.report.inputs import FrameRow
from stsem.result import FrameResult, Span, Spans

_FRAME = attrgetter("frame")


class RunRows(Sequence[FrameRow]):
    """One row per frame of a run, by log index.

    Args:
        run: finished.
        replayed: what it is of.
    """

    def __init__(self, run: ModeRun, replayed: Replayed) -> None:
        self._mode, self._results = run.mode.name, run.record.results
        self._slots, self._jobs = replayed.slots, _Jobs(run.spans)
        self._first = replayed.slots[0].index if len(replayed.slots) else 0
        self._sources = _sources(run.offline)
        self._offline, self._delivered = _accuracies(run.offline), _accuracies(run.real_time)
        card = None if run.real_time is None else run.real_time.scorecard
        self._streaming: Mapping[int, float] = {} if card is None else card.streaming_pixel_accuracy()

    def __len__(self) -> int:
        return len(self._results)

    @overload
    def __getitem__(self, place: int) -> FrameRow: ...
    @overload
    def __getitem__(self, place: slice) -> list[FrameRow]: ...
    def __getitem__(self, place: int | slice) -> FrameRow | list[FrameRow]:
        if isinstance(place, slice):
            return [self._row(result) for result in self._results[place]]
        return self._row(self._results[place])

    def _row(self, result: FrameResult) -> FrameRow:
        index = result.index
        return FrameRow(
            mode=self._mode,
            result=replace(result, spans=self._jobs.of(index)),
            log_stamp_ns=self._slots[index - self._first].log_stamp_ns,
            offline_keyframe=self._sources.get(index),
            offline=self._offline.get(index),
            delivered=self._delivered.get(index),
            streaming=self._streaming.get(index),
        )


class _Jobs:
    """The jobs of each frame, in order of start."""

    def __init__(self, spans: Iterable[Span]) -> None:
        self._spans, self._first = Spans(spans), IntByIndex()
        self._spans.sort(key=_FRAME)
        for place in range(len(self._spans) - 1, -1, -1):
            self._first[self._spans[place].frame] = place

    def of(self, frame: int) -> tuple[Span, ...]:
        """Those for `frame`."""
        first = self._first.get(frame)
        if first is None:
            return ()
        later = (self._spans[place] for place in range(first, len(self._spans)))
        return tuple(takewhile(lambda span: span.frame == frame, later))


def _sources(offline: Record | None) -> IntByIndex:
    """Log index -> that of the keyframe that the offline answer comes from."""
    sources = IntByIndex()
    for result in () if offline is None else offline.results:
        if result.keyframe is not None:
            sources[result.index] = result.keyframe
    return sources


def _accuracies(record: Record | None) -> Mapping[int, float]:
    return {} if record is None or record.scorecard is None else record.scorecard.pixel_accuracy()
