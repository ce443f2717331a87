"""Error model of an INS on a turntable that takes it from position to position.

The twelve states of :mod:`truenorth.models.static`, and what a turn brings to light, errors measured minus true:

| slice | state | unit |
| --- | --- | --- |
| GYRO_MATRIX | scale factors and misalignments of the gyros, ``w_hat = (I + M) w + eps``, by rows | 1 |
| ACCEL_MATRIX | the same of the accelerometers | 1 |
| ARM | place of the IMU from where the table's axes meet, body axes | m |

    phi' = -C_n0_b (eps + M_g w),   dv' = -g_n0 x phi + C_n0_b (nabla + M_a f),   z = dv + C_n_b (w x r)

A position tells the biases along its own axes only together with tilt and heading; another position breaks the tie, and the
turn between them is measured by the gyros, with an error of their scale factor times the turn.

Source: system 4, multi-position alignment; D. Goshen-Meskin, I. Y. Bar-Itzhack, Observability analysis of piece-wise constant
systems, part II: application to inertial navigation in-flight alignment, IEEE Trans. Aerospace and Electronic Systems 28, 1992.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.filters import LinearSystem
from truenorth.models import static
from truenorth.models.static import DV, PHI, StaticModel
from truenorth.records import ImuRecord
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation
from truenorth.strapdown.level import increments, inertial_integrals

Array = NDArray[np.float64]

GYRO_MATRIX = slice(12, 21)
ACCEL_MATRIX = slice(21, 30)
ARM = slice(30, 33)
STATES = 33


def linearise(
    model: StaticModel,
    record: ImuRecord,
    integrals: InertialIntegrals,
    C_n0_i: Array,
    lat: float,
    alt: float,
    P0: Array,
    R: Array,
    x0: Array,
) -> LinearSystem:
    """Stack the model over the K intervals of a log.

    Parameters
    ----------
    model : StaticModel
        Noise.
    record : ImuRecord
        As integrated: nominal errors taken off.
    integrals : InertialIntegrals
        Of that record.
    C_n0_i, lat, alt
        As in :meth:`truenorth.models.static.StaticModel.linearise`.
    P0 : (33, 33) array
    R : (K, 3) array, (m/s)^2
        Variance of the base's mean velocity over each interval (E, N, U).
    x0 : (33,) array

    Returns
    -------
    LinearSystem
    """
    n = static.STATES
    least = R.min(axis=0)
    core = model.linearise(integrals, C_n0_i, lat, alt, P0[:n, :n], least)
    T = integrals.intervals[:, None, None]
    gyro, accel = _moments(record, integrals)
    C_n_n0 = np.swapaxes(earth_rotation((integrals.time[1:] + integrals.time[:-1]) / 2, lat), 1, 2)
    force = core.Phi[:, DV, PHI] / T  # [f x], f the reaction to gravity

    K = len(T)
    Phi = np.tile(np.eye(STATES), (K, 1, 1))
    Phi[:, :n, :n] = core.Phi
    g0, g1, g2 = (C_n0_i @ moment.reshape(K, 3, 9) for moment in gyro)
    Phi[:, PHI, GYRO_MATRIX] = -g0
    Phi[:, DV, GYRO_MATRIX] = -force @ (T * g0 - g1)
    a0, a1 = (C_n0_i @ moment.reshape(K, 3, 9) for moment in accel)
    Phi[:, DV, ACCEL_MATRIX] = a0

    H = np.zeros((K, 3, STATES))
    H[:, :, :n] = core.H
    H[:, :, GYRO_MATRIX] = C_n_n0 @ (-force @ g2 / (2 * T))
    H[:, :, ACCEL_MATRIX] = C_n_n0 @ (-a1 / T)
    C_nb = np.swapaxes(earth_rotation(integrals.time, lat), 1, 2) @ C_n0_i @ integrals.C_ib
    H[:, :, ARM] = np.diff(C_nb, axis=0) / T
    Q, S = np.zeros((K, STATES, STATES)), np.zeros((K, STATES, 3))
    Q[:, :n, :n] = core.Q
    assert core.S is not None
    S[:, :n] = core.S
    return replace(core, Phi=Phi, Q=Q, H=H, R=core.R + (R - least)[:, None] * np.eye(3), S=S, x0=x0, P0=P0)


def without_errors(record: ImuRecord, bias: Array, gyro_matrix: Array, accel_matrix: Array) -> ImuRecord:
    """A record with biases (6,) and matrices (3, 3) of the sensors taken off, as increments."""
    dtheta, dvel = increments(record)
    steps = record.steps[:, None]
    gyro = (dtheta - steps * bias[:3]) @ np.asarray(np.linalg.inv(np.eye(3) + gyro_matrix)).T
    accel = (dvel - steps * bias[3:]) @ np.asarray(np.linalg.inv(np.eye(3) + accel_matrix)).T
    return replace(record, gyro=gyro, accel=accel, kind="increments")


def matrices(x: Array) -> tuple[Array, Array]:
    """``M_g``, ``M_a`` (3, 3) of a state (33,)."""
    return x[GYRO_MATRIX].reshape(3, 3), x[ACCEL_MATRIX].reshape(3, 3)


def _moments(record: ImuRecord, integrals: InertialIntegrals) -> tuple[list[Array], list[Array]]:
    """``int s^m C_ib e_i w_j ds`` of each interval for m = 0, 1, 2, and the same of the force; (K, 3, i, j) each."""
    dtheta, dvel = increments(record)
    steps = record.steps
    edges = np.concatenate(([0.0], np.cumsum(steps)))
    ends = np.searchsorted(edges, integrals.time - 0.5 * record.interval)
    last = int(ends[-1])
    C_after, _, _ = inertial_integrals(dtheta[:last], dvel[:last], steps[:last], np.arange(last + 1))
    C = 0.5 * (C_after[:-1] + C_after[1:])
    row = np.repeat(np.arange(len(ends) - 1), np.diff(ends))
    s = (edges[:last] + edges[1 : last + 1]) / 2 - integrals.time[row]
    starts = ends[:-1]

    def of(increment: Array, order: int) -> Array:
        weighted = increment[:last] * (s**order)[:, None]
        return np.stack([np.add.reduceat(C * weighted[:, None, None, j], starts, axis=0) for j in range(3)], axis=-1)

    return [of(dtheta, m) for m in range(3)], [of(dvel, m) for m in range(2)]
