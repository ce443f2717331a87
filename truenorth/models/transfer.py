"""Error model of transfer alignment: a slave INS against the vehicle's master, with what time and space registration left.

States, errors of the slave computed minus true; which of those behind the twelve there are is the caller's choice:

| slice | state | unit |
| --- | --- | --- |
| DV | velocity error | m/s |
| PHI | misalignment phi, ``C_nb_hat = (I - [phi x]) C_nb`` | rad |
| BA | what is left of the accelerometer bias: measured minus true | m/s^2 |
| BG | what is left of the gyro bias: measured minus true | rad/s |
| tau | delay of the master beyond the known one: true minus assumed | s |
| r | lever arm from the master to the slave, slave axes: true minus assumed | m |
| mu | mounting of the slave on the master, master axes: ``C_mb = (I + [mu x]) C_mb_assumed`` | rad |
| theta, theta' | flexure: the slave's seat turned against the rigid body, slave axes, and its rate | rad, rad/s |

(m are the *master's* axes, in which mu does not turn with what is estimated: in the slave's axes the filter would take its own
corrections of tilt for knowledge of heading.) The dynamics of the twelve are those of :mod:`truenorth.errors.ins` in ENU
without the position error, whose part in minutes is below a millionth. The master is late by tau and stands at -r in the slave, so
that

    velocity   z = v_hat - C_hat (w_hat x r) - v_master
                 = dv + a tau + C [w x] dr + phi x C (w x r) - C (eps x r)
    attitude   C_hat (C_master C_mb)' = exp(-[z x]),   z = phi - C w_nb tau - C_master mu - C theta

with `a` the *master's* acceleration: the slave's holds that of the arm itself, which would tell a delay from the master's
smooth motion falsely. Flexure is ``theta'' = -2 beta theta' - beta^2 theta + white noise`` on each axis.

Sources: Xia Jiahe et al., "Study on transfer alignment algorithm considering space-time difference", Navigation Positioning
and Timing 3 (2016), eq. 6-9, corrected: a zero column is missing in its (9); the sign of tau in its (8) is that of (9) when
the reference is late; J. Kain, J. Cloutier, "Rapid transfer alignment for tactical weapon applications", AIAA GNC 1989
(velocity and attitude matching, flexure).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import cross
from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.core.linalg import padded
from truenorth.errors.ins import TURN_TIME, error_dynamics
from truenorth.state.layout import STATES as INS_STATES

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

DV = slice(0, 3)
PHI = slice(3, 6)
BA = slice(6, 9)
BG = slice(9, 12)
STATES = 12
DYNAMIC = 6  # velocity and misalignment; all behind them drive, and are not driven

# The same for kernels, which take numbers.
_DV, _PHI, _BA, _BG = 0, 3, 6, 9
TAU, ARM, MOUNT, FLEX, PLACES = range(5)  # of the optional states in `places`

NAMES = tuple(
    f"{state}_{axis}"
    for state, axes in (("dv", "ENU"), ("phi", "ENU"), ("nabla", "xyz"), ("eps", "xyz"))
    for axis in axes
)
UNITS = ("m/s",) * 3 + ("rad",) * 3 + ("m/s^2",) * 3 + ("rad/s",) * 3
SIDES = ("right", "forward", "up")


@dataclass(frozen=True)
class TransferModel:
    """Noise of the slave, and which states there are; one-sigma, SI.

    Attributes
    ----------
    gyro_random_walk : float, rad/sqrt(s)
    accel_random_walk : float, m/s/sqrt(s)
    gyro_rate_walk, accel_rate_walk : float
        Random walk of the biases, rad/s/sqrt(s) and m/s^2/sqrt(s).
    turn_noise : float, s
        What scale factors and misalignments of the gyros do in turns, as noise; see :class:`truenorth.errors.model.InsModel`.
    delay, lever_arm, mounting : bool
        States for them: 12 without any, 13 with the delay, 16 with the lever arm, 3 more for the mounting angles.
    delay_walk : float, s/sqrt(s)
        How the delay wanders, for a master whose clock runs at another rate.
    flexure_sigma : (3,) tuple, rad
        Of the seat's angles about right, forward, up; zeros: it does not bend, and there are no such states.
    flexure_beta : float, rad/s
        Natural frequency of its critically damped processes.
    """

    gyro_random_walk: float
    accel_random_walk: float
    gyro_rate_walk: float = 0.0
    accel_rate_walk: float = 0.0
    turn_noise: float = 0.0
    delay: bool = True
    lever_arm: bool = True
    mounting: bool = False
    delay_walk: float = 0.0
    flexure_sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)
    flexure_beta: float = 1.0

    def __post_init__(self) -> None:
        walks = (self.gyro_random_walk, self.accel_random_walk, self.gyro_rate_walk, self.accel_rate_walk)
        if not all(0.0 <= x < math.inf for x in (*walks, self.turn_noise, self.delay_walk, *self.flexure_sigma)):
            raise UsageError(f"{self}: a random walk or a sigma is negative or not finite")
        if not 0.0 < self.flexure_beta < math.inf:
            raise UsageError(f"flexure_beta is {self.flexure_beta}; expected a positive frequency, rad/s")

    @property
    def flexure(self) -> bool:
        """Whether there are states of flexure."""
        return any(self.flexure_sigma)

    @property
    def places(self) -> Integers:
        """(4,) first state of delay, lever arm, mounting and flexure; -1: none."""
        at, found = STATES, []
        for there, count in ((self.delay, 1), (self.lever_arm, 3), (self.mounting, 3), (self.flexure, 6)):
            found.append(at if there else -1)
            at += count * there
        return np.array(found)

    @property
    def states(self) -> int:
        """How many."""
        return STATES + self.delay + 3 * self.lever_arm + 3 * self.mounting + 6 * self.flexure

    def slice_of(self, which: int) -> slice | None:
        """Where the states of `TAU`, `ARM`, `MOUNT` or `FLEX` (angles alone) stand; None where there are none."""
        at = int(self.places[which])
        return None if at < 0 else slice(at, at + (1 if which == TAU else 3))

    @property
    def names(self) -> tuple[str, ...]:
        """Of all states."""
        return (
            *NAMES,
            *("tau",) * self.delay,
            *(f"r_{side}" for side in SIDES if self.lever_arm),
            *(f"mu_{axis}" for axis in "xyz" if self.mounting),
            *(f"theta_{axis}" for axis in "xyz" if self.flexure),
            *(f"theta'_{axis}" for axis in "xyz" if self.flexure),
        )

    @property
    def units(self) -> tuple[str, ...]:
        """Of all states, SI."""
        more = ("s",) * self.delay + ("m",) * (3 * self.lever_arm) + ("rad",) * (3 * self.mounting)
        return UNITS + more + (("rad",) * 3 + ("rad/s",) * 3) * self.flexure

    @property
    def noise(self) -> Array:
        """(n,) spectral density of the white noise on each state, its unit^2/s; flexure's own stands in its block."""
        q = np.zeros(self.states)
        q[DV], q[PHI] = self.accel_random_walk**2, self.gyro_random_walk**2
        q[BA], q[BG] = self.accel_rate_walk**2, self.gyro_rate_walk**2
        if self.delay:
            q[self.places[TAU]] = self.delay_walk**2
        return q

    def prior(
        self,
        dv: ArrayLike,
        phi: ArrayLike,
        accel_bias: ArrayLike,
        gyro_bias: ArrayLike,
        *,
        tau: float = 0.0,
        arm: ArrayLike = 0.0,
        mounting: ArrayLike = 0.0,
        C_nb: ArrayLike | None = None,
        C_mb: ArrayLike | None = None,
    ) -> Array:
        """(n, n) covariance at the start, of independent states.

        Parameters
        ----------
        dv, phi, accel_bias, gyro_bias : one or (3,) sigmas, m/s, rad, m/s^2, rad/s
        tau : float, s
        arm, mounting : one or (3,) sigmas, m and rad
            Of states that are not there, ignored.
        C_nb : (3, 3) array, optional
            The slave's attitude was handed over from the master through the assumed mounting: ``phi = C_nm mu + C theta`` beside
            what `phi` says. Without it they are independent.
        C_mb : (3, 3) array, optional
            The assumed mounting; the unit matrix when left out.
        """
        sigma = np.zeros(self.states)
        for part, value in ((DV, dv), (PHI, phi), (BA, accel_bias), (BG, gyro_bias)):
            sigma[part] = value
        for which, more in ((TAU, tau), (ARM, arm), (MOUNT, mounting), (FLEX, self.flexure_sigma)):
            found = self.slice_of(which)
            if found is not None:
                sigma[found] = more
        if self.flexure:
            at = self.places[FLEX] + 3
            sigma[at : at + 3] = self.flexure_beta * np.array(self.flexure_sigma)
        P = np.diag(sigma**2)
        if C_nb is not None:
            seat = np.asarray(C_nb, dtype=np.float64)
            for which, C in ((MOUNT, seat if C_mb is None else seat @ np.asarray(C_mb).T), (FLEX, seat)):
                found = self.slice_of(which)
                if found is not None:
                    own = P[found, found].copy()
                    P[PHI, found] = C @ own
                    P[found, PHI] = P[PHI, found].T
                    P[PHI, PHI] += C @ own @ C.T
        return P

    def linearise(
        self,
        T: ArrayLike,
        C_nb: ArrayLike,
        f_n: ArrayLike,
        v_n: ArrayLike,
        lat: ArrayLike,
        alt: ArrayLike,
        w_ib_b: ArrayLike,
    ) -> tuple[Array, Array]:
        """Stack the dynamics over K intervals, for :class:`truenorth.filters.LinearSystem`.

        Parameters
        ----------
        T : (K,) array, s
        C_nb : (K, 3, 3) array
            Mean over each interval, as all that follow.
        f_n : (K, 3) array, m/s^2
        v_n : (K, 3) array, m/s
        lat, alt : (K,) arrays, rad and m
        w_ib_b : (K, 3) array, rad/s

        Returns
        -------
        Phi, Q : (K, n, n) arrays
        """
        T, C, f, v, lat, alt, w = (
            np.ascontiguousarray(a, dtype=np.float64) for a in (T, C_nb, f_n, v_n, lat, alt, w_ib_b)
        )
        K, n = len(T), self.states
        Phi, Q = np.zeros((K, n, n)), np.zeros((K, n, n))
        axis = np.stack([np.zeros_like(lat), np.cos(lat), np.sin(lat)], axis=-1)
        _stack(padded(n), T, C, f, v, axis, alt, self.places, self.flexure_beta, Phi)
        q = np.zeros((K, n, n))
        q[:] = np.diag(self.noise)
        q[:, PHI, PHI] += (self.turn_noise * np.sum(w**2, axis=1))[:, None, None] * np.eye(3)
        Q[:] = 0.5 * T[:, None, None] * (Phi @ q @ np.swapaxes(Phi, 1, 2) + q)
        if self.flexure:
            at = int(self.places[FLEX])
            part = slice(at, at + 6)
            sigma = np.array(self.flexure_sigma)
            still = np.diag(np.concatenate([sigma, self.flexure_beta * sigma]) ** 2)
            Q[:, part, part] += still - Phi[:, part, part] @ still @ np.swapaxes(Phi[:, part, part], 1, 2)
        return Phi, Q

    def observe(
        self,
        C_nb: ArrayLike,
        v_n: ArrayLike,
        a_n: ArrayLike,
        w_eb_b: ArrayLike,
        w_nb_b: ArrayLike,
        arm: ArrayLike = (0.0, 0.0, 0.0),
        C_mb: ArrayLike | None = None,
    ) -> Array:
        """(K, 6, n) rows of velocity and of attitude matching at K epochs.

        Parameters
        ----------
        C_nb : (K, 3, 3) array
        v_n, a_n : (K, 3) arrays, m/s and m/s^2
            Velocity of the slave, acceleration of the master.
        w_eb_b, w_nb_b : (K, 3) arrays, rad/s
            Rates of the slave against the earth and against the level frame.
        arm : (3,) array, m
            As assumed.
        C_mb : (3, 3) array, optional
            Slave to master axes; the unit matrix when left out.
        """
        C, v, a, w, w_nb = (np.ascontiguousarray(x, dtype=np.float64) for x in (C_nb, v_n, a_n, w_eb_b, w_nb_b))
        H = np.zeros((len(C), 6, self.states))
        z = np.zeros(3)
        places, r = self.places, np.asarray(arm, dtype=np.float64)
        C_nm = C if C_mb is None else np.ascontiguousarray(C @ np.asarray(C_mb, dtype=np.float64).T)
        for k in range(len(C)):
            velocity_rows(C[k], v[k], a[k], w[k], r, places, v[k], H[k, :3], z)
            attitude_rows(C[k], w_nb[k], C[k], C_nm[k], places, H[k, 3:], z)
        return H


