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

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_quaternion, dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.earth import earth_rate_n, transport_rate_n
from truenorth.errors.bending import BENDING
from truenorth.errors.master import ARM, DELAY, FILTER, MOUNTING
from truenorth.errors.walks import Walks
from truenorth.estimate.loop import SAME_TIME
from truenorth.records import ImuRecord
from truenorth.state.layout import ACCEL_AXES, BA, BG, GYRO_AXES, PHI
from truenorth.state.track import Track
from truenorth.strapdown.increments import increments, interval_lengths
from truenorth.strapdown.inertial_integration import integrate_attitude

Array = NDArray[np.float64]

LINEAR = 0.02  # rad: of an attitude to linearise with, one sigma
CONSTANTS = (
    DELAY,
    FILTER,
    ARM,
    MOUNTING,
    GYRO_AXES,
    ACCEL_AXES,
    BENDING,
)  # groups of what does not change in a log, or hardly


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

    def with_states(self, count: int) -> Nominal:
        """The same with so many states: those behind its own are assumed to be zero."""
        return replace(self, values=np.concatenate([self.values, np.zeros(count - len(self.values))]))

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
    until = begin + carried_for(slave, model)
    last = max(1, int(np.searchsorted(track.time, until)))
    values = np.zeros(track.sensors.shape[1])
    for part in (BG, BA):
        values[part] = track.sensors[last - 1, part]
    for name in CONSTANTS:
        if (at := track.layout.slice_of(name)) is not None:
            values[at] = track.sensors[-1, at]
    return Nominal(carried_back(slave, track[:last]).begin, values, until)


def carried_for(slave: ImuRecord, model: Walks) -> float:
    """How long, s, gyros carry an attitude before their noise is `LINEAR`; the length of the log at the most."""
    walk, rate_walk = model.gyro_random_walk, model.gyro_rate_walk
    t = np.linspace(0.0, float(slave.time[-1] - slave.time[0] + slave.steps[0]), 1001)
    return float(t[np.searchsorted(walk**2 * t + rate_walk**2 * t**3 / 3.0, LINEAR**2, side="right") - 1])


class Carried(NamedTuple):
    """The attitude of a track carried back by the gyros, biases and axes as found taken off."""

    C_nb: Array  # (K, 3, 3) at each row
    begin: Array  # (3, 3) at the beginning of the record
    C_n0: Array  # (K, 3, 3) axes of the body at the beginning, as the gyros carry them, to those of n at each row
    q: Array  # (N + 1, 4) attitude in the axes of the beginning, there and at the end of each sample

    def at(self, slave: ImuRecord, time: Array) -> Array:
        """(K, 3, 3) attitude at the samples nearest to other times, s, little off those of the rows."""
        begin = slave.time[0] - slave.steps[0]
        nearest = np.clip(np.searchsorted(slave.time, time - 0.5 * slave.interval) + (time > begin), 0, len(slave))
        return np.asarray(self.C_n0 @ dcm_from_quaternion(self.q[nearest]))


def final_attitudes(slave: ImuRecord, track: Track) -> Array:
    """(K, 3, 3) the final attitude carried back to each row by the gyros."""
    return carried_back(slave, track).C_nb


def carried_back(slave: ImuRecord, track: Track, longest: float = math.inf) -> Carried:
    """The final attitude carried back to each row, and to the beginning of the record.

    Of a log longer than gyros carry an attitude (`longest`, s), in pieces, each from what the track has found by its end.
    """
    dtheta, _ = increments(slave)
    ends, steps_of = slave.time, interval_lengths(slave)
    start, longest = float(ends[0] - steps_of[0]), max(longest, slave.interval)
    piece, of_sample = (((times - start - SAME_TIME) // longest).astype(np.intp) for times in (track.time, ends))
    row = np.searchsorted(piece, piece, side="right") - 1  # the last of its piece
    of_sample = row[np.minimum(np.searchsorted(piece, of_sample), len(row) - 1)]
    axes = track.layout.slice_of(GYRO_AXES)
    M = np.zeros((3, 3)) if axes is None else track.sensors[-1, axes].reshape(3, 3)
    dtheta = dtheta - track.sensors[of_sample, BG] * steps_of[:, None]
    dtheta = dtheta - dtheta @ M.T
    # The sample that each row falls into, and how much of it is past by then.
    inside = np.clip(np.searchsorted(ends, track.time - SAME_TIME), 0, len(ends) - 1)
    part = 1.0 - (ends[inside] - track.time) / steps_of[inside]
    q = integrate_attitude(dtheta)
    C_0b = dcm_from_quaternion(q[inside]) @ dcm_from_rotation_vector(part[:, None] * dtheta[inside])
    lat, alt, v = track.position[:, 0], track.position[:, 2], track.v_n
    w_in = earth_rate_n(lat) + transport_rate_n(lat, alt, v)
    turned = np.cumsum(w_in * np.diff(track.time, prepend=start)[:, None], axis=0)
    # Of n against its orientation at the end of the piece; the turn is small enough to be one about one axis.
    C_last_n = dcm_from_rotation_vector(np.vstack([turned[row] - turned, turned[row[:1]]]))
    C_i0 = track.C_nb[row] @ np.swapaxes(C_0b[row], 1, 2)
    C_n0 = C_last_n[:-1] @ C_i0
    return Carried(C_n0 @ C_0b, C_last_n[-1] @ C_i0[0], C_n0, q)
