"""Strapdown mechanisation: increments to attitude, velocity and position, compiled.

In the local level frame (ENU) with transport rate, and, for alignment, in the inertial frame ``i`` of the body at the
first sample.

Sources: P. Savage (1998), parts 1 and 2; P. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated
Navigation Systems", 2nd ed. (2013), sec. 5.3 and 5.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth import earth
from truenorth.attitude import dcm_from_quaternion, quaternion_from_dcm, quaternion_from_vector
from truenorth.compiled import compiled
from truenorth.increments import Algorithm, coefficients, increments
from truenorth.records import ImuRecord

__all__ = ["Mechanisation", "NavigationState", "increments", "inertial_integrals", "integrate_attitude", "mechanise"]

Array = NDArray[np.float64]

_normal_gravity = compiled(earth.normal_gravity, inline="always")
_radii = compiled(earth.radii, inline="always")

Q, V, POSITION, ACCELERATION, BEFORE = 0, 4, 7, 10, 13  # offsets in the kernel's state vector
STATE_SIZE = 19


@dataclass(frozen=True)
class NavigationState:
    """Where a mechanisation stands, and all it needs to go on bit by bit.

    Attributes
    ----------
    C_nb : (3, 3) array
        Initial attitude; afterwards held in `carry`.
    v_n : (3,) array, m/s
    lat, lon, alt : float, rad, rad, m
    carry : (19,) array or None
        The kernel's own state; None before the first chunk.
    rows : (M, 7) array
        Rows (step, dtheta, dvel) that do not fill an update yet.
    rates : (2, 6) array or None
        The last two rows of rates.
    """

    C_nb: Array
    v_n: Array
    lat: float
    lon: float
    alt: float
    carry: Array | None = field(default=None, repr=False)
    rows: Array = field(default_factory=lambda: np.zeros((0, 7)), repr=False)
    rates: Array | None = field(default=None, repr=False)


@dataclass(frozen=True)
class Mechanisation:
    """Computed motion at the output epochs.

    Attributes
    ----------
    time : (K,) array, s
    q_nb : (K, 4) array
        Attitude quaternion, scalar first.
    v_n : (K, 3) array, m/s
        East, north, up.
    position : (K, 3) array
        Latitude, longitude (rad), height (m).
    state : NavigationState
        To go on from.
    """

    time: Array
    q_nb: Array
    v_n: Array
    position: Array
    state: NavigationState

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

    Parameters
    ----------
    record : ImuRecord
    state : NavigationState
        At the beginning of the first row's interval.
    algorithm : {"previous", "1", "2", "3", "4"}
        Samples an update and their coning and sculling correction; "previous" updates at every sample.
    altitude : {"free", "fixed"}
        Free vertical channel, or height and vertical velocity held (at sea).
    every : int
        Output after every so many updates of this chunk.

    Returns
    -------
    Mechanisation
    """
    k, k_before = coefficients(algorithm)
    samples = len(k) + 1
    dtheta, dvel = increments(record, state.rates)
    rows = np.column_stack([record.steps, dtheta, dvel])
    time = record.time
    if len(state.rows):
        time = np.concatenate([np.zeros(len(state.rows)), time])
        rows = np.vstack([state.rows, rows])
    updates = len(rows) // samples
    carry = _packed(state) if state.carry is None else state.carry.copy()
    outputs = updates // every
    out = np.empty((outputs, 10))
    _mechanise(rows, samples, k, k_before, altitude == "fixed", every, carry, out)
    tail = rows[updates * samples :].copy()
    rates = None
    if record.kind == "rates":
        last = np.hstack([record.gyro, record.accel])
        rates = last[-2:] if len(last) >= 2 or state.rates is None else np.vstack([state.rates[1:], last])
    after = replace(
        state,
        C_nb=dcm_from_quaternion(carry[Q:V]),
        v_n=carry[V:POSITION].copy(),
        lat=float(carry[POSITION]),
        lon=float(carry[POSITION + 1]),
        alt=float(carry[POSITION + 2]),
        carry=carry,
        rows=tail,
        rates=rates,
    )
    ends = (np.arange(outputs) + 1) * every * samples - 1
    return Mechanisation(time[ends], out[:, :4], out[:, 4:7], out[:, 7:], after)


def _packed(state: NavigationState) -> Array:
    carry = np.zeros(STATE_SIZE)
    carry[Q:V] = quaternion_from_dcm(state.C_nb)
    carry[V:POSITION] = state.v_n
    carry[POSITION:ACCELERATION] = state.lat, state.lon, state.alt
    return carry


