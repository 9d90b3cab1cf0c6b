"""Sections about poses and the map."""

from stsem.document.part import Part
from stsem.document.schema import Document, MapScore, Run
from stsem.document.trajectory import PoseSide, TrajectoryScore
from stsem.report.outline import Block, Column, Figure, Row, Section, Table
from stsem.report.wording import NONE, NOT_MEASURED, count, meaning, number, percent


def space_section(document: Document) -> Section | None:
    """Poses and map, where they were measured."""
    trajectory, sides, of_map = (
        _scores(document, "trajectory", TrajectoryScore), _sides(document), _scores(document, "map", MapScore),
    )  # fmt: skip
    figure = Figure("trajectory", "the path of the camera from above") if sides else None
    blocks: list[Block | None] = [figure, sides, trajectory, of_map]
    found = tuple(block for block in blocks if block is not None)
    return Section("Poses and map", found) if found else None


def _sides(document: Document) -> Table | None:
    """Both sources of poses beside each other, where SLAM ran; the errors are SLAM's against the log."""
    runs = [run for run in document.runs if run.trajectory is not None and run.trajectory.sides]
    if not runs:
        return None
    columns = (
        Column("poses of", number=False), Column("mode", number=False), Column("frames", meaning(PoseSide, "poses")),
        Column("path, m", meaning(PoseSide, "path_m")), Column("ATE, m", meaning(TrajectoryScore, "ate_rmse_m")),
        Column("RPE over 1 s, m", meaning(TrajectoryScore, "rpe_translation_m")),
        Column("RPE over 1 m, m", meaning(TrajectoryScore, "rpe_per_metre_translation_m")),
        Column("offline mIoU, %", meaning(PoseSide, "offline_miou")),
        Column("pixel accuracy, %", meaning(PoseSide, "offline_pixel_accuracy")), Column("n", meaning(PoseSide, "n")),
    )  # fmt: skip
    rows: dict[tuple[str, ...], list[str]] = {}
    for run in runs:
        for side in run.trajectory.sides if run.trajectory else ():
            rows.setdefault(_side(run, side), []).append(run.mode)
    notes = (
        "The log's poses are the truth that SLAM's are compared with; no stage of these runs saw them. "
        f"ATE: {meaning(TrajectoryScore, 'ate_rmse_m')} RPE: {meaning(TrajectoryScore, 'rpe_translation_m')}",
        *(
            ("Scores: where predictions depend on poses; those with the log's poses come from a pass of their own.",)
            if _scored(runs)
            else ()
        ),
    )
    return Table(columns, tuple(Row((cells[0], ", ".join(modes), *cells[1:])) for cells, modes in rows.items()), notes)


def _side(run: Run, side: PoseSide) -> tuple[str, ...]:
    """The cells of a row but for the mode."""
    found = run.trajectory if side.used else None
    errors = ("ate_rmse_m", "rpe_translation_m", "rpe_per_metre_translation_m")
    return (
        side.pose, count(side.poses), number(side.path_m, 2),
        *(NONE if found is None else _plain(name, getattr(found, name)) for name in errors),
        *(NONE if score is None else percent(score) for score in (side.offline_miou, side.offline_pixel_accuracy)),
        count(side.n) if side.n else NONE,
    )  # fmt: skip


def _scored(runs: list[Run]) -> bool:
    return any(side.n for run in runs if run.trajectory for side in run.trajectory.sides)


def _scores(document: Document, name: str, part: type[Part]) -> Table | None:
    runs = [run for run in document.runs if getattr(run, name) is not None]
    if not runs:
        return None
    columns = (Column(name, number=False), *(Column(run.mode) for run in runs))
    parts = [getattr(run, name) for run in runs]
    fields = [field for field in part.model_fields if any(_worth_showing(one, field) for one in parts)]
    rows = tuple(
        Row(
            (_titled(field), *(_plain(field, getattr(getattr(run, name), field)) for run in runs)), meaning(part, field)
        )
        for field in fields
    )
    return Table(columns, rows)


def _worth_showing(part: Part, field: str) -> bool:
    """What was measured; of what was counted, zeros only where SLAM counted."""
    value = getattr(part, field)
    counted = getattr(part, "pose", "") == "slam" and isinstance(value, int)
    return (bool(value) or counted) and not isinstance(value, tuple)


_IN_PER_CENT = ("share", "miou_3d", "observed", "accuracy_3d", "f_score")
_UNITS = {"_m": ", m", "_deg": ", deg"}


def _titled(field: str) -> str:
    if field.endswith(_IN_PER_CENT):
        return f"{field.replace('_', ' ')}, %"
    ending = next((ending for ending in _UNITS if field.endswith(ending)), "")
    return field.removesuffix(ending).replace("_", " ") + _UNITS.get(ending, "")


def _plain(field: str, value: object) -> str:
    if isinstance(value, float):
        return percent(value) if field.endswith(_IN_PER_CENT) else f"{value:.3f}"
    return count(value) if isinstance(value, int) else NOT_MEASURED if value is None else str(value)
