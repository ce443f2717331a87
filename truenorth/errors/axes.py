"""Scale factors and misalignments of the sensors of an INS under way, as groups of nine states each.

    phi' = ... - C M_g w,        dv' = ... + C M_a (f - f0)

``M_g`` and ``M_a`` by rows, measured minus true: ``w_hat = (I + M_g) w + eps``. They act on turn rates and on kinematic
acceleration. Gravity is not among what they act on: ``f0`` is the specific force at rest, as the vehicle stands at the start, and
``M_a f0`` belongs to the accelerometer bias, where levelling has put it. Of the bias ``b = nabla + M_a f0`` each element of the
matrix is known by regression: ``E[M_ij | b_i] = s_ij^2 f0_j b_i / var(b_i)``.

Source: P. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed. (2013), sec. 4.4.2
(scale factor and cross-coupling errors), 14.2.6 (as states of an integrated system).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import cross, times
from truenorth.core.compiled import compiled
from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.errors.group import Group, columns
from truenorth.errors.ins import TURN_TIME
from truenorth.records.specs import ImuSpec
from truenorth.state.layout import ACCEL_AXES, BA, BG, GYRO_AXES, SLOW_ACCEL, Layout
from truenorth.state.now import NOW_C, NOW_FORCE_B, NOW_MEAN_RATE, NOW_SINCE, matrix_of, vector_of
from truenorth.state.track import Track

Array = NDArray[np.float64]

# A vehicle that is not at sea: it turns and pushes by so much in the mean (RMS). What axes do to it counts as white noise over
# `TURN_TIME`; where that is a small part of the sensor's own noise, there are no such states.
USUAL_TURN, USUAL_PUSH = math.radians(3.0), 1.0  # rad/s, m/s^2
SMALL = 0.05
LEVEL = np.eye(3)


@compiled
def _axis_of(now: Any, j: int) -> Any:
    """A body axis along w in the middle of the interval: it turns meanwhile."""
    e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
    back = cross(vector_of(now, NOW_MEAN_RATE), e)
    half = 0.5 * now[NOW_SINCE]
    return times(matrix_of(now, NOW_C), (e[0] - half * back[0], e[1] - half * back[1], e[2] - half * back[2]))


@columns
def _gyros(now: Any, figures: Any, first: int, assumed: Any, F: Any) -> None:
    w = vector_of(now, NOW_MEAN_RATE)
    for j in range(3):
        axis = _axis_of(now, j)
        for i in range(3):
            for k in range(3):
                F[i, first + 3 * j + k] = -axis[i] * w[k]


@columns
def _accels(now: Any, figures: Any, first: int, assumed: Any, F: Any) -> None:
    for j in range(3):
        axis = _axis_of(now, j)
        for i in range(3):
            for k in range(3):
                F[3 + i, first + 3 * j + k] = axis[i] * (now[NOW_FORCE_B + k] - figures[k])


def standing(C_nb: ArrayLike = LEVEL) -> Array:
    """(3,) specific force at rest in this attitude, body axes, m/s^2."""
    return GRAVITY_EQUATOR * np.asarray(C_nb, dtype=np.float64)[2]


def axis_sigma(spec: ImuSpec) -> tuple[Array, Array]:
    """(9,) sigmas of the elements of ``M_g`` and of ``M_a``, by rows."""
    found = []
    for scale, asymmetry, misalignment in (
        (spec.gyro_scale_factor, spec.gyro_scale_factor_asymmetry, spec.gyro_misalignment),
        (spec.accel_scale_factor, spec.accel_scale_factor_asymmetry, spec.accel_misalignment),
    ):
        own = np.full((3, 3), misalignment)
        own[range(3), range(3)] = math.hypot(scale, asymmetry)
        found.append(own.ravel())
    return found[0], found[1]


def axis_groups(spec: ImuSpec, force: ArrayLike, *, always: bool = False) -> tuple[Group, ...]:
    """The groups that a specification asks for: of gyros, of accelerometers.

    Parameters
    ----------
    spec : ImuSpec
    force : (3,) array, m/s^2
        Specific force at rest as the vehicle stands at the start, body axes.
    always : bool
        Those whose effect is small against the sensor's own noise, too.
    """
    found = []
    for group, usual, noise in (
        (gyro_axes(spec), USUAL_TURN, spec.gyro_random_walk),
        (accel_axes(spec, force), USUAL_PUSH, spec.accel_random_walk),
    ):
        largest = float(group.sigma.max())
        if largest > 0.0 and (always or (largest * usual) ** 2 * TURN_TIME > SMALL * noise**2):
            found.append(group)
    return tuple(found)


def turning_axes(spec: ImuSpec) -> tuple[Group, ...]:
    """The gyros' group, where it shows in turns against their noise; none else."""
    return tuple(group for group in axis_groups(spec, standing()) if group.name == GYRO_AXES)


