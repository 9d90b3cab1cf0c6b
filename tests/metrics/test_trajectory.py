"""Trajectory errors against evo, to 1e-9."""

import numpy as np
import numpy.typing as npt
import pytest

from stsem.metrics.trajectory import (
    Errors,
    TrajectoryMeter,
    absolute_errors,
    associate,
    relative_errors,
    rotation_angle,
    umeyama,
)
from stsem.pose import from_quaternion

Poses = npt.NDArray[np.float64]


def walk(n: int, seed: int, noise: float) -> tuple[Poses, Poses]:
    """A true walk, and an estimate of it in another world frame with noise in metres and about radians."""
    rng = np.random.default_rng(seed)
    step = [from_quaternion(rng.normal(0, 0.1, 3), [*rng.normal(0, 0.05, 3), 1]) for _ in range(n)]
    truth = [np.eye(4)]
    for move in step:
        truth.append(truth[-1] @ move)
    world = from_quaternion(rng.normal(0, 5, 3), rng.normal(0, 1, 4))
    errors = [from_quaternion(rng.normal(0, noise, 3), [*rng.normal(0, noise, 3), 1]) for _ in truth]
    return np.array([world @ pose @ error for pose, error in zip(truth, errors, strict=True)]), np.array(truth)


def same(ours: Errors, theirs: dict[str, float]) -> None:
    for name in ("rmse", "mean", "median", "std", "min", "max"):
        assert getattr(ours, name) == pytest.approx(theirs[name], abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_agrees_with_evo(seed: int) -> None:
    """ATE with and without alignment, RPE in metres and degrees for several distances."""
    metrics = pytest.importorskip("evo.core.metrics")
    trajectory = pytest.importorskip("evo.core.trajectory")
    estimate, truth = walk(60, seed, 0.03)
    stamps = np.arange(len(truth)) * 0.1
    found, wanted = (trajectory.PoseTrajectory3D(poses_se3=list(p), timestamps=stamps) for p in (estimate, truth))

    def stats(metric: object) -> dict[str, float]:
        metric.process_data((wanted, found))  # type: ignore[attr-defined]
        return dict(metric.get_all_statistics())  # type: ignore[attr-defined]

    same(absolute_errors(estimate, truth, align=False), stats(metrics.APE(metrics.PoseRelation.translation_part)))
    for delta in (1, 4):
        ours = relative_errors(estimate, truth, delta)
        same(ours.translation_m, stats(metrics.RPE(metrics.PoseRelation.translation_part, delta)))
        same(ours.rotation_deg, stats(metrics.RPE(metrics.PoseRelation.rotation_angle_deg, delta)))
    found.align(wanted)
    same(absolute_errors(estimate, truth), stats(metrics.APE(metrics.PoseRelation.translation_part)))


def test_association_agrees_with_evo() -> None:
    """Nearest stamps within 10 ms, whichever list is longer."""
    sync = pytest.importorskip("evo.core.sync")
    rng = np.random.default_rng(0)
    many = np.arange(0, 2000, 20) * 1_000_000 + rng.integers(-4_000_000, 4_000_000, 100)
    few = np.sort(rng.choice(many, 40, replace=False) + rng.integers(-15_000_000, 15_000_000, 40))
    wanted = sync.matching_time_indices(few / 1e9, many / 1e9, max_diff=0.01)
    for first, second, order in ((few, many, (0, 1)), (many, few, (1, 0))):
        found = associate(first, second)
        assert found[order[0]].tolist() == list(wanted[0])
        assert found[order[1]].tolist() == list(wanted[1])
    assert [len(i) for i in associate(few[:0], many)] == [0, 0]
    assert [i.tolist() for i in associate(few[:1], few[:1])] == [[0], [0]]


def test_a_moved_world_is_no_error() -> None:
    """The estimate in another world frame aligns exactly: ATE and RPE are 0."""
    estimate, truth = walk(30, 9, 0.0)
    assert absolute_errors(estimate, truth).max < 1e-12
    assert absolute_errors(estimate, truth, align=False).max > 0.1
    assert relative_errors(estimate, truth).rotation_deg.max < 1e-6


def test_umeyama_refuses_what_it_cannot_align() -> None:
    """Two points, or points on a line, do not determine a rotation; mirrored points get a rotation, not a mirror."""
    line = np.outer(np.arange(5.0), [1, 2, 3])
    with pytest.raises(ValueError, match="on one line"):
        umeyama(line, line)
    with pytest.raises(ValueError, match="n >= 3"):
        umeyama(line[:2], line[:2])
    points = np.random.default_rng(1).normal(size=(20, 3))
    assert np.linalg.det(umeyama(points, points * [1, 1, -1])[:3, :3]) == pytest.approx(1)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.5, np.pi - 1e-9, np.pi])
def test_rotation_angle_is_exact_at_both_ends(angle: float) -> None:
    """Where the arc cosine of the trace has no digits left, the atan2 has them all."""
    pose = from_quaternion([0, 0, 0], [0, np.sin(angle / 2), 0, np.cos(angle / 2)])
    assert rotation_angle(pose) == pytest.approx(angle, abs=1e-15)


def test_the_meter_waits_for_enough_poses() -> None:
    """Two poses are not measured; all of them give what the function gives."""
    estimate, truth = walk(10, 2, 0.02)
    meter = TrajectoryMeter()
    for i, (found, wanted) in enumerate(zip(estimate, truth, strict=True)):
        meter.update(found, wanted)
        if i == 1:
            assert meter.compute() is None
    assert meter.compute() == absolute_errors(estimate, truth)
    with pytest.raises(ValueError, match="no pair"):
        relative_errors(estimate, truth, len(truth))
