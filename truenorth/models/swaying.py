"""Error model of an INS on a base that sways: that of a base that stays, its lever arm, and its motion as coloured states.

States behind the 12 of :mod:`truenorth.models.static`:

| slice | state | unit |
| --- | --- | --- |
| ARM | error of the lever arm r from the base's centre to the IMU, base axes | m |
| beyond | oscillators of the base's motion along E, N, U (:mod:`truenorth.models.disturbance`) | |

The velocity that the arm makes is a difference of attitudes, ``mean of v = (C_n0_b(t_k) - C_n0_b(t_{k-1})) r / T``: it needs
no angular rate. In ``n0``, since the INS velocity is one in an inertial frame: what the earth's turn adds, ``w_ie x C r``, follows
the sway. On an indexer the base's attitude is ``C_i_b = C_i_s C_s_b``, from the gyros and the encoder.

There are always as many states as the largest motion needs, the unused ones zero: one compiled filter serves all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.filters import LinearSystem
from truenorth.models.disturbance import AxisMotion
from truenorth.models.static import STATES
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation

Array = NDArray[np.float64]

ARM = slice(STATES, STATES + 3)
MOST_OSCILLATORS = 2  # along an axis
AXIS_STATES = 4 * MOST_OSCILLATORS
SWAYING_STATES = STATES + 3 + 3 * AXIS_STATES


def arm_rows(integrals: InertialIntegrals, C_n0_i: Array, lat: float, C_sb: Array | None = None) -> Array:
    """(K, 3, 3) mean velocity (E, N, U) of the IMU over each interval for an arm of 1 m along each base axis, 1/s.

    Parameters
    ----------
    integrals : InertialIntegrals
    C_n0_i : (3, 3) array
    lat : float, rad
    C_sb : (K+1, 3, 3) array, optional
        Attitude of the base in the IMU at the integrals' times; the two are one when left out.
    """
    C_ib = integrals.C_ib if C_sb is None else integrals.C_ib @ C_sb
    middle = (integrals.time[1:] + integrals.time[:-1]) / 2
    C_n_n0 = np.swapaxes(earth_rotation(middle, lat), 1, 2)
    rows: Array = C_n_n0 @ C_n0_i @ np.diff(C_ib, axis=0) / integrals.intervals[:, None, None]
    return rows


def without_sway(integrals: InertialIntegrals, C_sb: Array | None = None) -> InertialIntegrals:
    """The integrals with the base's sway averaged out of the attitude by which biases act; an indexer's turning stays.

    A bias seen from a base that sways makes a velocity of the sway's own periods, tenths of a mm/s of 100 ug. So do scale
    factors, a centre of rotation that is none, and the IMU's size: a filter that believed the signature of the bias would
    claim levels of arcseconds. What is left to tell a bias is its mean, and an indexer's modulation.

    Parameters
    ----------
    integrals : InertialIntegrals
    C_sb : (K+1, 3, 3) array, optional
        As in :func:`arm_rows`.
    """
    turned = None if C_sb is None else _half_way(C_sb)
    t = np.linspace(-1.0, 1.0, len(integrals.C_mean))
    basis, root = np.stack([np.ones_like(t), t], axis=1), np.sqrt(1.0 - t**2 + 1e-9)

    def slow(C: Array) -> Array:
        base = (C if turned is None else C @ turned).reshape(len(t), 9)
        coefficients = np.linalg.lstsq(root[:, None] * basis, root[:, None] * base, rcond=None)[0]
        mean = (basis @ coefficients).reshape(-1, 3, 3)
        return mean if turned is None else mean @ np.swapaxes(turned, 1, 2)

    return replace(integrals, C_mean=slow(integrals.C_mean), C_late=slow(integrals.C_late))


def _half_way(C: Array) -> Array:
    """(K, 3, 3) attitudes half way between K + 1 ones."""
    step = rotation_vector_from_dcm(C[1:] @ np.swapaxes(C[:-1], 1, 2))
    return dcm_from_rotation_vector(0.5 * step) @ C[:-1]


def with_arm(system: LinearSystem, rows: Array, arm: Array, covariance: Array) -> LinearSystem:
    """The system of a base that stays (12 states), with the lever arm as three more.

    Parameters
    ----------
    system : LinearSystem
    rows : (K, 3, 3) array
        Of :func:`arm_rows`.
    arm : (3,) array, m
        Whose velocity is taken off z; the states are the error of it, arm minus true.
    covariance : (3, 3) array, m^2
        Of the arm before the log, about zero error; zero where the arm is known.

    Returns
    -------
    LinearSystem
        Of 15 states.
    """
    grown = _grown(system, ARM.stop)
    grown["Phi"][:, ARM, ARM] = np.eye(3)
    grown["H"][:, :, ARM] = -rows
    grown["P0"][ARM, ARM] = covariance
    return replace(system, **grown, z=system.z - rows @ arm)


def with_motion(system: LinearSystem, interval: float, motion: Sequence[AxisMotion]) -> LinearSystem:
    """The system with the motion of its base as states.

    Parameters
    ----------
    system : LinearSystem
        Of 15 states, without any variance of the base's motion in R.
    interval : float, s
    motion : three AxisMotion
        Along E, N, U.

    Returns
    -------
    LinearSystem
        Of 39 states.
    """
    grown = _grown(system, SWAYING_STATES)
    white = np.zeros(3)
    for axis, item in enumerate(motion):
        first = ARM.stop + axis * AXIS_STATES
        part = slice(first, first + item.states)
        Phi, Q, P, h = item.blocks(interval)
        grown["Phi"][:, part, part], grown["Q"][:, part, part] = Phi, Q
        grown["P0"][part, part], grown["H"][:, axis, part] = P, h
        white[axis] = item.white
    return replace(system, **grown, R=system.R + np.diag(white**2))


def _grown(system: LinearSystem, n: int) -> dict[str, Array]:
    """Arrays of a system with more states, zero so far."""
    K, old, rows = len(system.z), system.states, system.rows
    shapes = {"Phi": (K, n, n), "Q": (K, n, n), "H": (K, rows, n), "S": (K, n, rows), "P0": (n, n), "x0": (n,)}
    arrays = {name: np.zeros(shape) for name, shape in shapes.items()}
    own = slice(0, old)
    arrays["Phi"][:, own, own], arrays["Q"][:, own, own], arrays["H"][:, :, own] = system.Phi, system.Q, system.H
    arrays["P0"][own, own], arrays["x0"][own] = system.P0, system.x0
    if system.S is not None:
        arrays["S"][:, own] = system.S
    return arrays
