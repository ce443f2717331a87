"""Error model of an INS on a base that sways: that of a base that stays, its lever arm, and its motion as coloured states.

States behind the 12 of :mod:`truenorth.models.static`:

* the lever arm r from the base's centre of rotation to the IMU, base axes: true minus nominal, m
* oscillators of the base's motion along E, N, U (:mod:`truenorth.models.disturbance`)

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
from truenorth.models.static import QUIETEST_BASE, grown
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation

Array = NDArray[np.float64]

MOST_OSCILLATORS = 2  # along an axis
AXIS_STATES = 4 * MOST_OSCILLATORS


def arm_rows(integrals: InertialIntegrals, C_n0_i: Array, lat: float, C_sb: Array | None = None) -> Array:
    """(K, 3, 3) mean velocity (E, N, U) of the IMU over each interval for an arm of 1 m along each base axis, 1/s.

    Parameters
    ----------
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
    factors, no real centre of rotation, and the IMU's size: a filter that believed the signature of the bias would
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


def with_arm(system: LinearSystem, rows: Array, arm: Array) -> LinearSystem:
    """The system of a base that stays, with the lever arm as three more states.

    Parameters
    ----------
    rows : (K, 3, 3) array
        Of :func:`arm_rows`.
    arm : (3,) array, m
        The nominal one, whose velocity is taken off z; the states are what the true one is beyond it.
    """
    n = system.states
    bigger = grown(system, n + 3)
    bigger["Phi"][:, n:, n:] = np.eye(3)
    bigger["H"][:, :, n:] = rows
    return replace(system, **bigger, z=system.z - rows @ arm)


def with_motion(system: LinearSystem, interval: float, motion: Sequence[AxisMotion]) -> LinearSystem:
    """The system with the motion of its base as states.

    Parameters
    ----------
    system : LinearSystem
        Whose R holds the variance of the quietest base.
    interval : float, s
    motion : three AxisMotion
        Along E, N, U; none quieter than that.

    Returns
    -------
    LinearSystem
        Of 24 more states.
    """
    n = system.states
    bigger = grown(system, n + 3 * AXIS_STATES)
    white = np.zeros(3)
    for axis, item in enumerate(motion):
        first = n + axis * AXIS_STATES
        part = slice(first, first + item.states)
        Phi, Q, P, h = item.blocks(interval)
        bigger["Phi"][:, part, part], bigger["Q"][:, part, part] = Phi, Q
        bigger["P0"][part, part], bigger["H"][:, axis, part] = P, h
        white[axis] = item.white
    return replace(system, **bigger, R=system.R + np.diag(white**2 - QUIETEST_BASE**2))
