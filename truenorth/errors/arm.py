"""The lever arm from a base's centre of rotation to the IMU, as states of a base that stays: true minus nominal, base axes, m.

The velocity that the arm makes is a difference of attitudes, ``mean of v = (C_n0_b(t_k) - C_n0_b(t_{k-1})) r / T``: it needs
no angular rate. In ``n0``, since the INS velocity is one in an inertial frame: what the earth's turn adds, ``w_ie x C r``, follows
the sway. On an indexer the base's attitude is ``C_i_b = C_i_s C_s_b``, from the gyros and the encoder.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.staying import grown, local_axes
from truenorth.filters import LinearSystem
from truenorth.strapdown.inertial import InertialIntegrals

Array = NDArray[np.float64]


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
    rows: Array = local_axes(integrals.time, lat) @ C_n0_i @ np.diff(C_ib, axis=0) / integrals.intervals[:, None, None]
    return rows


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