def gyro_axes(spec: ImuSpec) -> Group:
    """The elements of ``M_g`` by rows."""
    return Group(GYRO_AXES, axis_sigma(spec)[0], acts=_gyros)


def accel_axes(spec: ImuSpec, force: ArrayLike) -> Group:
    """The elements of ``M_a`` by rows, which act on what differs from a force at rest, (3,) m/s^2."""
    return Group(ACCEL_AXES, axis_sigma(spec)[1], acts=_accels, figures=tuple(map(float, np.asarray(force))))


def proper_bias(track: Track, force: ArrayLike, acting: ArrayLike) -> tuple[Array, Array]:
    """The accelerometers' bias proper along a track, without ``M_a f0`` which its bias states hold, and its one-sigma.

    Parameters
    ----------
    track : Track
        With its covariance.
    force : (3,) array, m/s^2
        ``f0``.
    acting : (3,) array, (m/s^2)^2
        Variance of ``M_a f0`` by the specification, where the matrix is not among the states.

    Returns
    -------
    bias, sigma : (K, 3) arrays, m/s^2
    """
    layout = track.layout
    J = constant_biases(layout, force)[3:]
    if (slow := layout.slice_of(SLOW_ACCEL)) is not None:
        J[:, slow] = np.eye(3)
    unseen = np.asarray(acting, dtype=np.float64) * (layout.slice_of(ACCEL_AXES) is None)
    variance = np.einsum("ij,kjl,il->ki", J, track.P, J)
    return track.sensors @ J.T, np.sqrt(np.maximum(variance, 0.0) + unseen)


def constant_biases(layout: Layout, force: ArrayLike) -> Array:
    """(6, n) what of the states is the constant part of the biases of gyros and accelerometers, these without ``M_a f0``.

    Parameters
    ----------
    layout : Layout
    force : (3,) array, m/s^2
        ``f0``.
    """
    J = np.zeros((6, layout.states))
    J[:, BG.start : BA.stop] = np.eye(6)
    if (own := layout.slice_of(ACCEL_AXES)) is not None:
        for i in range(3):
            J[3 + i, own.start + 3 * i : own.start + 3 * i + 3] = -np.asarray(force)
    return J


def known_as_bias(P: Array, values: Array, group: Group, first: int, constant: ArrayLike | None) -> tuple[Array, Array]:
    """Covariance and values at the start, where ``M_a f0`` is part of the accelerometer bias.

    Parameters
    ----------
    P : (n, n) array
        Of all states, the matrix independent of the others.
    values : (n,) array
    group : Group
        :data:`ACCEL_AXES`.
    first : int
        Its first state.
    constant : (3,) array or None, (m/s^2)^2
        Variance a priori of the constant bias, ``M_a f0`` included, of which P says what is left. None: P is of the bias
        proper, which knows nothing of the matrix.
    """
    own, variance = slice(first, first + 9), np.square(group.sigma)
    tie = np.zeros((9, 3))  # covariance of the matrix with M f0
    for i in range(3):
        tie[3 * i : 3 * i + 3, i] = variance[3 * i : 3 * i + 3] * group.figures[:3]
    acting = np.array([tie[3 * i : 3 * i + 3, i] @ group.figures[:3] for i in range(3)])
    P, values = P.copy(), values.copy()
    if constant is None:
        P[BA, BA] += np.diag(acting)
        P[own, BA], P[BA, own] = tie, tie.T
        return P, values
    prior = np.maximum(constant, acting)
    gain = tie / np.where(prior > 0.0, prior, 1.0)
    values[own] = gain @ values[BA]
    P[own] = gain @ P[BA]
    P[:, own] = P[own].T
    P[own, own] = np.diag(variance) - gain @ (np.diag(prior) - P[BA, BA]) @ gain.T
    return P, values