def turn_noise(scale_factor: float, misalignment: float) -> float:
    """What scale factors and misalignments of the gyros do in turns, as noise, for :class:`TransferModel`.

    The larger of both, about every axis: a turn about one axis tilts about the others.
    """
    return max(scale_factor, misalignment) ** 2 * TURN_TIME


@compiled
def transfer_dynamics(C: Any, f: Any, v: Any, axis: Any, alt: float, full: Any, F: Any) -> None:
    """Rows of velocity and misalignment of ``x' = F x`` for the twelve states.

    Parameters
    ----------
    C, f, v, axis, alt
        As :func:`truenorth.errors.ins.error_dynamics`, ENU.
    full : (15, 15) array
        Room for the model with position.
    F : (6, N) array, N >= 12
        Filled in.
    """
    error_dynamics(C, f, v, axis, alt, True, False, full)
    for i in range(3):
        for j in range(3):
            F[_DV + i, _DV + j], F[_DV + i, _PHI + j] = full[3 + i, 3 + j], full[3 + i, j]
            F[_DV + i, _BA + j], F[_DV + i, _BG + j] = full[3 + i, 12 + j], full[3 + i, 9 + j]
            F[_PHI + i, _DV + j], F[_PHI + i, _PHI + j] = full[i, 3 + j], full[i, j]
            F[_PHI + i, _BA + j], F[_PHI + i, _BG + j] = full[i, 12 + j], full[i, 9 + j]


