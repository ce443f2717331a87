"""Scale factors and misalignments of the sensors of an INS on a base that stays: what a turn brings to light.

    phi' = -C_n0_b (eps + M_g w),   dv' = -g_n0 x phi + C_n0_b (nabla + M_a f)

Eighteen states, ``M_g`` by rows and then ``M_a``, measured minus true: ``w_hat = (I + M_g) w + eps``.

Source: D. Goshen-Meskin, I. Y. Bar-Itzhack, Observability analysis of piece-wise constant systems, part II: application to
inertial navigation in-flight alignment, IEEE Trans. Aerospace and Electronic Systems 28, 1992.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.remembered import remembered
from truenorth.errors.staying import DV, PHI, grown, local_axes
from truenorth.filters import LinearSystem
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import increments
from truenorth.strapdown.inertial import InertialIntegrals, gravity_velocity
from truenorth.strapdown.inertial_integration import inertial_integrals

Array = NDArray[np.float64]

MATRICES = 18
Moments = tuple[list[Array], list[Array]]


def with_matrices(
    system: LinearSystem,
    moments: Moments,
    integrals: InertialIntegrals,
    C_n0_i: Array,
    lat: float,
) -> LinearSystem:
    """A system of :meth:`truenorth.errors.staying.StaticModel.linearise` with the matrices of both sensors as 18 more states.

    Parameters
    ----------
    moments : Moments
        By which the matrices act.
    integrals : InertialIntegrals
    C_n0_i : (3, 3) array
    lat : float, rad
    """
    T = integrals.intervals[:, None, None]
    gyro, accel = moments
    C_n_n0 = local_axes(integrals.time, lat)
    force = system.Phi[:, DV, PHI] / T  # [f x], f the reaction to gravity
    n, K = system.states, len(T)
    bigger = grown(system, n + MATRICES)
    M_g, M_a = slice(n, n + 9), slice(n + 9, n + 18)
    Phi, H = bigger["Phi"], bigger["H"]
    Phi[:, n:, n:] = np.eye(MATRICES)
    g0, g1, g2 = (C_n0_i @ moment.reshape(K, 3, 9) for moment in gyro)
    Phi[:, PHI, M_g] = -g0
    Phi[:, DV, M_g] = -force @ (T * g0 - g1)
    a0, a1 = (C_n0_i @ moment.reshape(K, 3, 9) for moment in accel)
    Phi[:, DV, M_a] = a0
    H[:, :, M_g] = C_n_n0 @ (-force @ g2 / (2 * T))
    H[:, :, M_a] = C_n_n0 @ (-a1 / T)
    return system.with_made(**bigger)


def smooth_moments(slow: InertialIntegrals, turns: Array, C_n0_i: Array, lat: float, alt: float) -> Moments:
    """What the matrices act by where a base does nothing but stay: an indexer's rate, and gravity's reaction.

    Parameters
    ----------
    slow : InertialIntegrals
        With the attitude by which biases act (:func:`truenorth.errors.sway.without_sway`).
    turns : (K, 3) array, rad
        Of the IMU in the base over each interval, the IMU's axes.
    C_n0_i : (3, 3) array
    lat, alt : float, rad and m

    Returns
    -------
    gyro, accel : lists of (K, 3, 3, 3) arrays
        ``int s^m C_ib e_i w_j ds`` of each interval for m = 0, 1, 2, and of the force for m = 0, 1.
    """
    T, C = slow.intervals[:, None], slow.C_mean
    f_n0 = -np.diff(gravity_velocity(slow.time, lat, alt), axis=0) / T
    f = np.einsum("kji,kj->ki", C_n0_i @ C, f_n0)

    def of(x: Array, order: int) -> Array:
        return np.einsum("kai,kj->kaij", C, x * T ** (order + 1) / (order + 1))

    return [of(turns / T, m) for m in range(3)], [of(f, m) for m in range(2)]


def without_errors(record: ImuRecord, bias: Array, gyro_matrix: Array, accel_matrix: Array) -> ImuRecord:
    """A record with biases (6,) and matrices (3, 3) of the sensors taken off, as increments."""
    dtheta, dvel = increments(record)
    steps = record.steps[:, None]
    gyro = (dtheta - steps * bias[:3]) @ np.asarray(np.linalg.inv(np.eye(3) + gyro_matrix)).T
    accel = (dvel - steps * bias[3:]) @ np.asarray(np.linalg.inv(np.eye(3) + accel_matrix)).T
    return replace(record, gyro=gyro, accel=accel, kind="increments")


def by_matrix(x: Array) -> Array:
    """(3, 9) ``M x`` by the nine elements of M, by rows."""
    return np.asarray(np.kron(np.eye(3), x), dtype=np.float64)


def matrices_of(x: Array) -> tuple[Array, Array]:
    """``M_g``, ``M_a`` (3, 3) of 18 states."""
    return x[:9].reshape(3, 3), x[9:].reshape(3, 3)


def known_moments(record: Callable[[], ImuRecord], integrals: InertialIntegrals) -> Moments:
    """:func:`moments_of` a record as integrated, nominal errors taken off; it is asked for once for the same integrals."""
    about = _about(integrals)
    if "moments" not in about:
        about["moments"] = moments_of(record(), integrals)
    return about["moments"]


@remembered
def _about(integrals: InertialIntegrals) -> dict[str, Moments]:
    """Moments of the last integrals: where only noise or motion are others, the log is linearised about the same ones."""
    return {}


def moments_of(
    record: ImuRecord, integrals: InertialIntegrals, context: int = 0, before: Array | None = None
) -> Moments:
    """``int s^m C_ib e_i w_j ds`` of each interval for m = 0, 1, 2, and the same of the force; (K, 3, i, j) each.

    Parameters
    ----------
    record : ImuRecord
    integrals : InertialIntegrals
        Of it; attitude and time begin with them.
    context : int
        Rows at its beginning that are before them.
    before : (3, 3) array, optional
        ``C_ib`` at their beginning; none where left out.
    """
    dtheta, dvel = (values[context:] for values in increments(record))
    steps = record.steps[context:]
    edges = np.concatenate(([0.0], np.cumsum(steps)))
    ends = np.searchsorted(edges, integrals.time - 0.5 * record.interval)
    last = int(ends[-1])
    C_after, _, _ = inertial_integrals(dtheta[:last], dvel[:last], steps[:last], np.arange(last + 1))
    C = 0.5 * (C_after[:-1] + C_after[1:])
    C = C if before is None else before @ C
    rows = np.diff(ends)
    row, longest = np.repeat(np.arange(len(rows)), rows), int(rows.max())
    s = ((edges[:last] + edges[1 : last + 1]) / 2 - integrals.time[row])[:, None]

    def by_interval(x: Array) -> Array:
        """Of rows (N, m) those of each interval, with zeros behind the shorter ones."""
        if int(rows.min()) == longest:
            return x.reshape(len(rows), longest, -1)
        whole = np.zeros((len(rows), longest, x.shape[1]))
        whole[row, np.arange(last) - ends[row]] = x
        return whole

    attitude = np.swapaxes(by_interval(C.reshape(-1, 9)), 1, 2)

    def of(increment: Array, order: int) -> Array:
        return np.asarray(attitude @ by_interval(increment[:last] * s**order)).reshape(-1, 3, 3, 3)

    return [of(dtheta, m) for m in range(3)], [of(dvel, m) for m in range(2)]
