"""Where accuracy is lost on the way from a perfect network to what a robot has at hand (DESIGN 4)."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from stsem.metrics.accumulate import Judged

Metric = Literal["miou", "pixel_accuracy"]


@dataclass(frozen=True)
class Part:
    """One part of the loss: a fraction (negative: a gain); `n` frames are behind the scarcer of its two scores."""

    value: float
    n: int


@dataclass(frozen=True)
class Loss:
    """The split of 1 - streaming; the parts add up exactly where all of them were measured. None: not measured.

    Args:
        network: 1 - offline(per-frame): what the network gets wrong.
        prediction: offline(per-frame) - offline(mode): what predicting instead of segmenting costs.
        scheduling: offline(mode) - delivered: what other keyframes, and longer distances to them, cost.
        staleness: delivered - streaming: what the world's moving on costs until an answer is there, the wait for the
            first one included.
    """

    network: Part | None
    prediction: Part | None
    scheduling: Part | None
    staleness: Part | None


class LossSplit:
    """Accumulates the four scores of a mode as their passes finish.

    Args:
        metric: which score is split.
    """

    unit: ClassVar[str] = "fraction"
    higher_is_better: ClassVar[bool] = False
    passes: ClassVar[tuple[str, ...]] = ("per_frame", "offline", "delivered", "streaming")

    def __init__(self, metric: Metric = "miou") -> None:
        self._metric: Metric = metric
        self._judged: dict[str, Judged | None] = dict.fromkeys(self.passes)

    def update(self, name: str, judged: Judged | None) -> None:
        """Add the score of a pass; `name` is one of `passes`.

        Raises:
            ValueError: there is no such pass.
        """
        if name not in self._judged:
            raise ValueError(f"no pass is called {name!r}; there are {', '.join(self.passes)}")
        self._judged[name] = judged

    def compute(self) -> Loss:
        """The split so far."""
        return split(**self._judged, metric=self._metric)


def split(
    per_frame: Judged | None,
    offline: Judged | None,
    delivered: Judged | None,
    streaming: Judged | None,
    metric: Metric = "miou",
) -> Loss:
    """Split the loss of one mode.

    Args:
        per_frame: offline score of the mode `per-frame`.
        offline: offline score of this mode (for `per-frame`: the same once more).
        delivered, streaming: scores of this mode's real-time run.
        metric: which score.
    """
    return Loss(
        network=_network(per_frame, metric),
        prediction=_difference(per_frame, offline, metric),
        scheduling=_difference(offline, delivered, metric),
        staleness=_difference(delivered, streaming, metric),
    )


def _value(judged: Judged | None, metric: Metric) -> float | None:
    if judged is None or not judged.scores.pixels:
        return None
    return judged.scores.miou if metric == "miou" else judged.scores.pixel_accuracy


def _network(judged: Judged | None, metric: Metric) -> Part | None:
    value = _value(judged, metric)
    return None if judged is None or value is None else Part(1 - value, judged.frames)


def _difference(before: Judged | None, after: Judged | None, metric: Metric) -> Part | None:
    upper, lower = _value(before, metric), _value(after, metric)
    if before is None or after is None or upper is None or lower is None:
        return None
    return Part(upper - lower, min(before.frames, after.frames))