@compiled
def transfer_transition(F: Any, T: float, at_flex: int, beta: float, Phi: Any, Phi_t: Any) -> None:
    """``Phi = I + F T + (F T)^2/2`` of the dynamic states, the exact one of flexure, and its transpose.

    Parameters
    ----------
    F : (6, N) array
    T : float, s
    at_flex : int
        First state of flexure; -1: none.
    beta : float, rad/s
    Phi, Phi_t : (N, N) arrays
        Filled in; those rows that never change are the unit matrix on entry.
    """
    half = 0.5 * T * T
    for i in range(DYNAMIC):
        for j in range(STATES):
            total = 0.0
            for k in range(DYNAMIC):
                total += F[i, k] * F[k, j]
            Phi[i, j] = F[i, j] * T + half * total
        Phi[i, i] += 1.0
        for j in range(STATES):
            Phi_t[j, i] = Phi[i, j]
    if at_flex >= 0:
        decay = math.exp(-beta * T)
        for i in range(at_flex, at_flex + 3):
            Phi[i, i], Phi[i, i + 3] = decay * (1.0 + beta * T), decay * T
            Phi[i + 3, i], Phi[i + 3, i + 3] = -decay * beta * beta * T, decay * (1.0 - beta * T)
            for j in (i, i + 3):
                Phi_t[i, j], Phi_t[i + 3, j] = Phi[j, i], Phi[j, i + 3]


