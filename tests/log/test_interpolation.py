"""Poses as arrays against scipy: quaternions, interpolation, composition; samples around a stamp against the rule."""

import numpy as np
import numpy.typing as npt
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from stsem.pose import Trajectory, interpolate, inverse, to_quaternion

N = 500
HALF_TURNS = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1, 1e-9, 0, 0], [0.6, 0, 0.8, 0]])


def poses(rotations: Rotation, seed: int) -> npt.NDArray[np.float64]:
    result = np.tile(np.eye(4), (len(rotations), 1, 1))
    result[:, :3, :3] = rotations.as_matrix()
    result[:, :3, 3] = np.random.default_rng(seed).normal(size=(len(rotations), 3))
    return result


def awkward(seed: int) -> Rotation:
    """Random rotations, half turns (where the largest component changes), and hardly any rotation."""
    rng = np.random.default_rng(seed)
    small = Rotation.from_rotvec(rng.normal(size=(50, 3)) * 1e-7)
    return Rotation.concatenate([Rotation.random(N, random_state=seed), Rotation.from_quat(HALF_TURNS), small])


def test_quaternions_are_those_of_scipy() -> None:
    rotations = awkward(1)
    found = to_quaternion(poses(rotations, 2))
    expected = rotations.as_quat(canonical=True)
    agreement = np.abs((found * expected).sum(axis=1))  # of a half turn both signs are right
    np.testing.assert_allclose(agreement, 1, atol=1e-12)
    assert (found[:, 3] >= 0).all()
    np.testing.assert_allclose(to_quaternion(poses(rotations, 2)[7]), found[7], atol=1e-15)


def test_interpolation_is_that_of_scipy() -> None:
    start, turn = awkward(3), awkward(4)
    end = turn * start
    share = np.random.default_rng(5).uniform(size=len(start))
    a, b = poses(start, 6), poses(end, 7)
    found = interpolate(a, b, share)
    for i, part in enumerate(share):
        if turn[i].magnitude() > 3.14:
            continue  # two ways of half a turn are equally short
        expected = Slerp([0, 1], Rotation.concatenate([start[i : i + 1], end[i : i + 1]]))(part).as_matrix()
        np.testing.assert_allclose(found[i, :3, :3], expected, atol=2e-9)
    np.testing.assert_allclose(found[:, :3, 3], a[:, :3, 3] + share[:, None] * (b - a)[:, :3, 3], atol=1e-12)
    np.testing.assert_allclose(interpolate(a[11], b[11], float(share[11])), found[11], atol=1e-14)
    np.testing.assert_allclose(interpolate(a, b, np.zeros(len(a))), a, atol=1e-9)


def test_the_inverse_of_many() -> None:
    every = poses(awkward(8), 9)
    np.testing.assert_allclose(inverse(every) @ every, np.broadcast_to(np.eye(4), every.shape), atol=1e-12)


@settings(derandomize=True, max_examples=200, deadline=None)
@given(
    samples=st.lists(st.integers(0, 60), min_size=1, max_size=8, unique=True).map(sorted),
    wanted=st.lists(st.integers(-5, 65), max_size=10),
    gap=st.integers(0, 30),
    breaks=st.integers(0, 255),
)
def test_the_samples_around_a_stamp(samples: list[int], wanted: list[int], gap: int, breaks: int) -> None:
    """Against the rule: a sample's own stamp is known; else two neighbours within the gap, and no break between."""
    broken = np.array([bool(breaks >> i & 1) for i in range(len(samples) - 1)], np.bool_)
    line = np.tile(np.eye(4), (len(samples), 1, 1))
    line[:, 0, 3] = samples
    trajectory = Trajectory(np.array(samples, np.int64), line, broken)
    found = trajectory.brackets(np.array(wanted, np.int64), gap)
    for i, stamp in enumerate(wanted):
        before = [k for k, s in enumerate(samples) if s <= stamp]
        known = stamp in samples or bool(
            before and len(before) < len(samples)
            and samples[len(before)] - samples[before[-1]] <= gap and not broken[before[-1]]
        )  # fmt: skip
        assert found.known[i] == known
        one = trajectory.at(stamp, gap)
        assert (one is not None) == known
        if one is not None:
            assert abs(one.T_WC[0, 3] - stamp) < 1e-9
            assert one.later == found.later[i]
            assert samples[one.later] >= stamp
