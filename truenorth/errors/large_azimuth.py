"""Alignment of a stationary base from an azimuth of which nothing is known: models for nonlinear filters.

The ten states of :mod:`truenorth.errors.stationary` in the frozen level frame ``n0``, in which the INS keeps the attitude it
was given and gravity turns with the earth. Let ``B = C_n0_b_hat C_n0_b'`` be what the computed attitude is off:

    B' = [C_n0_b_hat eps x] B,    dv' = g - B g + C_n0_b_hat nabla,    z = dv (E, N)

three ways written: as a tilt after an azimuth of any size, ``B = (I - [(phi_E, phi_N, 0) x]) Rz(-phi_U)``, in which the model
is nonlinear in ``phi_U`` alone; as a rotation vector, ``B = exp(-[phi x])``; and as a quaternion. Each is exact to the first
order in the biases and, the first, in the tilts. Gravity's turn is what shows the azimuth.

Sources: system 4, and its related work: X. Kong, E. M. Nebot, H. Durrant-Whyte, Development of a nonlinear psi-angle model for
large misalignment errors, ICRA 1999; J. L. Crassidis, F. L. Markley, Unscented filtering for spacecraft attitude estimation,
J. Guid. Control Dyn. 26, 2003.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import (
    cross,
    dcm_from_quaternion,
    dcm_from_rotation_vector,
    quaternion_from_rotation_vector,
    quaternion_product,
    rotate,
)
from truenorth.core.compiled import compiled
from truenorth.errors.stationary import DV, PHI, STATES, StationaryModel
from truenorth.filters import NonlinearSystem, matrix_function, vector_function
from truenorth.strapdown.inertial import InertialIntegrals, gravity_velocity

Array = NDArray[np.float64]
Form = Literal["tilt_azimuth", "rotation_vector", "quaternion"]

# Parameters of an epoch: interval, mean of C_n0_b_hat by rows, integral of gravity in n0 over the interval.
INTERVAL, ATTITUDE, GRAVITY, PARAMETERS = 0, 1, 10, 13


@compiled(forceinline=True)
def turned_by(p: Array, bias: Array) -> tuple[float, float, float]:
    """``C_n0_b_hat`` times three numbers from `bias` on."""
    return (
        p[1] * bias[0] + p[2] * bias[1] + p[3] * bias[2],
        p[4] * bias[0] + p[5] * bias[1] + p[6] * bias[2],
        p[7] * bias[0] + p[8] * bias[1] + p[9] * bias[2],
    )


@compiled(forceinline=True)
def add_velocity(x: Array, p: Array, felt: tuple[float, float, float], at: int, out: Array) -> None:
    """Biases stay; ``dv`` grows by ``int (g - B g + C nabla) dt``, ``felt = int B g dt``; it stands at `at`, biases behind it."""
    T = p[INTERVAL]
    for i in range(at + 2, at + 7):
        out[i] = x[i]
    a = at + 5
    out[at] = x[at] + p[GRAVITY] - felt[0] + T * (p[1] * x[a] + p[2] * x[a + 1])
    out[at + 1] = x[at + 1] + p[GRAVITY + 1] - felt[1] + T * (p[4] * x[a] + p[5] * x[a + 1])


@compiled(forceinline=True)
def half_turned(x: Array, p: Array) -> Any:
    """``C eps``; the tilt, and gravity turned by the azimuth, half an interval on; tuples."""
    half, rate = 0.5 * p[INTERVAL], turned_by(p, x[5:8])
    azimuth = x[2] - half * rate[2]
    s, c = math.sin(azimuth), math.cos(azimuth)
    g = (c * p[GRAVITY] + s * p[GRAVITY + 1], c * p[GRAVITY + 1] - s * p[GRAVITY], p[GRAVITY + 2])  # Rz(-phi_U) g
    return rate, (x[0] - half * rate[0], x[1] - half * rate[1], 0.0), g


@vector_function
def tilt_azimuth_transition(x: Array, p: Array, out: Array) -> None:
    """Of ``[phi_E, phi_N, phi_U, dv (2), eps (3), nabla (2)]``, a tilt after an azimuth."""
    T = p[INTERVAL]
    rate, tilt, g = half_turned(x, p)
    turn = cross(tilt, g)
    add_velocity(x, p, (g[0] - turn[0], g[1] - turn[1], g[2] - turn[2]), 3, out)
    for i in range(3):
        out[i] = x[i] - T * rate[i]


@matrix_function
def tilt_azimuth_jacobian(x: Array, p: Array, out: Array) -> None:
    """Of `tilt_azimuth_transition`."""
    T = p[INTERVAL]
    _, tilt, g = half_turned(x, p)
    for i in range(10):
        out[i, i] = 1.0
    out[3, 1], out[4, 0] = g[2], -g[2]
    turned = (g[1], -g[0], 0.0)  # d g / d phi_U
    turn = cross(tilt, turned)
    out[3, 2], out[4, 2] = turn[0] - turned[0], turn[1] - turned[1]
    for j in range(3):
        for i in range(3):
            out[i, 5 + j] = -T * p[ATTITUDE + 3 * i + j]
        for i in (3, 4):
            for m in range(3):  # half of what the bias turns within the interval is felt in it
                out[i, 5 + j] += out[i, m] * -T / 2 * p[ATTITUDE + 3 * m + j]
    for j in range(2):
        out[3, 8 + j], out[4, 8 + j] = T * p[ATTITUDE + j], T * p[ATTITUDE + 3 + j]


@vector_function
def rotation_vector_transition(x: Array, p: Array, out: Array) -> None:
    """Of the same states with ``B = exp(-[phi x])``: ``phi' = -J(-phi)^-1 C eps``, J the left Jacobian of the rotations."""
    T = p[INTERVAL]
    rate = turned_by(p, x[5:8])
    phi = (x[0], x[1], x[2])
    angle = math.sqrt(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
    second = 1.0 / 12.0
    if angle > 1e-2:
        second = 1.0 / angle**2 - 1.0 / (2.0 * angle * math.tan(angle / 2.0))
    once = cross(phi, rate)
    twice = cross(phi, once)
    change = (
        -rate[0] - 0.5 * once[0] - second * twice[0],
        -rate[1] - 0.5 * once[1] - second * twice[1],
        -rate[2] - 0.5 * once[2] - second * twice[2],
    )
    half = T / 2
    back = quaternion_from_rotation_vector(
        (-x[0] - half * change[0], -x[1] - half * change[1], -x[2] - half * change[2])
    )
    felt = rotate(back, (p[GRAVITY], p[GRAVITY + 1], p[GRAVITY + 2]))
    add_velocity(x, p, felt, 3, out)
    for i in range(3):
        out[i] = x[i] + T * change[i]


@vector_function
def quaternion_transition(x: Array, p: Array, out: Array) -> None:
    """Of ``[q (4) of B, dv (2), eps (3), nabla (2)]``: ``q' = (0, C eps) q / 2``; its length has no meaning."""
    T = p[INTERVAL]
    rate = turned_by(p, x[6:9])
    scale = 1.0 / math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + x[3] ** 2)
    q = (scale * x[0], scale * x[1], scale * x[2], scale * x[3])
    step = quaternion_from_rotation_vector((T / 2 * rate[0], T / 2 * rate[1], T / 2 * rate[2]))
    middle = quaternion_product(step, q)
    felt = rotate(middle, (p[GRAVITY], p[GRAVITY + 1], p[GRAVITY + 2]))
    add_velocity(x, p, felt, 4, out)
    end = quaternion_product(step, middle)
    for i in range(4):
        out[i] = end[i]