@compiled
def velocity_rows(C: Any, v: Any, a: Any, w: Any, arm: Any, places: Any, measured: Any, H: Any, z: Any) -> None:
    """Velocity of the master, east, north, up.

    Parameters
    ----------
    C : (3, 3) array
        The slave's ``C_nb``.
    v : (3,) array, m/s
        The slave's velocity.
    a : (3,) array, m/s^2
        Acceleration of the master.
    w : (3,) array, rad/s
        Rate of the slave against the earth, slave axes.
    arm : (3,) array, m
        Master to slave, slave axes, as assumed.
    places : (4,) array
        First state of delay, lever arm, mounting, flexure; -1: none.
    measured : (3,) array, m/s
    H : (3, N) array
        Zeros; filled in.
    z : (3,) array, m/s
        Filled in.
    """
    at_tau, at_arm = places[TAU], places[ARM]
    u_b = cross((w[0], w[1], w[2]), (arm[0], arm[1], arm[2]))
    u = (
        C[0, 0] * u_b[0] + C[0, 1] * u_b[1] + C[0, 2] * u_b[2],
        C[1, 0] * u_b[0] + C[1, 1] * u_b[1] + C[1, 2] * u_b[2],
        C[2, 0] * u_b[0] + C[2, 1] * u_b[1] + C[2, 2] * u_b[2],
    )
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        tilt, turn, sweep = cross(e, u), cross(e, (arm[0], arm[1], arm[2])), cross((w[0], w[1], w[2]), e)
        for i in range(3):
            H[i, _DV + j] = e[i]
            H[i, _PHI + j] = tilt[i]
            H[i, _BG + j] = -(C[i, 0] * turn[0] + C[i, 1] * turn[1] + C[i, 2] * turn[2])
            if at_arm >= 0:
                H[i, at_arm + j] = C[i, 0] * sweep[0] + C[i, 1] * sweep[1] + C[i, 2] * sweep[2]
        if at_tau >= 0:
            H[j, at_tau] = a[j]
        z[j] = v[j] - u[j] - measured[j]


