"""Strapdown integration in an inertial frame, which knows nothing of the earth: attitude, velocity, position; compiled.

Frame ``i`` is the body's at the first sample. Source: P. Savage, "Strapdown inertial navigation integration algorithm
design", J. Guid. Control Dyn. 21 (1998), parts 1 and 2.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import (
    SMALL_ANGLE_SQUARED,
    normalised,
    quaternion_from_rotation_vector,
    quaternion_of_small,
    quaternion_product,
    rotate,
)
from truenorth.core.compiled import borrowing, compiled
from truenorth.core.errors import UsageError
from truenorth.core.vectors import load3, load4, minus4, store4, times4, transposed4
from truenorth.strapdown.coning import (
    Algorithm,
    coefficients,
    rotation_vector,
    update_sums,
    velocity_increment,
    velocity_of_small,
)
from truenorth.strapdown.increments import read_only

Array = NDArray[np.float64]
END = 1.0 / 12.0  # of Euler and Maclaurin's end correction
ROWS = 64  # worked on at once
SURELY_SMALL = 0.9 * SMALL_ANGLE_SQUARED  # rad^2: coning adds less to the angle of a row


def integrate_attitude(dtheta: ArrayLike, q0: ArrayLike | None = None, algorithm: Algorithm = "previous") -> Array:
    """Attitude in an inertial frame after each update, attitude alone.

    Parameters
    ----------
    dtheta : (N, 3) array, rad
    q0 : (4,) array, optional
        Initial attitude ``q_ib``, scalar first; identity when left out.
    algorithm : {"previous", "1", "2", "3", "4"}

    Returns
    -------
    (N // samples + 1, 4) array
        The initial one first; samples that do not fill an update are left out.
    """
    k, k_before = coefficients(algorithm)
    rows = read_only(dtheta)
    out = np.empty((len(rows) // (len(k) + 1) + 1, 4))
    out[0] = (1.0, 0.0, 0.0, 0.0) if q0 is None else q0
    _integrate_attitude(rows, read_only(k), k_before, out)
    return out


@compiled
def _integrate_attitude(dtheta: Any, k: Any, k_before: float, out: Any) -> None:
    samples = len(k) + 1
    q = (out[0, 0], out[0, 1], out[0, 2], out[0, 3])
    a = (0.0, 0.0, 0.0)
    for m in range(len(dtheta) // samples):
        K, A, a = update_sums(dtheta, m * samples, samples, k, k_before, a)
        phi = rotation_vector(K, A, a)
        q = normalised(quaternion_product(q, quaternion_from_rotation_vector(phi)))
        out[m + 1, 0], out[m + 1, 1], out[m + 1, 2], out[m + 1, 3] = q


def inertial_integrals(
    dtheta: ArrayLike,
    dvel: ArrayLike,
    steps: ArrayLike,
    epochs: ArrayLike,
    gyro_bias: ArrayLike = (0.0, 0.0, 0.0),
    accel_bias: ArrayLike = (0.0, 0.0, 0.0),
) -> tuple[Array, Array, Array]:
    """Attitude, and first and second integral of specific force, in the inertial frame of the body at the start.

    Algorithm "previous": one sample an update, with the one before it. Position is the trapezoid of velocity with the
    end correction of Euler and Maclaurin, ``- T (f_k - f_{k-1})/12`` a step: the trapezoid alone loses ``(w T)^2/12`` of a ship's
    roll at an arm's end, tenths of a mm/s at 100 Hz, in step with the sway. The mean velocity between two epochs is the
    difference of their positions over their time.

    Parameters
    ----------
    dtheta, dvel : (N, 3) arrays, rad and m/s
    steps : (N,) array, s
    epochs : (K,) int array
        Ascending: outputs after this many rows (0 is the start).
    gyro_bias, accel_bias : (3,) arrays, rad/s and m/s^2
        Taken off each row.

    Returns
    -------
    C_ib : (K, 3, 3) array
    velocity : (K, 3) array, m/s
        ``int C_ib f_b dt`` since the start.
    position : (K, 3) array, m
        Its integral.
    """
    wanted = np.ascontiguousarray(epochs, dtype=np.int64)
    rows = read_only(dtheta)
    if wanted.size and (wanted[0] < 0 or wanted[-1] > len(rows) or np.any(np.diff(wanted) < 0)):
        raise UsageError(f"epochs are not ascending row counts between 0 and {len(rows)}")
    _, k_before = coefficients("previous")
    bias = np.concatenate([gyro_bias, accel_bias]).astype(np.float64)
    out = np.empty((len(wanted), 10))
    _inertial_integrals(rows, read_only(dvel), read_only(steps), wanted, bias, k_before, at_start(), out)
    return integrals_of(out)


def at_start() -> Array:
    """(19,) quaternion, velocity, position, last increments of angle and velocity, both in the body, and last step of velocity.

    A first step of velocity that is not known is NaN.
    """
    state = np.zeros(19)
    state[0], state[16:19] = 1.0, np.nan
    return state


def integrals_of(out: Array) -> tuple[Array, Array, Array]:
    """Attitude, velocity and position of rows (K, 10) that :func:`go_on` has written."""
    C_ib = np.empty((len(out), 3, 3))
    _directions(out, C_ib)
    return C_ib, out[:, 4:7].copy(), out[:, 7:].copy()


def go_on(dtheta: Array, dvel: Array, steps: Array, epochs: Array, bias: Array, state: Array, out: Array) -> None:
    """:func:`inertial_integrals` of the next rows: from `state`, which is moved on.

    To the bits of one batch where the rows before are a multiple of `ROWS`.

    Parameters
    ----------
    epochs : (K,) int array
        Ascending, counted from the first of these rows.
    bias : (6,) array
        Of gyros and accelerometers.
    state : (19,) array
        Of :func:`at_start`, or as the rows before left it.
    out : (K, 10) array
        Written.
    """
    _, k_before = coefficients("previous")
    _inertial_integrals(read_only(dtheta), read_only(dvel), read_only(steps), epochs, bias, k_before, state, out)


class _Rows(NamedTuple):
    """Rows that are worked on together, a column each; column 0 of those with one more is the row before."""

    own: Array  # (6, ROWS + 1): increments of angle and velocity without their biases
    turn: Array  # (4, ROWS): quaternion by which a row turns
    gain: Array  # (3, ROWS): velocity increment of a row, in the body before it, then in ``i``
    q: Array  # (4, ROWS + 1): attitude behind a row


@compiled
def _inertial_integrals(
    dtheta: Any, dvel: Any, steps: Any, epochs: Any, bias: Any, k_before: float, state: Any, out: Any
) -> None:
    """So many rows at once that what does not wait for the row before goes in vectors; attitude is made unit behind them."""
    w = _Rows(np.empty((6, ROWS + 1)), np.empty((4, ROWS)), np.empty((3, ROWS)), np.empty((4, ROWS + 1)))
    for i in range(4):
        w.q[i, 0] = state[i]
    for i in range(6):
        w.own[i, 0] = state[10 + i]
    done = 0  # epochs
    for first in range(0, len(dtheta), ROWS):
        count = min(ROWS, len(dtheta) - first)
        small = _take_biases_off(dtheta, dvel, steps, bias, first, count, w)
        _in_the_body(k_before, small, count, w)
        _turn(count, w)
        for k in range(count):
            f = rotate((w.q[0, k], w.q[1, k], w.q[2, k], w.q[3, k]), (w.gain[0, k], w.gain[1, k], w.gain[2, k]))
            w.gain[0, k], w.gain[1, k], w.gain[2, k] = f
        done = _add_up(steps, epochs, first, count, w, state, done, out)
        q = normalised((w.q[0, count], w.q[1, count], w.q[2, count], w.q[3, count]))
        w.q[0, 0], w.q[1, 0], w.q[2, 0], w.q[3, 0] = q
        for i in range(6):
            w.own[i, 0] = w.own[i, count]
    for i in range(4):
        state[i] = w.q[i, 0]
    for i in range(6):
        state[10 + i] = w.own[i, 0]
    for m in range(done, len(epochs)):
        for i in range(10):
            out[m, i] = state[i]


@borrowing(forceinline=True)
def _take_biases_off(dtheta: Any, dvel: Any, steps: Any, bias: Any, first: int, count: int, w: _Rows) -> bool:
    """Increments of rows from the first on, by columns; whether all turn by less than the series are good for."""
    large, whole = False, count - count % 4
    for k in range(0, whole, 4):
        T = load4(steps, (first + k,))
        for rows, own in ((dtheta, 0), (dvel, 3)):
            r = first + k
            turned = transposed4(
                load3(rows, (r, 0)), load3(rows, (r + 1, 0)), load3(rows, (r + 2, 0)), load3(rows, (r + 3, 0))
            )
            store4(w.own, (own, k + 1), minus4(turned[0], times4(bias[own], T)))
            store4(w.own, (own + 1, k + 1), minus4(turned[1], times4(bias[own + 1], T)))
            store4(w.own, (own + 2, k + 1), minus4(turned[2], times4(bias[own + 2], T)))
    for k in range(whole, count):
        for i in range(3):
            w.own[i, k + 1] = dtheta[first + k, i] - steps[first + k] * bias[i]
            w.own[3 + i, k + 1] = dvel[first + k, i] - steps[first + k] * bias[3 + i]
    for k in range(count):
        large |= w.own[0, k + 1] ** 2 + w.own[1, k + 1] ** 2 + w.own[2, k + 1] ** 2 > SURELY_SMALL
    return not large


@borrowing(forceinline=True)
def _in_the_body(k_before: float, small: bool, count: int, w: _Rows) -> None:
    """What each row turns by, and its velocity increment, in the body before it."""
    if small:
        for k in range(count):
            K, L, a, b = _sums(k_before, k, w)
            w.gain[0, k], w.gain[1, k], w.gain[2, k] = velocity_of_small(K, a, a, L, b, b)
            turn = quaternion_of_small(rotation_vector(K, a, a))
            w.turn[0, k], w.turn[1, k], w.turn[2, k], w.turn[3, k] = turn
        return
    for k in range(count):
        K, L, a, b = _sums(k_before, k, w)
        w.gain[0, k], w.gain[1, k], w.gain[2, k] = velocity_increment(K, a, a, L, b, b)
        turn = quaternion_from_rotation_vector(rotation_vector(K, a, a))
        w.turn[0, k], w.turn[1, k], w.turn[2, k], w.turn[3, k] = turn


@borrowing(forceinline=True)
def _sums(k_before: float, k: int, w: _Rows) -> Any:
    """``K, L, a, b`` of an update of one row, see :mod:`truenorth.strapdown.coning`."""
    K = (k_before * w.own[0, k], k_before * w.own[1, k], k_before * w.own[2, k])
    L = (k_before * w.own[3, k], k_before * w.own[4, k], k_before * w.own[5, k])
    a = (w.own[0, k + 1], w.own[1, k + 1], w.own[2, k + 1])
    return K, L, a, (w.own[3, k + 1], w.own[4, k + 1], w.own[5, k + 1])


@borrowing(forceinline=True)
def _turn(count: int, w: _Rows) -> None:
    """Attitude behind each row: by rounding it leaves the unit by 1e-16 a row."""
    q = (w.q[0, 0], w.q[1, 0], w.q[2, 0], w.q[3, 0])
    for k in range(count):
        q = quaternion_product(q, (w.turn[0, k], w.turn[1, k], w.turn[2, k], w.turn[3, k]))
        w.q[0, k + 1], w.q[1, k + 1], w.q[2, k + 1], w.q[3, k + 1] = q


@borrowing(forceinline=True)
def _add_up(steps: Any, epochs: Any, first: int, count: int, w: _Rows, state: Any, done: int, out: Any) -> int:
    """Velocity and position behind each row, and what is put out on the way: how many epochs are done."""
    vx, vy, vz, px, py, pz = state[4], state[5], state[6], state[7], state[8], state[9]
    fx, fy, fz = state[16], state[17], state[18]  # of the row before
    if math.isnan(fx):
        fx, fy, fz = w.gain[0, 0], w.gain[1, 0], w.gain[2, 0]
    j, k = done, 0
    while k < count:
        while j < len(epochs) and epochs[j] == first + k:
            out[j, 0], out[j, 1], out[j, 2], out[j, 3] = w.q[0, k], w.q[1, k], w.q[2, k], w.q[3, k]
            out[j, 4], out[j, 5], out[j, 6] = vx, vy, vz
            out[j, 7], out[j, 8], out[j, 9] = px, py, pz
            j += 1
        end = min(epochs[j] - first, count) if j < len(epochs) else count
        for r in range(k, end):
            T, x, y, z = steps[first + r], w.gain[0, r], w.gain[1, r], w.gain[2, r]
            px += (vx + 0.5 * x - END * (x - fx)) * T
            py += (vy + 0.5 * y - END * (y - fy)) * T
            pz += (vz + 0.5 * z - END * (z - fz)) * T
            fx, fy, fz = x, y, z
            vx += x
            vy += y
            vz += z
        k = end
    state[4], state[5], state[6], state[7], state[8], state[9] = vx, vy, vz, px, py, pz
    state[16], state[17], state[18] = fx, fy, fz
    return j


@compiled
def _directions(q: Any, C: Any) -> None:
    """``C = I + 2 w [v x] + 2 [v x]^2`` (M, 3, 3) of quaternions in the first four columns of rows (M, ..)."""
    for k in range(len(C)):
        w, x, y, z = 2.0 * q[k, 0], q[k, 1], q[k, 2], q[k, 3]
        C[k, 0, 0] = 1.0 + 2.0 * (-z * z - y * y)
        C[k, 1, 1] = 1.0 + 2.0 * (-z * z - x * x)
        C[k, 2, 2] = 1.0 + 2.0 * (-y * y - x * x)
        C[k, 0, 1], C[k, 1, 0] = -w * z + 2.0 * (x * y), w * z + 2.0 * (x * y)
        C[k, 0, 2], C[k, 2, 0] = w * y + 2.0 * (x * z), -w * y + 2.0 * (x * z)
        C[k, 1, 2], C[k, 2, 1] = -w * x + 2.0 * (y * z), w * x + 2.0 * (y * z)


def interval_means(C: Array, time: Array, parts: int) -> tuple[Array, Array]:
    """Means of a matrix over intervals, plain and weighted by the elapsed part: the trapezoid over the parts of each.

    Parameters
    ----------
    C : (K * parts + 1, 3, 3) array
        At the ends of the parts.
    time : (K * parts + 1,) array, s
    parts : int
        Of each interval.

    Returns
    -------
    mean, late : (K, 3, 3) arrays
        ``(1/T) int C ds`` and ``(1/T^2) int s C ds``.
    """
    shape = (len(C) - 1) // parts, 3, 3
    mean, late = np.zeros(shape), np.zeros(shape)
    _interval_means(np.ascontiguousarray(C), np.ascontiguousarray(time), parts, mean, late)
    return mean, late


@compiled
def _interval_means(C: Any, time: Any, parts: int, mean: Any, late: Any) -> None:
    for k in range(len(mean)):
        first = k * parts
        T = time[first + parts] - time[first]
        for s in range(first, first + parts + 1):
            before = time[s] - time[s - 1] if s > first else 0.0
            behind = time[s + 1] - time[s] if s < first + parts else 0.0
            weight = (0.5 * before + 0.5 * behind) / T
            elapsed = (time[s] - time[first]) / T
            for i in range(3):
                for j in range(3):
                    mean[k, i, j] += weight * C[s, i, j]
                    late[k, i, j] += weight * elapsed * C[s, i, j]