@compiled(inline="always")
def _cross(a: Any, b: Any) -> Any:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled(inline="always")
def _product(p: Any, q: Any) -> Any:
    """Hamilton product of two quaternions as tuples."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@compiled(inline="always")
def _rotate(q: Any, v: Any) -> Any:
    """A vector turned by a unit quaternion, ``v + 2 w t + 2 u x t`` with ``t = u x v``."""
    u = (q[1], q[2], q[3])
    t = _cross(u, v)
    s = _cross(u, t)
    return (
        v[0] + 2.0 * (q[0] * t[0] + s[0]),
        v[1] + 2.0 * (q[0] * t[1] + s[1]),
        v[2] + 2.0 * (q[0] * t[2] + s[2]),
    )


@compiled(inline="always")
def _normalised(q: Any) -> Any:
    """A nearly unit quaternion made unit; one Newton step is exact to rounding after each small turn."""
    scale = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale


@compiled(inline="always")
def _turned_force(theta: Any, dv: Any) -> Any:
    """What the body's turn within an interval adds to ``dv``: ``(1/2 - t^2/24) t x dv + (1/6 - t^2/120) t x (t x dv)``."""
    square = theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2]
    once = _cross(theta, dv)
    twice = _cross(theta, once)
    c1, c2 = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    return c1 * once[0] + c2 * twice[0], c1 * once[1] + c2 * twice[1], c1 * once[2] + c2 * twice[2]


@compiled(inline="always")
def _motion(rows: Any, start: int, samples: int, k: Any, k_before: float, th0: Any, dv0: Any) -> Any:
    """Rotation vector and velocity increment (in the body at the beginning) of one update of N samples."""
    last = start + samples - 1
    a = (rows[last, 1], rows[last, 2], rows[last, 3])
    b = (rows[last, 4], rows[last, 5], rows[last, 6])
    T = rows[last, 0]
    # Coefficient-weighted sums of the samples before the last, then one cross product.
    ka = (k_before * th0[0], k_before * th0[1], k_before * th0[2])
    kb = (k_before * dv0[0], k_before * dv0[1], k_before * dv0[2])
    A, B = a, b
    for i in range(samples - 1):
        r = start + i
        x = (rows[r, 1], rows[r, 2], rows[r, 3])
        y = (rows[r, 4], rows[r, 5], rows[r, 6])
        c = k[i]
        ka = (ka[0] + c * x[0], ka[1] + c * x[1], ka[2] + c * x[2])
        kb = (kb[0] + c * y[0], kb[1] + c * y[1], kb[2] + c * y[2])
        A = (A[0] + x[0], A[1] + x[1], A[2] + x[2])
        B = (B[0] + y[0], B[1] + y[1], B[2] + y[2])
        T += rows[r, 0]
    coning = _cross(ka, a)
    scull_1, scull_2, turn = _cross(ka, b), _cross(kb, a), _turned_force(A, B)
    phi = (A[0] + coning[0], A[1] + coning[1], A[2] + coning[2])
    dv = (
        B[0] + turn[0] + scull_1[0] + scull_2[0],
        B[1] + turn[1] + scull_1[1] + scull_2[1],
        B[2] + turn[2] + scull_1[2] + scull_2[2],
    )
    return T, phi, dv, a, b


