"""How late and how fast, on the simulated clock."""

from pydantic import Field

from stsem.document.part import Count, Number, Part, Share

PERCENTILES: dict[str, tuple[float, int]] = {
    "p50": (0.50, 11), "p90": (0.90, 64), "p95": (0.95, 130), "p99": (0.99, 662), "p999": (0.999, 6636),
}  # fmt: skip
"""Name -> (rank, samples it needs): below that many a percentile is null, "n too small" (DESIGN 5)."""


class Distribution(Part):
    """Latencies of one kind in milliseconds. Percentile p = sorted[ceil(p n) - 1], without interpolation."""

    p50: Number = None
    """Half of the samples are at or below this many ms; null below 11 samples."""
    p90: Number = None
    """90 % of the samples are at or below this many ms; null below 64 samples."""
    p95: Number = None
    """95 % of the samples are at or below this many ms; null below 130 samples."""
    p99: Number = None
    """99 % of the samples are at or below this many ms; null below 662 samples."""
    p999: Number = None
    """99.9 % of the samples are at or below this many ms; null below 6636 samples."""
    max: Number = None
    """Largest sample in ms; given for any n above 0."""
    mean: Number = None
    """Arithmetic mean in ms."""
    n: Count = 0
    """Number of samples, one per frame."""
    n_distinct: Count | None = None
    """Distinct samples in the cost profile of the slowest stage; null when no profile bounds the percentiles."""

    @property
    def n_effective(self) -> int:
        """What decides which percentiles are given: the smaller of `n` and `n_distinct`."""
        return self.n if self.n_distinct is None else min(self.n, self.n_distinct)


class StageLatency(Part):
    """One stage's share of the latency, over the frames it worked for."""

    waiting: Distribution = Field(default_factory=Distribution)
    """From ready to start: time spent waiting for cores, ms."""
    service: Distribution = Field(default_factory=Distribution)
    """From start to end: time spent on the cores, ms."""


class Latency(Part):
    """Latencies of the answered frames, in simulated milliseconds."""

    from_arrival: Distribution = Field(default_factory=Distribution)
    """Answered minus arrived: the pipeline's own share; deadlines use it. ms."""
    from_stamp: Distribution = Field(default_factory=Distribution)
    """Answered minus captured: from sensor to result. ms."""
    waiting: Distribution = Field(default_factory=Distribution)
    """The part of the latency from arrival during which no job of the frame's answer held a core. ms."""
    stages: dict[str, StageLatency] = Field(default_factory=dict)
    """Waiting and service of each stage, on and beside the answer path."""


class Throughput(Part):
    """How much came out, on the simulated clock."""

    output_hz: Number = None
    """Answers per second: (N - 1) / (time of last answer - time of first answer)."""
    offered_hz: Number = None
    """Arrivals per second: (N - 1) / (last arrival - first arrival)."""
    outputs: Count = 0
    """Number of answers: N in `output_hz`."""
    processed_share: Share = None
    """Answered frames over all frames of the log or window. Fraction."""
    utilisation: tuple[Share, ...] = ()
    """Busy share of each core, core 0 first, from the first arrival to the last event. Fraction."""
    deadline_ms: Number = None
    """The deadline for an answer, from arrival, in ms (default: capture period / rate)."""
    deadline_misses: Count | None = None
    """Frames answered after the deadline or not at all; null without a clock."""
    jitter_ms: Number = None
    """Standard deviation (of the population) of the intervals between consecutive answers, ms."""
    real_time_factor: Number = None
    """Seconds of log between the first and last answered frame's stamps per simulated second between their answers."""
    sustainable_hz: Number = None
    """Highest offered rate with at most 1 % dropped and p95 under the fixed deadline; null unless searched for."""


class Outcomes(Part):
    """Exactly one per frame, named by how the answer was made (DESIGN 5)."""

    segmented: Count = 0
    """Answered by the network."""
    propagated: Count = 0
    """Answered by prediction from a keyframe."""
    no_source: Count = 0
    """Arrived in time, but nothing was finished yet to predict from; scored as all "no label"."""
    dropped_busy: Count = 0
    """Replaced in the mailbox, or refused by a full queue, while the pipeline was busy."""
    undecodable: Count = 0
    """The message could not be decoded."""
    incomplete: Count = 0
    """A needed channel has no partner for it."""
    pending: Count = 0
    """Unfinished one median period after the last arrival."""

    @property
    def total(self) -> int:
        """Their sum: the frames of the log or window."""
        return sum(getattr(self, name) for name in type(self).model_fields)
