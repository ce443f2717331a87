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
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core import earth
from truenorth.core.attitude import (
    cross,
    dcm_from_quaternion,
    normalised,
    quaternion_from_dcm,
    quaternion_from_rotation_vector,
    quaternion_product,
    rotate,
)
from truenorth.core.compiled import borrowing, compiled
from truenorth.core.errors import UsageError
from truenorth.records import ImuRecord
from truenorth.strapdown.coning import Algorithm, coefficients, rotation_vector, update_sums, velocity_increment
from truenorth.strapdown.increments import increments, interval_lengths, last_rows, read_only
from truenorth.strapdown.inertial_integration import inertial_integrals, integrate_attitude

__all__ = [
    "Mechanisation",
    "NavigationState",
    "increments",
    "inertial_integrals",
    "integrate_attitude",
    "mechanise",
]

Array = NDArray[np.float64]

_normal_gravity_at = borrowing(earth.normal_gravity_at, forceinline=True)
_radii_at = borrowing(earth.radii_at, forceinline=True)


@dataclass(frozen=True)
class Memory:
    """What the algorithm remembers of the samples it has seen, besides the motion itself."""

    # (3,) m/s^2: mean of ``dv_n/dt`` over the last update: extrapolates velocity to the middle of the next
    acceleration: Array = field(default_factory=lambda: np.zeros(3))
    dtheta: Array = field(default_factory=lambda: np.zeros(3))  # (3,) rad: last sample of the last update
    dvel: Array = field(default_factory=lambda: np.zeros(3))  # (3,) m/s
    # (M, 7): samples (interval, dtheta, dvel) that do not fill an update yet
    rest: Array = field(default_factory=lambda: np.zeros((0, 7)))
    before: ImuRecord | None = None  # the last rows of the record
    updates: int = 0  # since the last output


@dataclass(frozen=True)
class NavigationState:
    """Where a mechanisation stands, and all it needs to go on.

    Correct the motion between chunks with :func:`dataclasses.replace`; the memory stays.
    """

    q_nb: Array  # (4,): attitude quaternion, scalar first
    v_n: Array  # (3,) m/s: East, north, up
    lat: float  # rad
    lon: float  # rad
    alt: float  # m
    # s; nominal sampling interval; None: that of the first record. Given, chunks have the bits of one batch however their
    # time stamps were rounded.
    interval: float | None = None
    memory: Memory = field(default_factory=Memory, repr=False)

    @classmethod
    def at(
        cls,
        C_nb: ArrayLike,
        lat: float,
        lon: float = 0.0,
        alt: float = 0.0,
        v_n: ArrayLike = (0.0, 0.0, 0.0),
        interval: float | None = None,
    ) -> NavigationState:
        """State to begin with, from an attitude matrix (3, 3)."""
        return cls(quaternion_from_dcm(C_nb), np.array(v_n, dtype=np.float64), lat, lon, alt, interval)

    @property
    def C_nb(self) -> Array:
        """(3, 3) attitude."""
        return dcm_from_quaternion(self.q_nb)


@dataclass(frozen=True)
class Mechanisation:
    """Computed motion at the output epochs."""

    time: Array  # (K,) s
    q_nb: Array  # (K, 4): attitude quaternion, scalar first
    v_n: Array  # (K, 3) m/s: East, north, up
    position: Array  # (K, 3): latitude, longitude (rad), height (m)
    state: NavigationState  # to go on from: after the last whole update, whether it was put out or not

    @property
    def C_nb(self) -> Array:
        """(K, 3, 3) attitude."""
        return dcm_from_quaternion(self.q_nb)


def mechanise(
    record: ImuRecord,
    state: NavigationState,
    *,
    algorithm: Algorithm = "previous",
    altitude: Literal["free", "fixed"] = "free",
    every: int = 1,
) -> Mechanisation:
    """Carry attitude, velocity and position on through a record.

    Coriolis, transport and gravity are taken at the middle of an update, extrapolated from the last one: of second
    order in the update interval. Singular at the poles, as the local level frame itself.

    Parameters
    ----------
    record : ImuRecord
        Without gaps: what an increment row after a gap has missed is missing from the answer.
    state : NavigationState
        At the beginning of the first row's interval, or what an earlier chunk ended with.
    algorithm : {"previous", "1", "2", "3", "4"}
        Samples an update and their coning and sculling correction; "previous" updates at every sample, with the sample
        before it; "1" corrects nothing.
    altitude : {"free", "fixed"}
        Free vertical channel, or height held and vertical velocity zero (at sea).
    every : int
        Output after every so many updates; 1 is the full rate.

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
    memory = state.memory
    interval = record.interval if state.interval is None else state.interval
    rest = len(memory.rest)
    dtheta, dvel = increments(record, memory.before, interval)
    steps = interval_lengths(record, memory.before, interval)
    if rest:
        steps = np.concatenate([memory.rest[:, 0], steps])
        dtheta = np.vstack([memory.rest[:, 1:4], dtheta])
        dvel = np.vstack([memory.rest[:, 4:7], dvel])

    updates = len(steps) // samples
    outputs = (memory.updates + updates) // every
    kernel = np.concatenate(
        [
            state.q_nb,
            state.v_n,
            [state.lat, state.lon, state.alt],
            memory.acceleration,
            memory.dtheta,
            memory.dvel,
        ]
    )
    out = np.empty((outputs, 10))
    data = (read_only(a) for a in (steps, dtheta, dvel, k))
    mechanise_increments(*data, k_before, altitude == "fixed", every, memory.updates, kernel, out)

    done = updates * samples
    after = NavigationState(
        q_nb=kernel[:4],
        v_n=kernel[4:7],
        lat=float(kernel[7]),
        lon=float(kernel[8]),
        alt=float(kernel[9]),
        interval=interval,
        memory=Memory(
            acceleration=kernel[10:13],
            dtheta=kernel[13:16],
            dvel=kernel[16:19],
            rest=np.column_stack([steps[done:], dtheta[done:], dvel[done:]]),
            before=last_rows(record),
            updates=memory.updates + updates - outputs * every,
        ),
    )
    # Row of the record with which the update of each output ends; the first ends in this record, never in the rest.
    ends = ((np.arange(outputs) + 1) * every - memory.updates) * samples - 1 - rest
    return Mechanisation(record.time[ends], out[:, :4], out[:, 4:7], out[:, 7:], after)


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
    out : (M, 10) array
        The first ten of these after every so many updates; written.
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
            out[j, 0], out[j, 1], out[j, 2], out[j, 3] = q
            out[j, 4], out[j, 5], out[j, 6] = vE, vN, vU
            out[j, 7], out[j, 8], out[j, 9] = lat, lon, alt
            j += 1
    state[0], state[1], state[2], state[3] = q
    state[4], state[5], state[6] = vE, vN, vU
    state[7], state[8], state[9] = lat, lon, alt
    state[10], state[11], state[12] = aE, aN, aU
    state[13], state[14], state[15] = a
    state[16], state[17], state[18] = b
