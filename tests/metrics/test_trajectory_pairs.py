"""Errors per metre and per second against evo to 1e-9, the judgement of a whole trajectory, and its file."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.metrics import tum
from stsem.metrics.trajectory import (
    Errors,
    absolute_errors,
    accuracy,
    pairs_apart,
    relative_errors,
    relative_errors_per_metre,
    relative_errors_per_second,
)
from stsem.pose import Trajectory, from_quaternion

Poses = np.ndarray


def walk(n: int, seed: int, *, stands: bool = False) -> tuple[Poses, Poses]:
    """An estimate with noise and the truth; about 0.2 m a step, every third step none if it `stands`."""
    rng = np.random.default_rng(seed)
    truth = [np.eye(4)]
    for i in range(n - 1):
        still = stands and i % 3 == 0
        truth.append(truth[-1] @ from_quaternion(np.zeros(3) if still else rng.normal(0, 0.1, 3), [0, 0.02, 0.01, 1]))
    noise = [from_quaternion(rng.normal(0, 0.02, 3), [*rng.normal(0, 0.01, 3), 1]) for _ in truth]
    return np.array([pose @ error for pose, error in zip(truth, noise, strict=True)]), np.array(truth)


def same(ours: Errors, theirs: dict[str, float]) -> None:
    for name in ("rmse", "mean", "median", "std", "min", "max"):
        assert getattr(ours, name) == pytest.approx(theirs[name], abs=1e-9)


@pytest.mark.parametrize("stands", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_per_metre_and_per_second_agree_with_evo(seed: int, stands: bool) -> None:
    metrics = pytest.importorskip("evo.core.metrics")
    trajectory = pytest.importorskip("evo.core.trajectory")
    estimate, truth = walk(80, seed, stands=stands)
    stamps = np.arange(80) * 0.1
    found, wanted = (trajectory.PoseTrajectory3D(poses_se3=list(p), timestamps=stamps) for p in (estimate, truth))

    def theirs(relation: object, delta: float, unit: object) -> dict[str, float]:
        metric = metrics.RPE(relation, delta, unit, all_pairs=True, pairs_from_reference=True)
        metric.process_data((wanted, found))
        return dict(metric.get_all_statistics())

    translation, rotation = metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_deg
    ours = relative_errors_per_metre(estimate, truth)
    same(ours.translation_m, theirs(translation, 1.0, metrics.Unit.meters))
    same(ours.rotation_deg, theirs(rotation, 1.0, metrics.Unit.meters))
    ours = relative_errors_per_second(np.arange(80) * 100_000_000, estimate, truth)  # ten frames a second
    same(ours.translation_m, theirs(translation, 10, metrics.Unit.frames))
    same(ours.rotation_deg, theirs(rotation, 10, metrics.Unit.frames))


@settings(max_examples=60, derandomize=True, deadline=None)
@given(steps=st.lists(st.integers(0, 4), max_size=30), delta=st.integers(1, 12))
def test_pairs_are_those_of_a_search(steps: list[int], delta: int) -> None:
    """Against the definition written as a loop; whole numbers make many ties."""
    progress = np.concatenate([[0.0], np.cumsum(steps, dtype=np.float64)])
    wanted = []
    for i in range(len(progress) - 1):
        off = np.abs(progress[i + 1 :] - progress[i] - delta)
        if off.min() <= 0.1 * delta:
            wanted.append((i, i + 1 + int(off.argmin())))
    assert list(zip(*(rows.tolist() for rows in pairs_apart(progress, delta)), strict=True)) == wanted


def test_a_gap_is_not_bridged() -> None:
    """Poses on both sides of five lost seconds are no pair of one second."""
    stamps = np.array([0, 5, 10, 60, 65, 70]) * 100_000_000
    first, second = pairs_apart(stamps.astype(np.float64), 1e9)
    assert (first.tolist(), second.tolist()) == ([0, 3], [2, 5])


def test_accuracy_of_a_trajectory() -> None:
    """Matched within 20 ms, aligned; what cannot be told is None."""
    estimate, truth = walk(60, 7)
    stamps = np.arange(60, dtype=np.int64) * 100_000_000
    tracked = np.flatnonzero(np.arange(60) % 10 != 3)
    late = Trajectory(stamps[tracked] + 15_000_000, estimate[tracked])
    found = accuracy(late, Trajectory(stamps, truth))
    assert found.ate == absolute_errors(estimate[tracked], truth[tracked])
    assert found.matched == 54
    assert found.per_second is not None
    assert found.per_metre is not None
    far = accuracy(Trajectory(stamps + 30_000_000, estimate), Trajectory(stamps, truth))
    assert (far.ate, far.per_metre, far.per_second, far.matched) == (None, None, None, 0)


def test_per_second_of_regular_frames_contains_the_frames() -> None:
    """Without noise in time, the pairs of ten frames that `relative_errors` takes are among those per second."""
    estimate, truth = walk(31, 3)
    some = relative_errors(estimate, truth, 10)
    every = relative_errors_per_second(np.arange(31) * 100_000_000, estimate, truth)
    assert (some.translation_m.n, every.translation_m.n) == (3, 21)
    assert every.translation_m.max >= some.translation_m.max


def test_the_file_is_read_by_evo_and_by_us(tmp_path: Path) -> None:
    files = pytest.importorskip("evo.tools.file_interface")
    estimate, _ = walk(20, 1)
    stamps = 1_700_000_000 * 10**9 + np.arange(20, dtype=np.int64) * 33_333_333
    path = tmp_path / "trajectory.txt"
    path.write_text(tum.HEADER + "".join(tum.lines(stamps, estimate)), encoding="ascii")
    theirs = files.read_tum_trajectory_file(path)
    ours = tum.parse(path.read_text(encoding="ascii").splitlines())
    assert ours.stamps_ns.tolist() == stamps.tolist()
    assert ours.poses == pytest.approx(estimate, abs=1e-8)
    assert ours.poses == pytest.approx(np.array(theirs.poses_se3), abs=1e-12)
    assert theirs.timestamps == pytest.approx(stamps / 1e9, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "why"),
    [("1.0 2 3", "line 1: a pose has eight"), ("2.0 0 0 0 0 0 0 1\n1.0 0 0 0 0 0 0 1", "ascend"),
     ("1 0 0 0 0 0 0 0", "not a pose"), ("x 0 0 0 0 0 0 1", "invalid literal")],
)  # fmt: skip
def test_files_that_are_none(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        tum.parse(text.splitlines())
