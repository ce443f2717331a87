"""Analytic coarse alignment: TRIAD on the mean specific force and the mean angular rate of a still base.

Source: K. Britting, "Inertial Navigation Systems Analysis" (1971), sec. 9.2; errors: his eqs. 9-13 to 9-15, in our
signs the static limits ``phi_E = -nabla_N/g``, ``phi_N = nabla_E/g``, ``phi_U = -eps_E/(w_ie cos L) + phi_N tan L``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.coarse.wahba import triad
from truenorth.core.compiled import compiled
from truenorth.core.earth import EARTH_RATE, earth_rate_n, normal_gravity
from truenorth.records import ImuRecord
from truenorth.records.one_pass import BLOCKS, passed
from truenorth.records.vibration import cone_drift
from truenorth.strapdown.increments import in_blocks, read_only

Array = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Means:
    """Mean rate and specific force of a stretch of log, body axes, with the covariance of those means.

    Attributes
    ----------
    w_ib_b : (3,) array, rad/s
        Of the base: with the drift of the cones in which its axes tremble, which is not in the mean of the gyros.
    f_b : (3,) array, m/s^2
    w_covariance, f_covariance : (3, 3) arrays
        From the scatter of block means: noise and the base's own motion alike.
    """

    w_ib_b: Array
    f_b: Array
    w_covariance: Array
    f_covariance: Array


def means(record: ImuRecord) -> Means:
    """Mean rate and specific force of a record."""
    sums = passed(record).blocks if record.kind == "increments" else _integrated(record)
    blocks = len(sums)
    T, total = sums[:, :1], sums.sum(axis=0)
    w, f = sums[:, 1:4] / T, sums[:, 4:] / T
    return Means(
        w_ib_b=total[1:4] / total[0] + cone_drift(record),
        f_b=total[4:] / total[0],
        w_covariance=scatter_of(w) / blocks,
        f_covariance=scatter_of(f) / blocks,
    )


def _integrated(record: ImuRecord) -> Array:
    """Time, angle and velocity (B, 7) of blocks of a log of rates."""
    starts = np.linspace(0, len(record), min(BLOCKS, len(record)) + 1).astype(int)[:-1]
    sums, edges = np.zeros((len(starts), 7)), np.append(starts, len(record))
    for rows, dtheta, dvel in in_blocks(record):
        inside = np.clip(edges, rows.start, rows.stop) - rows.start
        _block_sums(read_only(record.steps[rows]), read_only(dtheta), read_only(dvel), inside, sums)
    return sums


def scatter_of(x: Array) -> Array:
    """Covariance (3, 3) of rows (B, 3) about their mean."""
    left = x - x.sum(axis=0) / len(x)
    return left.T @ left / (len(x) - 1)


@compiled
def _block_sums(steps: Any, dtheta: Any, dvel: Any, edges: Any, sums: Any) -> None:
    """Add time, angle and velocity of the rows between edges (B + 1,) to sums (B, 7)."""
    for b in range(len(sums)):
        T, w0, w1, w2, f0, f1, f2 = sums[b, 0], sums[b, 1], sums[b, 2], sums[b, 3], sums[b, 4], sums[b, 5], sums[b, 6]
        for k in range(edges[b], edges[b + 1]):  # seven sums that do not wait for each other
            T += steps[k]
            w0 += dtheta[k, 0]
            w1 += dtheta[k, 1]
            w2 += dtheta[k, 2]
            f0 += dvel[k, 0]
            f1 += dvel[k, 1]
            f2 += dvel[k, 2]
        sums[b, 0], sums[b, 1], sums[b, 2], sums[b, 3], sums[b, 4], sums[b, 5], sums[b, 6] = T, w0, w1, w2, f0, f1, f2


def static_jacobian(lat: float, g: float) -> Array:
    """Misalignment for errors of specific force and rate in n, (3, 6): ``phi = J [nabla_n, eps_n]`` (the static limits)."""
    J = np.zeros((3, 6))
    J[0, 1] = -1.0 / g
    J[1, 0] = 1.0 / g
    J[2, 3] = -1.0 / (EARTH_RATE * np.cos(lat))
    J[2, 0] = np.tan(lat) / g
    return J


def analytic(m: Means, lat: float, alt: float, P_bias: Array) -> tuple[Array, Array, Array]:
    """Attitude of a still base from the means.

    Parameters
    ----------
    m : Means
    lat, alt : float, rad and m
    P_bias : (6, 6) array
        Covariance of gyro and accelerometer bias, body axes.

    Returns
    -------
    C_nb : (3, 3) array
    covariance, floor : (3, 3) arrays, rad^2
        Of the misalignment; the floor holds the biases alone.
    """
    C_nb = triad(m.f_b, m.w_ib_b, UP, np.asarray(earth_rate_n(lat)))
    return C_nb, *static_covariance(C_nb, m, lat, alt, P_bias)


def static_covariance(C_nb: Array, m: Means, lat: float, alt: float, P_bias: Array) -> tuple[Array, Array]:
    """Covariance of the misalignment of an attitude from means, and its floor, (3, 3); arguments as for :func:`analytic`."""
    J = static_jacobian(lat, float(normal_gravity(lat, alt)))
    biases, noise = np.zeros((6, 6)), np.zeros((6, 6))
    for block, P_block, scatter in (
        (slice(0, 3), P_bias[3:, 3:], m.f_covariance),
        (slice(3, 6), P_bias[:3, :3], m.w_covariance),
    ):
        biases[block, block] = C_nb @ P_block @ C_nb.T
        noise[block, block] = C_nb @ scatter @ C_nb.T
    return J @ (biases + noise) @ J.T, J @ biases @ J.T


def two_position(
    first: Means, second: Means, C_b1_b2: Array, lat: float, gyro_bias: float, accel_bias: float
) -> tuple[Array, Array, Array]:
    """Attitude and biases from two still positions of one IMU, between which it was turned.

    In each position ``m_k = C_bk_b1 u + bias``, with the earth's vector ``u`` in the first body frame: least squares
    for `u` and `bias`, the bias's specification as its prior. A turn of 180 deg about the vertical separates the
    horizontal components of both.

    Parameters
    ----------
    first, second : Means
    C_b1_b2 : (3, 3) array
        The turn between them, from the gyros or the turntable.
    lat : float, rad
    gyro_bias, accel_bias : float
        Prior one-sigma of the biases, rad/s and m/s^2.

    Returns
    -------
    C_nb1 : (3, 3) array
        Attitude in the first position.
    gyro_bias, accel_bias : (3,) arrays
    """
    w_b, eps = _separate(first.w_ib_b, second.w_ib_b, first.w_covariance, second.w_covariance, C_b1_b2, gyro_bias)
    f_b, nabla = _separate(first.f_b, second.f_b, first.f_covariance, second.f_covariance, C_b1_b2, accel_bias)
    return triad(f_b, w_b, UP, np.asarray(earth_rate_n(lat))), eps, nabla


def _separate(m1: Array, m2: Array, P1: Array, P2: Array, C_b1_b2: Array, prior: float) -> tuple[Array, Array]:
    eye, zero = np.eye(3), np.zeros((3, 3))
    A = np.block([[eye, eye], [C_b1_b2.T, eye], [zero, eye]])
    tiny = (1e-6 * prior) ** 2 * eye  # keeps the weights finite where the scatter is nil
    W = np.zeros((9, 9))
    for k, P in enumerate((P1 + tiny, P2 + tiny, prior**2 * eye)):
        W[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = np.linalg.inv(P)
    solution = np.linalg.solve(A.T @ W @ A, A.T @ W @ np.concatenate([m1, m2, np.zeros(3)]))
    return solution[:3], solution[3:]
