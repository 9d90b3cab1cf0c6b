"""report.json: the one truth that every view and every gate reads.

Scores are fractions 0..1; times are in the unit of the key's name; what was not measured is null.
"""

from typing import Literal, Self

from pydantic import Field, JsonValue, model_validator

from stsem.document.accuracy import Consistency, Coverage, DistanceRow, DistanceSummary, Loss, Score
from stsem.document.background import Background
from stsem.document.calibration import Calibration, ErrorDetection
from stsem.document.origin import Host, Identity, Input
from stsem.document.part import Count, Number, Part, Share
from stsem.document.timing import Latency, Outcomes, Throughput
from stsem.document.trajectory import TrajectoryScore

SCHEMA_VERSION: Literal[1] = 1

State = Literal["valid", "lossy", "invalid"]
AccuracyState = Literal["measured", "not measured"]


class MapScore(Part):
    """What is in the map, and how good it is."""

    points: Count = 0
    """Labelled points written."""
    points_left_out: Count = 0
    """Points that fell into new cells when the map was full, or too far away for its grid, and were forgotten."""
    voxels: Count = 0
    """Occupied voxels."""
    miou_3d: Share = None
    """mIoU over the surface of the truth; an unobserved piece counts as wrong. Fraction."""
    miou_3d_observed: Share = None
    """mIoU over the observed surface only. Fraction."""
    observed_share: Share = None
    """Observed share of the truth's surface. Fraction."""
    accuracy_3d: Share = None
    """Share of the truth's surface with the right label. Fraction."""
    f_score: Share = None
    """Harmonic mean of geometric precision and recall. Fraction."""
    outlier_share: Share = None
    """Share of map points far from any surface. Fraction."""


class Run(Part):
    """One mode over one log."""

    mode: str
    """`per-frame`, `keyframe` or `keyframe-async`."""
    clock: Literal["real-time", "offline"]
    """Whether frames arrived on the simulated clock."""
    frames: Count
    """Frames of the log or window; the outcomes sum to it."""
    outcomes: Outcomes
    """How many frames ended how."""
    keyframes: tuple[Count, ...] = ()
    """Log indices of the frames that went through the network."""
    keyframe_reasons: dict[str, Count] = Field(default_factory=dict)
    """Why frames became keyframes -> how many."""
    background: Background | None = None
    """What became of the frames that the network was to label beside the answers, and how old the answers were; null in
    modes whose answers wait for the network, and without a clock."""
    covered: Share = None
    """Mean over the predicted answers of the share of pixels that rest on evidence: a keyframe saw the point, so far as
    the method can tell. Of the real-time run; offline where that is the only pass. null where the method does not
    say. Fraction."""
    remarks: dict[str, Count] = Field(default_factory=dict)
    """What the prediction had to do without, for how many frames; of the same pass as `covered`."""
    keyframes_moved: Count = 0
    """Oracle only: choices moved to the next frame that has truth."""
    stages_inside: tuple[str, ...] = ()
    """Stages between taken and answered: what the latency contains."""
    stages_disabled: dict[str, Count] = Field(default_factory=dict)
    """Stage -> frames for which it was disabled because an optional channel is missing."""
    coverage: Coverage
    """How much of the log the accuracy speaks for."""
    offline: Score | None = None
    """Every frame answered by the mode's rule, no clock."""
    delivered: Score | None = None
    """The answers of the real-time run, however late, against their own frames; dropped frames are not in it."""
    streaming: Score | None = None
    """At every arrival, the finished answer with the newest stamp, against the truth of the frame that just arrived."""
    loss: Loss | None = None
    """Where mIoU is lost on the way from 1 to the streaming score."""
    strata: dict[str, Score] = Field(default_factory=dict)
    """Offline scores of parts of the frames: `segmented`, `propagated`; `covered`: the pixels of the latter that rest
    on evidence."""
    by_distance: tuple[DistanceRow, ...] = ()
    """Offline accuracy by distance to the keyframe, ascending."""
    by_distance_summary: DistanceSummary | None = None
    """Mean and minimum over the distances that have enough frames."""
    consistency: Consistency | None = None
    """Temporal consistency of the answers."""
    calibration: dict[str, Calibration] = Field(default_factory=dict)
    """Whether confidence is true: `segmented`, `propagated` of the offline pass; `delivered`, of the real-time run."""
    error_detection: ErrorDetection | None = None
    """How well measures of uncertainty find the wrong pixels of segmented frames; null where nothing states any."""
    latency_ms: Latency | None = None
    """Latencies of the answered frames; null without a clock."""
    throughput: Throughput | None = None
    """Rates, deadlines and utilisation; null without a clock."""
    trajectory: TrajectoryScore | None = None
    """Quality of the poses used."""
    map: MapScore | None = None
    """The semantic map."""
    not_measured: dict[str, str] = Field(default_factory=dict)
    """Key of this run that is null -> why it was not measured."""

    @model_validator(mode="after")
    def _nothing_is_lost(self) -> Self:
        if self.outcomes.total != self.frames:
            raise ValueError(
                f"the outcomes of {self.mode} sum to {self.outcomes.total}, but there are {self.frames} frames"
            )
        if self.background is not None and self.background.finished != len(self.keyframes):
            raise ValueError(
                f"{self.background.finished} frames of {self.mode} were finished in the background, but there are "
                f"{len(self.keyframes)} keyframes"
            )
        return self