@vector_function
def velocity_measurement(x: Array, p: Array, out: Array) -> None:
    """The velocity errors: seven states from the end, behind the attitude."""
    out[0] = x[len(x) - 7]
    out[1] = x[len(x) - 6]


@matrix_function
def velocity_jacobian(x: Array, p: Array, out: Array) -> None:
    """Of `velocity_measurement`."""
    out[0, len(x) - 7] = out[1, len(x) - 6] = 1.0


def large_azimuth_system(
    model: StationaryModel,  # place and random walks
    integrals: Sequence[InertialIntegrals],  # of each run's log; all of the same intervals
    C_n0_i: Array,  # (runs, 3, 3): the attitude that the INS was given at the start
    P0: Array,  # (10, 10): of ``[phi, dv, eps, nabla]``; it may hold all of the circle
    R: float,  # (m/s)^2: variance of the base's velocity along each axis
    form: Form = "tilt_azimuth",  # how the attitude error is written; Jacobians come with the first
) -> NonlinearSystem:
    """The system of logs that start from attitudes with a large azimuth error."""
    time, T = integrals[0].time, integrals[0].intervals
    gravity = gravity_velocity(time, model.lat, model.alt)
    velocity = np.stack([one.velocity for one in integrals]) @ np.swapaxes(C_n0_i, 1, 2) + gravity
    C = C_n0_i[:, None] @ np.stack([one.C_mean for one in integrals])
    p = np.zeros((*C.shape[:2], PARAMETERS))
    p[..., INTERVAL], p[..., GRAVITY:] = T, np.diff(gravity, axis=0)
    p[..., ATTITUDE:GRAVITY] = C.reshape(*C.shape[:2], 9)
    x0, Q = np.zeros(10), _process_noise(model, T)
    if form == "quaternion":
        x0, P0, Q = _as_quaternion(P0, Q)
    transitions = {
        "tilt_azimuth": tilt_azimuth_transition,
        "rotation_vector": rotation_vector_transition,
        "quaternion": quaternion_transition,
    }
    return NonlinearSystem(
        transition=transitions[form],
        measurement=velocity_measurement,
        Q=Q,
        R=R * np.eye(2)[None],
        z=velocity[:, 1:, :2],
        x0=x0,
        P0=P0,
        p=p,
        transition_jacobian=tilt_azimuth_jacobian if form == "tilt_azimuth" else None,
        measurement_jacobian=velocity_jacobian if form == "tilt_azimuth" else None,
    )


