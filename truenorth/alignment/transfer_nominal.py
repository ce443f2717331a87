"""The motion that a transfer alignment is linearised about: the slave as the whole log has found it, led back to the start.

A closed loop corrects the attitude about which it linearises. Before the first turn the heading and the biases of a consumer IMU
are wrong by degrees. Rows and transitions of that time are those of another attitude than later ones, and the covariance takes the
turning of its own columns for knowledge: of heading, of the arm, and of seat, gyros and accelerometers turned alike by `s` (slave
axes: ``M_g = M_a = [s x]``, ``dr = -s x r``, ``mu = C_mb s``, ``phi = C s``), which nothing shows. So the last passes feed nothing
back. They begin where the pass before leads back to, with its sensors, seat and delay, and with the *prior* covariance. What lies
between the start as it was given and this one is an error that is known at the start. That is Gauss and Newton's method on the
log, and the prior counts once. Of a log so long that what the gyros walk in it is no small angle the first part is open; then the
loop is closed.

Sources: B. Bell, "The iterated Kalman smoother as a Gauss-Newton method", SIAM J. Optimization 4 (1994); of the defect, G. Huang,
A. Mourikis, S. Roumeliotis, "Observability-based rules for designing consistent EKF SLAM estimators", Int. J. Robotics Research 29
(2010). That the motion is led back by the gyros, their noise left out, is ours: it is as good as they walk.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_quaternion, dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.earth import earth_rate_n, transport_rate_n
from truenorth.errors.master import ARM, DELAY, MOUNTING
from truenorth.errors.walks import Walks
from truenorth.estimate.loop import SAME_TIME
from truenorth.records import ImuRecord
from truenorth.state.layout import ACCEL_AXES, BA, BG, GYRO_AXES, PHI
from truenorth.state.track import Track
from truenorth.strapdown.increments import increments, interval_lengths
from truenorth.strapdown.inertial_integration import integrate_attitude

Array = NDArray[np.float64]

LINEAR = 0.02  # rad: of an attitude to linearise with, one sigma
CONSTANTS = (DELAY, ARM, MOUNTING, GYRO_AXES, ACCEL_AXES)  # groups of what does not change in a log, or hardly


@dataclass(frozen=True)
class Nominal:
    """How a motion of the slave begins, and what is assumed of its sensors, seat and delay."""

    C_nb: Array  # (3, 3) at the start
    values: Array  # (n,) in the places of the states
    until: float  # s: the loop is closed then

    def off(self, C_nb: Array, values: Array, mounting: slice | None) -> Array:
        """(n,) errors that it has where an attitude at the start and values (n,) are true, ENU."""
        off = values - self.values
        off[PHI] = rotation_vector_from_dcm(C_nb @ self.C_nb.T)
        if mounting is not None:
            seat, own = (dcm_from_rotation_vector(of[mounting]) for of in (values, self.values))
            off[mounting] = rotation_vector_from_dcm(seat @ own.T)
        return off

    def corrected(self, x: Array, mounting: slice | None) -> Nominal:
        """Without errors (n,) of it."""
        values = self.values + x
        values[PHI] = 0.0
        if mounting is not None:
            seat = dcm_from_rotation_vector(x[mounting]) @ dcm_from_rotation_vector(self.values[mounting])
            values[mounting] = rotation_vector_from_dcm(seat)
        return replace(self, C_nb=np.asarray(dcm_from_rotation_vector(x[PHI]) @ self.C_nb), values=values)


def found_by(slave: ImuRecord, track: Track, model: Walks) -> Nominal:
    """The motion that a track leads back to, from as late as the slave's gyros carry an attitude well."""
    begin = float(slave.time[0] - slave.steps[0])
    until = begin + _carried_for(model.gyro_random_walk, model.gyro_rate_walk, float(slave.time[-1]) - begin)
    last = max(1, int(np.searchsorted(track.time, until)))
    values = np.zeros(track.sensors.shape[1])
    for part in (BG, BA):
        values[part] = track.sensors[last - 1, part]
    for name in CONSTANTS:
        if (at := track.layout.slice_of(name)) is not None:
            values[at] = track.sensors[-1, at]
    return Nominal(carried_back(slave, track[:last]).begin, values, until)


def _carried_for(walk: float, rate_walk: float, longest: float) -> float:
    """How long, s, gyros (rad/sqrt(s), rad/s/sqrt(s)) carry an attitude before their noise is `LINEAR`; `longest` at the most."""
    t = np.linspace(0.0, longest, 1001)
    return float(t[np.searchsorted(walk**2 * t + rate_walk**2 * t**3 / 3.0, LINEAR**2, side="right") - 1])


class Carried(NamedTuple):
    """The final attitude of a track carried back by the gyros, the final biases and axes taken off."""

    C_nb: Array  # (K, 3, 3) at each row
    begin: Array  # (3, 3) at the beginning of the record
    C_n0: Array  # (K, 3, 3) axes of the body at the beginning to those of n at each row
    q: Array  # (N + 1, 4) attitude in the axes of the beginning, there and at the end of each sample


def final_attitudes(slave: ImuRecord, track: Track) -> Array:
    """(K, 3, 3) the final attitude carried back to each row by the gyros."""
    return carried_back(slave, track).C_nb


def carried_back(slave: ImuRecord, track: Track) -> Carried:
    """The final attitude carried back to each row, and to the beginning of the record."""
    dtheta, _ = increments(slave)
    axes = track.layout.slice_of(GYRO_AXES)
    M = np.zeros((3, 3)) if axes is None else track.sensors[-1, axes].reshape(3, 3)
    dtheta = dtheta - track.sensors[-1, BG] * interval_lengths(slave)[:, None]
    dtheta = dtheta - dtheta @ M.T
    # The sample that each row falls into, and how much of it is past by then.
    ends, steps_of = slave.time, interval_lengths(slave)
    inside = np.clip(np.searchsorted(ends, track.time - SAME_TIME), 0, len(ends) - 1)
    part = 1.0 - (ends[inside] - track.time) / steps_of[inside]
    q = integrate_attitude(dtheta)
    C_0b = dcm_from_quaternion(q[inside]) @ dcm_from_rotation_vector(part[:, None] * dtheta[inside])
    lat, alt, v = track.position[:, 0], track.position[:, 2], track.v_n
    w_in = earth_rate_n(lat) + transport_rate_n(lat, alt, v)
    steps = np.diff(track.time, prepend=ends[0] - steps_of[0])[:, None]
    turned = np.cumsum(w_in * steps, axis=0)
    # Of n against its last orientation; the turn is small enough to be one about one axis.
    since = np.vstack([turned[-1] - turned, turned[-1:]])
    C_last_n = dcm_from_rotation_vector(since)
    C_i0 = track.C_nb[-1] @ C_0b[-1].T
    C_n0 = C_last_n @ C_i0
    return Carried(C_n0[:-1] @ C_0b, C_n0[-1], C_n0[:-1], q)
