"""Covariance of inertial-frame coarse alignment: what biases, random walks and the base's motion do to it.

Every method there is linear in small errors of integrated velocity and position, ``phi = sum_k G_v[k] dV[k] +
G_p[k] dP[k]``; here those errors are traced back to their causes. Random walks are sums of independent increments, so
that suffix sums of the gains do what a dense covariance of the whole log would.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.coarse.inertial import CoarseAttitude, latitude_gain
from truenorth.core.attitude import skew
from truenorth.errors.staying import StaticModel
from truenorth.strapdown.inertial import InertialIntegrals, gravity_velocity

Array = NDArray[np.float64]
TREND_DEGREE = 3  # errors of the INS are this smooth over a window; the rest is the base's motion


def bias_response(integrals: InertialIntegrals, C_n0_i: Array) -> tuple[Array, Array]:
    """Integrated velocity and position errors of unit biases, (K+1, 3, 6) each; columns gyro x, y, z, accelerometer x, y, z."""
    T = integrals.intervals[:, None, None]
    turned = _cumulative(T * (C_n0_i @ integrals.C_mean))  # int C_n0_b
    f = skew(integrals.mean_force @ C_n0_i.T)
    dv = np.concatenate([_cumulative(-T * (f @ (turned[1:] + turned[:-1]) / 2)), turned], axis=2)
    dp = _cumulative(T * (dv[1:] + dv[:-1]) / 2)
    return dv, dp


def base_velocity(integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float, last: float = np.inf) -> Array:
    """(K+1, 3) velocity of the base itself in ``n0``, m/s: what is left of the computed velocity above a smooth trend.

    Only the epochs of the `last` seconds, if that is less than the log.
    """
    v = integrals.velocity @ C_n0_i.T + gravity_velocity(integrals.time, lat, alt)
    kept = integrals.time >= integrals.time[-1] - last
    return detrended(integrals.time[kept], v[kept])


def own_motion(integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float, last: float = np.inf) -> Array:
    """(3,) RMS velocity of the base itself in ``n0``, m/s, in the `last` seconds."""
    moved = base_velocity(integrals, C_n0_i, lat, alt, last)
    return np.asarray(np.sqrt(np.mean(np.square(moved), axis=0)))


def detrended(time: Array, v: Array) -> Array:
    """`v` less its least-squares polynomial of degree 3 (or less, for a handful of epochs)."""
    degree = min(TREND_DEGREE, max(len(time) - 2, 0))
    basis = np.polynomial.legendre.legvander(2 * (time - time[0]) / (time[-1] - time[0]) - 1, degree)
    return v - basis @ np.linalg.lstsq(basis, v, rcond=None)[0]


def coarse_covariance(
    coarse: CoarseAttitude,
    integrals: InertialIntegrals,
    model: StaticModel,
    bias_covariance: Array,
    disturbance: Array,
) -> tuple[Array, Array]:
    """Covariance of the misalignment phi in ``n0`` (at the start), and the biases' part of it.

    Parameters
    ----------
    coarse : CoarseAttitude
    integrals : InertialIntegrals
    model : StaticModel
        Random walks.
    bias_covariance : (6, 6) array
        Of gyro and accelerometer biases.
    disturbance : (3,) array, m/s
        RMS velocity of the base at an instant (its position wanders by no more than that in a second or two).

    Returns
    -------
    covariance, floor : (3, 3) arrays, rad^2
    """
    return _propagate(
        coarse.velocity_gain, coarse.position_gain, coarse.C_n0_i, integrals, model, bias_covariance, disturbance
    )


def latitude_sigma(
    lat: float,
    alt: float,
    C_n0_i: Array,
    integrals: InertialIntegrals,
    model: StaticModel,
    bias_covariance: Array,
    disturbance: Array,
) -> float:
    """One-sigma (rad) of :func:`truenorth.coarse.estimate_latitude`, from the same causes as the attitude's.

    Parameters
    ----------
    lat, alt : float, rad and m
        The estimated latitude.
    C_n0_i : (3, 3) array
        The attitude found with it.
    integrals, model, bias_covariance, disturbance
        As in :func:`coarse_covariance`.
    """
    gain = latitude_gain(integrals, lat, alt)[:, None, :]
    variance, _ = _propagate(gain, np.zeros_like(gain), C_n0_i, integrals, model, bias_covariance, disturbance)
    return float(np.sqrt(variance[0, 0]))


def _propagate(
    Gv: Array,
    Gp: Array,
    C: Array,
    integrals: InertialIntegrals,
    model: StaticModel,
    bias_covariance: Array,
    disturbance: Array,
) -> tuple[Array, Array]:
    """Covariance (m, m) of ``sum_k (Gv[k] dV[k] + Gp[k] dP[k])`` with gains (K+1, m, 3), and the biases' part of it."""
    t, T = integrals.time, integrals.intervals
    dv, dp = bias_response(integrals, C)
    B = np.einsum("kab,kbc->ac", Gv, dv) + np.einsum("kab,kbc->ac", Gp, dp)
    floor = B @ bias_covariance @ B.T

    # Velocity random walk of interval j reaches dV_k fully and dP_k as (t_k - t_j) for all k > j.
    Gv_after, Gp_after = _suffix(Gv), _suffix(Gp)
    Gpt_after = _suffix(Gp * t[:, None, None])
    tj = t[:-1, None, None]
    walk = Gv_after + Gpt_after - tj * Gp_after
    noise = model.accel_random_walk**2 * np.einsum("j,jab,jcb->ac", T, walk, walk)
    # Angle random walk turns all later specific force: [V_k - V_j x] on dV_k, its integral on dP_k.
    Vx, Px = skew(integrals.velocity @ C.T), skew(integrals.position @ C.T)
    turn = _suffix(Gv @ Vx) - Gv_after @ Vx[:-1]
    turn += _suffix(Gp @ Px) - Gp_after @ Px[:-1] - (Gpt_after - tj * Gp_after) @ Vx[:-1]
    noise += model.gyro_random_walk**2 * np.einsum("j,jab,jcb->ac", T, turn, turn)
    # The base's motion: dV_k = d_k - d_0, dP_k = s_k - s_0 - d_0 t_k.
    D = np.diag(disturbance**2)
    first = Gv.sum(axis=0) + (Gp * t[:, None, None]).sum(axis=0)
    noise += np.einsum("kab,bc,kdc->ad", Gv[1:], D, Gv[1:]) + first @ D @ first.T
    noise += np.einsum("kab,bc,kdc->ad", Gp, D, Gp)
    return floor + noise, floor


def _cumulative(steps: Array) -> Array:
    return np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps, axis=0)])


def _suffix(gain: Array) -> Array:
    """Sum of ``gain[k]`` over k > j, for each interval j (its noise acts on all epochs after it)."""
    return np.cumsum(gain[:0:-1], axis=0)[::-1]
