"""Unit and direction of every number of a run, by its path in the report: reports and gates need no second list."""

from dataclasses import dataclass
from fnmatch import fnmatchcase


@dataclass(frozen=True)
class Facts:
    """What a reader must know about a number.

    Args:
        unit: `fraction`, `ms`, `Hz`, `frames`, `m`, `deg`, `1` (a plain ratio), `points` or `voxels`.
        higher_is_better: None when neither is.
    """

    unit: str
    higher_is_better: bool | None


_MORE, _LESS = Facts("fraction", True), Facts("fraction", False)

CATALOGUE: tuple[tuple[str, Facts], ...] = (
    ("*.miou", _MORE),
    ("*.miou_union", _MORE),
    ("*.miou_common", _MORE),
    ("*.pixel_accuracy", _MORE),
    ("*.iou.*", _MORE),
    ("*.unlabelled_share", _LESS),
    ("*.misses", Facts("frames", False)),
    ("loss.*", _LESS),
    ("by_distance_summary.*", _MORE),
    ("consistency.*", _MORE),
    ("calibration.*.?ce", _LESS),
    ("calibration.*.accuracy", _MORE),
    ("calibration.*.confidence", Facts("fraction", None)),
    ("error_detection.auc.*", _MORE),
    ("error_detection.wrong_share", _LESS),
    ("latency_ms.*", Facts("ms", False)),
    ("throughput.output_hz", Facts("Hz", True)),
    ("throughput.offered_hz", Facts("Hz", None)),
    ("throughput.sustainable_hz", Facts("Hz", True)),
    ("throughput.processed_share", _MORE),
    ("throughput.real_time_factor", Facts("1", True)),
    ("throughput.jitter_ms", Facts("ms", False)),
    ("throughput.deadline_misses", Facts("frames", False)),
    ("throughput.utilisation*", Facts("fraction", None)),
    ("outcomes.segmented", Facts("frames", None)),
    ("outcomes.propagated", Facts("frames", None)),
    ("outcomes.*", Facts("frames", False)),
    ("trajectory.tracked_share", _MORE),
    ("trajectory.lost", Facts("frames", False)),
    ("trajectory.relocalised", Facts("frames", None)),
    ("trajectory.keyframes", Facts("frames", None)),
    ("trajectory.loops", Facts("frames", None)),
    ("trajectory.n_*", Facts("frames", None)),
    ("trajectory.*_m", Facts("m", False)),
    ("trajectory.*_deg", Facts("deg", False)),
    ("map.points", Facts("points", None)),
    ("map.points_left_out", Facts("points", False)),
    ("map.voxels", Facts("voxels", None)),
    ("map.outlier_share", _LESS),
    ("map.*", _MORE),
)
"""Pattern of the path inside a run -> facts; the first pattern that fits counts."""


def facts(path: str) -> Facts:
    """Facts of the number at `path` inside a run, e.g. `offline.miou` or `latency_ms.from_arrival.p95`.

    Raises:
        ValueError: no such number is known.
    """
    for pattern, found in CATALOGUE:
        if fnmatchcase(path, pattern):
            return found
    raise ValueError(f"no number of a run is called {path!r}; the patterns are {', '.join(p for p, _ in CATALOGUE)}")
