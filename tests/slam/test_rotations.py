"""Rotations as vectors, against scipy and against finite differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stsem.slam.rotations import exponential, inverse_right_jacobian, logarithm

ANGLES = [0.0, 1e-9, 9e-5, 1.1e-4, 1e-3, 0.5, 2.0, np.pi - 1e-3, np.pi - 1e-5, np.pi - 1e-9]
axes = st.tuples(*[st.floats(-1, 1, allow_subnormal=False)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)


@settings(max_examples=40, derandomize=True, deadline=None)
@given(axis=axes, angle=st.sampled_from(ANGLES))
def test_there_and_back_as_scipy(axis: tuple[float, float, float], angle: float) -> None:
    v = np.array(axis) / np.linalg.norm(axis) * angle
    R = exponential(v)
    assert np.allclose(R, Rotation.from_rotvec(v).as_matrix(), rtol=0, atol=1e-12)
    assert logarithm(R) == pytest.approx(v, abs=1e-7 if angle > 3 else 1e-12)


def test_a_half_turn_has_one_of_two_axes() -> None:
    for v in np.pi * np.eye(3):
        assert np.abs(logarithm(exponential(v))) == pytest.approx(v, abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 5e-3, 2e-2, 1.0, 3.0])
def test_inverse_right_jacobian(angle: float) -> None:
    v = angle * np.array([2.0, -1.0, 2.0]) / 3
    steps = 1e-6 * np.concatenate([np.eye(3), -np.eye(3)])
    ends = logarithm(exponential(v) @ exponential(steps))
    assert inverse_right_jacobian(v) == pytest.approx(((ends[:3] - ends[3:]) / 2e-6).T, abs=1e-8)