def attitude_error(x: Array, form: Form = "tilt_azimuth") -> Array:
    """``B`` (..., 3, 3) that states (..., n) tell: the true attitude is ``B' C_n0_b_hat``."""
    if form == "quaternion":
        q = x[..., :4] / np.linalg.norm(x[..., :4], axis=-1, keepdims=True)
        return dcm_from_quaternion(q)
    if form == "rotation_vector":
        return dcm_from_rotation_vector(-x[..., PHI])
    flat = np.zeros((*x.shape[:-1], 3))
    azimuth = flat.copy()
    flat[..., :2], azimuth[..., 2] = x[..., :2], x[..., 2]
    return np.asarray(dcm_from_rotation_vector(-flat) @ dcm_from_rotation_vector(-azimuth))


def _process_noise(model: StationaryModel, T: Array) -> Array:
    """(K, 10, 10): white gyro noise reaches phi at once and dv as a ramp, by gravity."""
    q_g, q_a, g = model.walks.gyro_random_walk**2, model.walks.accel_random_walk**2, model.gravity
    Q = np.zeros((len(T), STATES, STATES))
    Q[:, PHI, PHI] = q_g * T[:, None, None] * np.eye(3)
    Q[:, DV, DV] = (q_a * T + q_g * T**3 / 3 * g**2)[:, None, None] * np.eye(2)
    tilt = q_g * T[:, None, None] ** 2 / 2 * g * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
    Q[:, DV, PHI], Q[:, PHI, DV] = tilt, np.swapaxes(tilt, 1, 2)
    return Q


def _as_quaternion(P0: Array, Q: Array) -> tuple[Array, Array, Array]:
    """Start, its covariance and process noise with the quaternion in place of phi; the azimuth's part over the circle."""
    J = np.zeros((11, 10))  # dq = -phi/2 about no rotation
    J[1:4, PHI] = -0.5 * np.eye(3)
    J[4:, 3:] = np.eye(7)
    P = J @ P0 @ J.T
    # Moments of cos(u/2) and sin(u/2) for u ~ N(0, s^2): as near as a normal distribution comes to a circle.
    s2 = P0[2, 2]
    x0 = np.zeros(11)
    x0[0] = math.exp(-s2 / 8)
    P[3, 3] = 0.5 * (1.0 - math.exp(-s2 / 2))
    P[0, 0] = 0.5 * (1.0 + math.exp(-s2 / 2)) - x0[0] ** 2
    return x0, P, J @ Q @ J.T
