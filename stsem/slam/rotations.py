"""Rotations as vectors: exponential, logarithm and its derivative, for many at once (Sola, Deray, Atchuthan 2018)."""

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]

_SMALL = 1e-4
"""Below this angle series replace quotients; what they leave out is below 1e-17."""


def skew(v: F64) -> F64:
    """[v]x (..., 3, 3) of v (..., 3): [v]x w = v x w."""
    result = np.zeros((*v.shape, 3))
    result[..., 0, 1], result[..., 0, 2], result[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    result[..., 1, 0], result[..., 2, 0], result[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return result


def exponential(v: F64) -> F64:
    """R (..., 3, 3) of a rotation by |v| radians about v (..., 3) (Rodrigues; Sola 2018, equation 132)."""
    angle2 = (v * v).sum(axis=-1)[..., None, None]
    angle = np.sqrt(angle2)
    small = angle < _SMALL
    safe = np.where(small, 1.0, angle)
    sine = np.where(small, 1 - angle2 / 6, np.sin(safe) / safe)
    half = np.sin(safe / 2) / safe
    versine = np.where(small, 0.5 - angle2 / 24, 2 * half * half)
    K = skew(v)
    return np.asarray(np.eye(3) + sine * K + versine * (K @ K))


def logarithm(R: F64) -> F64:
    """v (..., 3), |v| in 0..pi, with R = exponential(v) (Sola 2018, equation 133); its sign is free at pi."""
    sine_axis = np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1
    )
    sine = np.linalg.norm(sine_axis, axis=-1) / 2
    cosine = (np.trace(R, axis1=-2, axis2=-1) - 1) / 2
    angle = np.arctan2(sine, cosine)
    small = sine < _SMALL
    factor = np.where(small, 0.5 + sine * sine / 12, angle / np.where(small, 1.0, 2 * sine))
    v = factor[..., None] * sine_axis
    near_pi = small & (cosine < 0)
    if near_pi.any():
        v[near_pi] = _half_turns(R[near_pi], sine_axis[near_pi], angle[near_pi])
    return np.asarray(v)


def inverse_right_jacobian(v: F64) -> F64:
    """J (..., 3, 3): logarithm(exponential(v) exponential(d)) = v + J d, to first order (Sola 2018, equation 144)."""
    angle2 = (v * v).sum(axis=-1)[..., None, None]
    angle = np.sqrt(angle2)
    small = angle < 1e-2
    safe = np.where(small, 1.0, angle)
    # (1 + cos a) / (2 a sin a) = 1 / (2 a tan(a / 2)), which stays finite at pi
    factor = 1 / safe**2 - 1 / (2 * safe * np.tan(safe / 2))
    factor = np.where(small, 1 / 12 + angle2 / 720 + angle2 * angle2 / 30240, factor)
    K = skew(v)
    return np.asarray(np.eye(3) + K / 2 + factor * (K @ K))


def _half_turns(R: F64, sine_axis: F64, angle: F64) -> F64:
    """Logarithm of rotations by almost pi (n, 3, 3): the axis is the largest column of (R + R^T) / 2 - cos(a) I."""
    outer = (R + np.swapaxes(R, -2, -1)) / 2 - np.cos(angle)[:, None, None] * np.eye(3)
    largest = np.argmax(np.einsum("nii->ni", outer), axis=1)
    axis = np.take_along_axis(outer, largest[:, None, None], axis=2)[..., 0]
    axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
    turned = np.where((axis * sine_axis).sum(axis=-1) < 0, -1.0, 1.0)
    return np.asarray((turned * angle)[:, None] * axis)