@compiled
def _mechanise(
    rows: Any, samples: int, k: Any, k_before: float, fixed_altitude: bool, every: int, state: Any, out: Any
) -> None:
    q = (state[0], state[1], state[2], state[3])
    vE, vN, vU = state[4], state[5], state[6]
    lat, lon, alt = state[7], state[8], state[9]
    aE, aN, aU = state[10], state[11], state[12]
    th0 = (state[13], state[14], state[15])
    dv0 = (state[16], state[17], state[18])
    w_ie = earth.EARTH_RATE
    for m in range(rows.shape[0] // samples):
        T, phi, dv, th0, dv0 = _motion(rows, m * samples, samples, k, k_before, th0, dv0)

        # Half an interval on, where Coriolis, transport and gravity are taken.
        half = 0.5 * T
        mE, mN, mU = vE + half * aE, vN + half * aN, vU + half * aU
        mid_lat = lat + half * vN / earth.SEMI_MAJOR  # to a part in 200 of half a step: millimetres
        mid_alt = alt + half * vU
        sin_lat, cos_lat = math.sin(mid_lat), math.cos(mid_lat)
        R_M, R_N = _radii(mid_lat)
        wieN, wieU = w_ie * cos_lat, w_ie * sin_lat
        wenE = -mN / (R_M + mid_alt)
        wenN = mE / (R_N + mid_alt)
        wenU = wenN * sin_lat / cos_lat
        zeta = (wenE * T, (wieN + wenN) * T, (wieU + wenU) * T)

        # Specific force into n, half way through n's own turn: (I - [zeta x]/2) C_nb dv.
        f = _rotate(q, dv)
        z = _cross(zeta, f)
        coriolis = _cross((wenE, 2.0 * wieN + wenN, 2.0 * wieU + wenU), (mE, mN, mU))
        dE = f[0] - 0.5 * z[0] - coriolis[0] * T
        dN = f[1] - 0.5 * z[1] - coriolis[1] * T
        dU = f[2] - 0.5 * z[2] - (coriolis[2] + _normal_gravity(mid_lat, mid_alt)) * T
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

        turned = _product(q, quaternion_from_vector(phi[0], phi[1], phi[2]))
        q = _normalised(_product(quaternion_from_vector(-zeta[0], -zeta[1], -zeta[2]), turned))

        if (m + 1) % every == 0:
            j = (m + 1) // every - 1
            out[j, 0], out[j, 1], out[j, 2], out[j, 3] = q
            out[j, 4], out[j, 5], out[j, 6] = vE, vN, vU
            out[j, 7], out[j, 8], out[j, 9] = lat, lon, alt
    state[0], state[1], state[2], state[3] = q
    state[4], state[5], state[6] = vE, vN, vU
    state[7], state[8], state[9] = lat, lon, alt
    state[10], state[11], state[12] = aE, aN, aU
    state[13], state[14], state[15] = th0
    state[16], state[17], state[18] = dv0


def integrate_attitude(dtheta: Array, q0: Array | None = None, algorithm: Algorithm = "previous") -> Array:
    """Attitude in an inertial frame after each update, attitude alone.

    Parameters
    ----------
    dtheta : (N, 3) array, rad
    q0 : (4,) array, optional
        Initial attitude ``q_ib``, scalar first; identity when left out.
    algorithm : {"previous", "1", "2", "3", "4"}

    Returns
    -------
    (N // samples + 1, 4) array
        The initial one first.
    """
    k, k_before = coefficients(algorithm)
    samples = len(k) + 1
    rows = np.zeros((len(dtheta), 7))
    rows[:, 1:4] = dtheta
    out = np.empty((len(rows) // samples + 1, 4))
    out[0] = (1.0, 0.0, 0.0, 0.0) if q0 is None else q0
    _integrate_attitude(rows, samples, k, k_before, out)
    return out


@compiled
def _integrate_attitude(rows: Any, samples: int, k: Any, k_before: float, out: Any) -> None:
    q = (out[0, 0], out[0, 1], out[0, 2], out[0, 3])
    th0 = (0.0, 0.0, 0.0)
    dv0 = (0.0, 0.0, 0.0)
    for m in range(rows.shape[0] // samples):
        _, phi, _, th0, dv0 = _motion(rows, m * samples, samples, k, k_before, th0, dv0)
        q = _normalised(_product(q, quaternion_from_vector(phi[0], phi[1], phi[2])))
        out[m + 1, 0], out[m + 1, 1], out[m + 1, 2], out[m + 1, 3] = q


def inertial_integrals(dtheta: Array, dvel: Array, steps: Array, epochs: Array) -> tuple[Array, Array, Array]:
    """Attitude, and first and second integral of specific force, in the inertial frame of the body at the start.

    Parameters
    ----------
    dtheta, dvel : (N, 3) arrays, rad and m/s
    steps : (N,) array, s
    epochs : (K,) int array
        Ascending: outputs after this many rows (0 is the start).

    Returns
    -------
    C_ib : (K, 3, 3) array
    velocity : (K, 3) array, m/s
    position : (K, 3) array, m
    """
    count = len(epochs)
    q, v, p = np.empty((count, 4)), np.empty((count, 3)), np.empty((count, 3))
    contiguous = (np.ascontiguousarray(a, dtype=np.float64) for a in (dtheta, dvel, steps))
    _inertial_integrals(*contiguous, np.ascontiguousarray(epochs, dtype=np.int64), q, v, p)
    return dcm_from_quaternion(q), v, p


@compiled
def _inertial_integrals(dtheta: Any, dvel: Any, steps: Any, epochs: Any, q_out: Any, v_out: Any, p_out: Any) -> None:
    q = (1.0, 0.0, 0.0, 0.0)
    vx = vy = vz = px = py = pz = 0.0
    th0 = (0.0, 0.0, 0.0)
    dv0 = (0.0, 0.0, 0.0)
    c = 1.0 / 12.0
    j = 0
    for k in range(dtheta.shape[0] + 1):
        while j < epochs.shape[0] and epochs[j] == k:
            q_out[j, 0], q_out[j, 1], q_out[j, 2], q_out[j, 3] = q
            v_out[j, 0], v_out[j, 1], v_out[j, 2] = vx, vy, vz
            p_out[j, 0], p_out[j, 1], p_out[j, 2] = px, py, pz
            j += 1
        if k == dtheta.shape[0]:
            break
        a = (dtheta[k, 0], dtheta[k, 1], dtheta[k, 2])
        b = (dvel[k, 0], dvel[k, 1], dvel[k, 2])
        T = steps[k]
        coning, turn = _cross(th0, a), _turned_force(a, b)
        s1, s2 = _cross(th0, b), _cross(dv0, a)
        f = _rotate(
            q,
            (
                b[0] + turn[0] + c * (s1[0] + s2[0]),
                b[1] + turn[1] + c * (s1[1] + s2[1]),
                b[2] + turn[2] + c * (s1[2] + s2[2]),
            ),
        )
        px += (vx + 0.5 * f[0]) * T
        py += (vy + 0.5 * f[1]) * T
        pz += (vz + 0.5 * f[2]) * T
        vx += f[0]
        vy += f[1]
        vz += f[2]
        turned = quaternion_from_vector(a[0] + c * coning[0], a[1] + c * coning[1], a[2] + c * coning[2])
        q = _normalised(_product(q, turned))
        th0, dv0 = a, b