@compiled
def attitude_rows(C: Any, w: Any, reference: Any, C_nm: Any, places: Any, H: Any, z: Any) -> None:
    """Attitude of the master, turned by the assumed mounting.

    Parameters
    ----------
    C : (3, 3) array
        The slave's ``C_nb``.
    w : (3,) array, rad/s
        Rate of the slave against the level frame, slave axes.
    reference : (3, 3) array
        ``C_nm C_mb``: the slave's attitude as the master tells it.
    C_nm : (3, 3) array
        The master's attitude, to linearise with: as it is told, or better, but never corrected by what the filter finds on the way.
    places : (4,) array
    H : (3, N) array
        Zeros; filled in.
    z : (3,) array, rad
        Filled in.
    """
    sine = 0.0
    for i in range(3):
        # Axis times sine of C reference' = exp(-[z x]).
        a, b = (i + 1) % 3, (i + 2) % 3
        total = 0.0
        for k in range(3):
            total += C[a, k] * reference[b, k] - C[b, k] * reference[a, k]
        z[i] = 0.5 * total
        sine += z[i] * z[i]
    sine = math.sqrt(sine)
    cosine = -0.5
    for i in range(3):
        for k in range(3):
            cosine += 0.5 * C[i, k] * reference[i, k]
    scale = 1.0
    if sine > 1e-12:
        scale = math.atan2(sine, cosine) / sine
    for i in range(3):
        z[i] *= scale
        H[i, _PHI + i] = 1.0
        if places[TAU] >= 0:
            H[i, places[TAU]] = -(C[i, 0] * w[0] + C[i, 1] * w[1] + C[i, 2] * w[2])
        for j in range(3):
            if places[MOUNT] >= 0:
                H[i, places[MOUNT] + j] = -C_nm[i, j]
            if places[FLEX] >= 0:
                H[i, places[FLEX] + j] = -C[i, j]


@compiled
def _stack(size: Any, T: Any, C: Any, f: Any, v: Any, axis: Any, alt: Any, places: Any, beta: float, out: Any) -> None:
    N, n = len(size), out.shape[1]
    F, full, Phi, Phi_t = np.zeros((DYNAMIC, N)), np.zeros((INS_STATES, INS_STATES)), np.zeros((N, N)), np.zeros((N, N))
    for i in range(n):
        Phi[i, i] = 1.0
    for k in range(len(T)):
        transfer_dynamics(C[k], f[k], v[k], axis[k], alt[k], full, F)
        transfer_transition(F, T[k], places[FLEX], beta, Phi, Phi_t)
        for i in range(n):
            for j in range(n):
                out[k, i, j] = Phi[i, j]
