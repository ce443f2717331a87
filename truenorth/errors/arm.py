"""The lever arm from a base's centre of rotation to the IMU, as states of a base that stays: true minus nominal, base axes, m.

The velocity that the arm makes is a difference of attitudes, ``mean of v = (C_n0_b(t_k) - C_n0_b(t_{k-1})) r / T``: it needs
no angular rate. In ``n0``, since the INS velocity is one in an inertial frame: what the earth's turn adds, ``w_ie x C r``, follows
the sway. On an indexer the base's attitude is ``C_i_b = C_i_s C_s_b``, from the gyros and the encoder.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.staying import grown, local_axes
from truenorth.filters import LinearSystem
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation

Array = NDArray[np.float64]

SLOWEST_SEA = 30.0  # s: the longest swell; a ship's lines let her swing more slowly


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


def slow_arm_rows(integrals: InertialIntegrals, C_n0_i: Array, lat: float, C_sb: Array | None = None) -> Array:
    """(K, 3, 2) mean velocity (E, N, U) that the slow part of the heading makes, for an arm of 1 m right and forward, 1/s.

    A ship on her lines turns slowly about another point than the one about which the sea rolls her: the sea also carries her
    to and fro in step with roll and yaw, which moves the point about which she seems to turn by tens of metres. What is slower than
    `SLOWEST_SEA` is fitted by cosines, and by a cubic, which takes the slopes at both ends that no cosine has.

    Parameters
    ----------
    integrals, C_n0_i, lat, C_sb
        As of :func:`arm_rows`.
    """
    C_ib = integrals.C_ib if C_sb is None else integrals.C_ib @ C_sb
    slow = slow_heading(C_ib, integrals.time, C_n0_i, lat)
    c, s, zero = np.cos(slow), np.sin(slow), np.zeros_like(slow)
    place = np.stack([np.stack([c, s], axis=1), np.stack([-s, c], axis=1), np.stack([zero, zero], axis=1)], axis=1)
    return np.asarray(np.diff(place, axis=0) / integrals.intervals[:, None, None])


def slow_heading(C_ib: Array, time: Array, C_n0_i: Array, lat: float) -> Array:
    """(K,) what is slower than the sea in the heading of attitudes (K, 3, 3) at times, rad: clockwise, as headings go."""
    C_nb = np.swapaxes(earth_rotation(time, lat), 1, 2) @ C_n0_i @ C_ib
    heading = np.unwrap(np.arctan2(C_nb[:, 0, 1], C_nb[:, 1, 1]))
    part = (time - time[0]) / (time[-1] - time[0])
    count = math.ceil(2.0 * (time[-1] - time[0]) / SLOWEST_SEA)
    basis = np.column_stack([part**k for k in range(4)] + [np.cos(np.pi * np.outer(part, np.arange(1, count)))])
    return np.asarray(basis @ np.linalg.lstsq(basis, heading, rcond=None)[0])


def with_arm(system: LinearSystem, rows: Array, arm: Array) -> LinearSystem:
    """The system of a base that stays, with the lever arm as so many more states.

    Parameters
    ----------
    rows : (K, 3, p) array
        Of :func:`arm_rows`, or of :func:`slow_arm_rows`.
    arm : (p,) array, m
        The nominal one, whose velocity is taken off z; the states are what the true one is beyond it.
    """
    n = system.states
    bigger = grown(system, n + len(arm))
    bigger["Phi"][:, n:, n:] = np.eye(len(arm))
    bigger["H"][:, :, n:] = rows
    return system.with_made(**bigger, z=system.z - rows @ arm)
