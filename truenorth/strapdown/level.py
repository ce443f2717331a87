"""Strapdown mechanisation: increments to attitude, velocity and position in the local level frame (ENU), compiled.

Its counterpart in an inertial frame, which alignment needs, is :mod:`truenorth.strapdown.inertial_integration`; both are offered
here.

Sources: P. Savage, "Strapdown inertial navigation integration algorithm design", J. Guid. Control Dyn. 21 (1998),
parts 1 and 2; P. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems", 2nd ed. (2013),
sec. 5.3 and 5.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.attitude import (
    cross,
    normalised,
    quaternion_from_dcm,
    quaternion_from_rotation_vector,
    quaternion_product,
    rotate,
)
from truenorth.core.compiled import borrowing, compiled
from truenorth.core.errors import UsageError
from truenorth.records import ImuRecord
from truenorth.state.state import State
from truenorth.state.track import Track
from truenorth.strapdown.coning import Algorithm, coefficients, rotation_vector, update_sums, velocity_increment
from truenorth.strapdown.increments import increments, interval_lengths, last_rows, read_only
from truenorth.strapdown.inertial_integration import inertial_integrals, integrate_attitude
from truenorth.strapdown.wander import set_matrix

__all__ = [
    "Underway",
    "go_on",
    "increments",
    "inertial_integrals",
    "integrate_attitude",
    "mechanise",
    "underway",
]

Array = NDArray[np.float64]
Altitude = Literal["free", "fixed"]

VELOCITY, PLACE = slice(4, 7), slice(7, 10)  # in the vector of the motion, behind the quaternion

_normal_gravity_at = borrowing(earth.normal_gravity_at, forceinline=True)
_radii_at = borrowing(earth.radii_at, forceinline=True)


@dataclass(frozen=True)
class Underway:
    """Where a mechanisation stands between two chunks of a log.

    Not a :class:`truenorth.state.state.State`: a matrix made of the quaternion and back would not give the bits of one batch.
    """

    # (19,): quaternion ``q_nb``, velocity, place, mean acceleration over the last update, which extrapolates velocity to the
    # middle of the next, and the increments of the last sample, as of :func:`mechanise_increments`
    motion: Array
    biases: Array  # (6,) rad/s and m/s^2: of gyros and accelerometers, taken off
    # s; nominal sampling interval; None: that of the first record. Given, chunks have the bits of one batch however their
    # time stamps were rounded.
    interval: float | None = None
    # (M, 7): samples (interval, dtheta, dvel) that do not fill an update yet
    rest: Array = field(default_factory=lambda: np.zeros((0, 7)))
    before: ImuRecord | None = None  # the last rows of the record
    updates: int = 0  # since the last output


def underway(start: State, interval: float | None = None, before: ImuRecord | None = None) -> Underway:
    """A mechanisation at its beginning.

    Parameters
    ----------
    start : State
        At the beginning of the first row's interval; its biases are taken off.
    interval : float, s, optional
        Nominal, of the samples; that of the first record when left out.
    before : ImuRecord, optional
        The rows just before the start, which rates need to be integrated to third order from the first sample on.
    """
    motion = np.zeros(19)
    motion[:4], motion[VELOCITY], motion[PLACE] = (
        quaternion_from_dcm(start.C_nb),
        start.v_n,
        (start.lat, start.lon, start.alt),
    )
    rows = None if before is None else last_rows(before)
    return Underway(motion, np.concatenate([start.gyro_bias, start.accel_bias]), interval, before=rows)


class Options(TypedDict, total=False):
    """Of a mechanisation; see :func:`go_on`."""

    algorithm: Algorithm
    altitude: Altitude
    every: int


def mechanise(record: ImuRecord, start: State, **options: Unpack[Options]) -> Track:
    """Carry attitude, velocity and position on through a record.

    Coriolis, transport and gravity are taken at the middle of an update, extrapolated from the last one: of second
    order in the update interval. Singular at the poles, as the local level frame itself.

    Parameters
    ----------
    record : ImuRecord
        Without gaps: what an increment row after a gap has missed is missing from the answer.
    start : State
        At the beginning of the first row's interval; its biases are taken off.
    algorithm, altitude, every
        As of :func:`go_on`.

    Returns
    -------
    Track
        The motion at the outputs, without covariance.

    Raises
    ------
    UsageError
        As :func:`go_on`.
    """
    return go_on(record, underway(start), **options)[1]


def go_on(
    record: ImuRecord,
    state: Underway,
    *,
    algorithm: Algorithm = "previous",
    altitude: Altitude = "free",
    every: int = 1,
) -> tuple[Underway, Track]:
    """Take the next chunk of a log; the options are the same for all chunks.

    Parameters
    ----------
    record : ImuRecord
    state : Underway
        Left as it is.
    algorithm : {"previous", "1", "2", "3", "4"}
        Samples an update and their coning and sculling correction; "previous" updates at every sample, with the sample
        before it; "1" corrects nothing.
    altitude : {"free", "fixed"}
        Free vertical channel, or height held and vertical velocity zero (at sea).
    every : int
        Output after every so many updates; 1 is the full rate.

    Returns
    -------
    state : Underway
        After the last whole update, whether it was put out or not.
    track : Track

    Raises
    ------
    UsageError
        An algorithm that is not known; `altitude` neither free nor fixed; `every` below 1.
    DataError
        The record does not go on where the state's last chunk ended.
    """
    if altitude not in ("free", "fixed"):
        raise UsageError(f"altitude {altitude!r}; expected 'free' or 'fixed'")
    if every < 1:
        raise UsageError(f"every={every}; expected 1 (each update) or more")
    k, k_before = coefficients(algorithm)
    samples = len(k) + 1
    interval = record.interval if state.interval is None else state.interval
    rest = len(state.rest)
    dtheta, dvel = increments(record, state.before, interval)
    steps = interval_lengths(record, state.before, interval)
    if state.biases.any():
        taken = steps[:, None] * state.biases
        dtheta, dvel = dtheta - taken[:, :3], dvel - taken[:, 3:]
    if rest:
        steps = np.concatenate([state.rest[:, 0], steps])
        dtheta = np.vstack([state.rest[:, 1:4], dtheta])
        dvel = np.vstack([state.rest[:, 4:7], dvel])

    updates = len(steps) // samples
    outputs = (state.updates + updates) // every
    motion, C_nb, out = state.motion.copy(), np.empty((outputs, 3, 3)), np.empty((outputs, 6))
    data = (read_only(a) for a in (steps, dtheta, dvel, k))
    mechanise_increments(*data, k_before, altitude == "fixed", every, state.updates, motion, C_nb, out)

    done = updates * samples
    after = Underway(
        motion,
        state.biases,
        interval,
        rest=np.column_stack([steps[done:], dtheta[done:], dvel[done:]]),
        before=last_rows(record),
        updates=state.updates + updates - outputs * every,
    )
    # Row of the record with which the update of each output ends; the first ends in this record, never in the rest.
    ends = ((np.arange(outputs) + 1) * every - state.updates) * samples - 1 - rest
    return after, Track.of_motion(record.time[ends], C_nb, out[:, :3], out[:, 3:], state.biases)


@compiled
def mechanise_increments(
    steps: Any,
    dtheta: Any,
    dvel: Any,
    k: Any,
    k_before: float,
    fixed_altitude: bool,
    every: int,
    since_output: int,
    state: Any,
    C_nb: Any,
    out: Any,
) -> None:
    """The compiled loop of :func:`mechanise`: updates of attitude, velocity and position in place; nothing is checked.

    Parameters
    ----------
    steps : (N,) array, s
        Lengths of the samples' intervals; those of a last update that is not whole are left over.
    dtheta, dvel : (N, 3) arrays, rad and m/s
        Increments along the body's axes, biases taken off.
    k : (n-1,) array
        Weights of the cross products of an update's n samples (:func:`truenorth.strapdown.coning.coefficients`).
    k_before : float
        Weight of the product with the sample before the update.
    fixed_altitude : bool
        Height and vertical velocity are held.
    every : int
        Updates for each row of `out`.
    since_output : int
        Updates since the last one, from an earlier call.
    state : (19,) array
        Quaternion ``q_nb`` (scalar first), velocity east, north, up (m/s), latitude, longitude (rad), height (m), acceleration
        (m/s^2), last `dtheta` and `dvel`; overwritten with those at the end.
    C_nb : (M, 3, 3) array
        Attitude after every so many updates; written.
    out : (M, 6) array
        Velocity and place then; written.
    """
    samples = len(k) + 1
    q = (state[0], state[1], state[2], state[3])
    vE, vN, vU = state[4], state[5], state[6]
    lat, lon, alt = state[7], state[8], state[9]
    aE, aN, aU = state[10], state[11], state[12]
    a = (state[13], state[14], state[15])
    b = (state[16], state[17], state[18])
    w_ie = earth.EARTH_RATE
    j = 0
    for m in range(len(steps) // samples):
        start = m * samples
        T = 0.0
        for i in range(samples):
            T += steps[start + i]
        K, A, a = update_sums(dtheta, start, samples, k, k_before, a)
        L, B, b = update_sums(dvel, start, samples, k, k_before, b)
        phi = rotation_vector(K, A, a)
        dv_b = velocity_increment(K, A, a, L, B, b)

        # Half an interval on, where Coriolis, transport and gravity are taken.
        half = 0.5 * T
        mE, mN, mU = vE + half * aE, vN + half * aN, vU + half * aU
        mid_lat = lat + half * vN / earth.SEMI_MAJOR  # to 1 % of half a step: millimetres
        mid_alt = alt + half * vU
        sin_lat, cos_lat = math.sin(mid_lat), math.cos(mid_lat)
        R_M, R_N = _radii_at(sin_lat * sin_lat)
        wieN, wieU = w_ie * cos_lat, w_ie * sin_lat
        wenE = -mN / (R_M + mid_alt)
        wenN = mE / (R_N + mid_alt)
        wenU = wenN * sin_lat / cos_lat
        zeta = (wenE * T, (wieN + wenN) * T, (wieU + wenU) * T)  # rotation vector of n

        # Specific force into n half way through n's own turn: (I - [zeta x]/2) C_nb dv.
        f = rotate(q, dv_b)
        turn = cross(zeta, f)
        coriolis = cross((wenE, 2.0 * wieN + wenN, 2.0 * wieU + wenU), (mE, mN, mU))
        dE = f[0] - 0.5 * turn[0] - coriolis[0] * T
        dN = f[1] - 0.5 * turn[1] - coriolis[1] * T
        dU = f[2] - 0.5 * turn[2] - (coriolis[2] + _normal_gravity_at(sin_lat * sin_lat, mid_alt)) * T
        if fixed_altitude:
            dU = -vU
        aE, aN, aU = dE / T, dN / T, dU / T

        # Position by the trapezoid of velocity.
        lat += (vN + 0.5 * dN) * T / (R_M + mid_alt)
        lon += (vE + 0.5 * dE) * T / ((R_N + mid_alt) * cos_lat)
        if not fixed_altitude:
            alt += (vU + 0.5 * dU) * T
        vE += dE
        vN += dN
        vU += dU

        # q_nb <- exp(-zeta) q_nb exp(phi)
        turned = quaternion_product(q, quaternion_from_rotation_vector(phi))
        back = quaternion_from_rotation_vector((-zeta[0], -zeta[1], -zeta[2]))
        q = normalised(quaternion_product(back, turned))

        since_output += 1
        if since_output == every:
            since_output = 0
            set_matrix(q, C_nb[j])
            out[j, 0], out[j, 1], out[j, 2] = vE, vN, vU
            out[j, 3], out[j, 4], out[j, 5] = lat, lon, alt
            j += 1
    state[0], state[1], state[2], state[3] = q
    state[4], state[5], state[6] = vE, vN, vU
    state[7], state[8], state[9] = lat, lon, alt
    state[10], state[11], state[12] = aE, aN, aU
    state[13], state[14], state[15] = a
    state[16], state[17], state[18] = b