class ComparisonRow(Part):
    """One metric of two modes, paired over the same frames."""

    metric: str
    """Path of the metric inside a run, e.g. `offline.miou`."""
    base: Number = None
    """Value of the base mode, in `unit`."""
    other: Number = None
    """Value of the other mode, in `unit`."""
    delta: Number = None
    """`other` - `base`, in `unit`."""
    ci95: tuple[float, float] | None = None
    """95 % confidence interval of `delta` (block bootstrap-t, paired, seeded); null when there is none."""
    n: Count = 0
    """Frames behind the difference."""
    unit: str = ""
    """`fraction`, `ms`, `Hz` or `frames`."""
    higher_is_better: bool = True
    """Direction of good."""
    why_no_interval: str = ""
    """Why `ci95` is null; empty otherwise."""


class Comparison(Part):
    """Two modes of this report against each other."""

    base: str
    """The mode compared with."""
    other: str
    """The mode compared."""
    rows: tuple[ComparisonRow, ...] = ()
    """One per metric."""


class Verdict(Part):
    """How the run ended, in words and as the exit code of the command."""

    exit_code: Literal[0, 3, 5]
    """0 fine, 3 finished with a lossy input, 5 nothing measured."""
    text: str
    """One sentence."""


class Document(Part):
    """A whole report."""

    schema_version: Literal[1] = SCHEMA_VERSION
    """Version of this schema; it grows when a key changes its meaning or goes."""
    state: State
    """`valid`, `lossy` (damaged or partial input) or `invalid` (neither accuracy nor timing could be measured)."""
    state_reasons: tuple[str, ...] = ()
    """Why the state is not `valid`, one sentence each."""
    accuracy_state: AccuracyState
    """Whether accuracy was measured at all."""
    accuracy_reason: str = ""
    """Why accuracy was not measured; empty when it was."""
    digest: str = ""
    """sha256 of the canonical JSON of this document without `host` and `digest`."""
    verdict: Verdict
    """How the run ended."""
    identity: Identity
    """Network, backend, versions and costs."""
    input: Input
    """The log and its classes."""
    config: dict[str, JsonValue] = Field(default_factory=dict)
    """The resolved configuration, without paths, output, repeat and display flags."""
    config_hash: str = ""
    """sha256 of the canonical JSON of `config`."""
    runs: tuple[Run, ...] = ()
    """One per mode, in the order asked for."""
    comparison: Comparison | None = None
    """The first mode against the second; null with one mode."""
    more_comparisons: tuple[Comparison, ...] = ()
    """The first mode against each further one."""
    warnings: tuple[str, ...] = ()
    """What a reader must know before believing a number, one sentence each."""
    host: Host = Field(default_factory=Host)
    """What differs from run to run; outside the digest."""

    def run(self, mode: str) -> Run | None:
        """The run of `mode`, None if there is none."""
        return next((run for run in self.runs if run.mode == mode), None)


def json_schema() -> dict[str, JsonValue]:
    """The published JSON Schema of report.json (docs/report.schema.json)."""
    schema = Document.model_json_schema(mode="serialization")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
