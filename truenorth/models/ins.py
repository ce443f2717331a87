"""Error model of an INS that moves over the earth: the phi-angle model, written once, in any level frame.

States, errors computed minus true (15 and what a specification adds):

| slice | state | unit |
| --- | --- | --- |
| PHI | misalignment phi, ``C_nb_hat = (I - [phi x]) C_nb`` | rad |
| DV | velocity error | m/s |
| DP | position error: east, north, up displacement | m |
| BG | what is left of the gyro bias: measured minus true | rad/s |
| BA | what is left of the accelerometer bias: measured minus true | m/s^2 |

The level frame either points north (ENU) or is carried on without turning about the vertical (*wander*), which has no
singularity at the poles. The earth's axis ``a`` in that frame, ``(0, cos L, sin L)`` in ENU, says how the frame lies. With
the curvature ``T``, by which a displacement turns the frame (``dtheta = T dp``, ``w_en = T v``):

    phi' = -w_in x phi + dw_ie + dw_en - C eps,        dw_ie = w_ie x T dp,   dw_en = T dv + D dp
    dv'  = f x phi - (2 w_ie + w_en) x dv + v x (2 dw_ie + dw_en) + dg + C nabla
    dp'  = dv - w_en x dp + T dp x v

``D dp`` is the change of curvature and convergence between the two places. Position is in metres, so that a position error
has one meaning at every latitude: ``dp_N = (R_M + h) dL``, ``dp_E = (R_N + h) cos L dlon``. In the wander frame the axes
at the true position are those of the computed one carried over in parallel; the two models differ by the convergence of
the meridians, ``phi_U(north) = phi_U(wander) + tan L dp_E/(R_N + h)``.

Sources: D. Goshen-Meskin, I. Bar-Itzhack, "Unified approach to inertial navigation system error modeling", J. Guid.
Control Dyn. 15 (1992) (phi angle, computer frame); P. Groves, "Principles of GNSS, Inertial, and Multisensor
Integrated Navigation Systems", 2nd ed. (2013), sec. 14.2 (Schuler, transport-rate terms); P. Savage, *Strapdown
Analytics*, 2nd ed. (2007), sec. 12 (wander frame). Neglected: how the radii of the ellipsoid change from the true to the
computed place (1/300 of a term that is itself small), and the deflection of the vertical.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core import earth
from truenorth.core.attitude import cross
from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.core.linalg import padded
from truenorth.records.specs import ImuSpec
from truenorth.strapdown.wander import curvature

Array = NDArray[np.float64]

PHI = slice(0, 3)
DV = slice(3, 6)
DP = slice(6, 9)
BG = slice(9, 12)
BA = slice(12, 15)
STATES = 15

# The same for kernels, which take numbers.
_PHI, _DV, _DP, _BG, _BA = 0, 3, 6, 9, 12
TURN_TIME = 10.0  # s, for which a turn goes on about one axis: so long its scale and misalignment errors are alike
DYNAMIC = 9  # states whose errors drive each other; those behind them are sensors' and run by themselves
_W = earth.EARTH_RATE
_normal_gravity_at = compiled(earth.normal_gravity_at)


@compiled
def error_dynamics(C: Any, f: Any, v: Any, axis: Any, alt: float, north: bool, fixed_altitude: bool, F: Any) -> None:
    """Fill in ``F`` of ``x' = F x + w`` for the 15 states; the sensors' own rows (9 and on) are left as they are.

    Parameters
    ----------
    C : (3, 3) array
        Body to level frame.
    f : (3,) array, m/s^2
        Specific force in the level frame.
    v : (3,) array, m/s
    axis : (3,) array
        The earth's axis in the level frame: (0, cos L, sin L) in ENU.
    alt : float, m
    north : bool
        The frame points north (ENU); else it does not turn about the vertical.
    fixed_altitude : bool
        Height held and vertical velocity zero: their errors stay as they are.
    F : (N, N) array, N >= 15
    """
    Kxx, Kxy, Kyy = curvature(axis, alt)
    vE, vN, vU = v[0], v[1], v[2]
    tE = 0.0  # w_en about up for a velocity along x: tan L/(R_N + h)
    if north:
        tE = axis[2] / axis[1] * Kxx
    wen = (-(Kxy * vE + Kyy * vN), Kxx * vE + Kxy * vN, tE * vE)
    wie = (_W * axis[0], _W * axis[1], _W * axis[2])
    coriolis = (2.0 * wie[0] + wen[0], 2.0 * wie[1] + wen[1], 2.0 * wie[2] + wen[2])
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        # Columns of T and D.
        if j == 0:
            t = (-Kxy, Kxx, tE)
        elif j == 1:
            t = (-Kyy, Kxy, 0.0)
        else:
            t = (0.0, 0.0, 0.0)
        if j == 2:
            KvE, KvN = wen[1], -wen[0]
            d = (Kxy * KvE + Kyy * KvN, -(Kxx * KvE + Kxy * KvN), -tE * Kxx * vE)
        elif not north:
            d = (0.0, 0.0, wen[0] * t[1] - wen[1] * t[0])
        elif j == 1:
            d = (0.0, 0.0, vE * Kxx * Kyy / (axis[1] * axis[1]))
        else:
            d = (0.0, 0.0, 0.0)

        a = cross((wie[0] + wen[0], wie[1] + wen[1], wie[2] + wen[2]), e)
        b = cross((f[0], f[1], f[2]), e)
        c = cross(coriolis, e)
        g = cross((vE, vN, vU), t)
        h = cross(wie, t)
        m = cross((vE, vN, vU), (2.0 * h[0] + d[0], 2.0 * h[1] + d[1], 2.0 * h[2] + d[2]))
        n = cross(wen, e)
        for i in range(3):
            F[_PHI + i, _PHI + j] = -a[i]
            F[_PHI + i, _DV + j] = t[i]
            F[_PHI + i, _DP + j] = h[i] + d[i]
            F[_PHI + i, _BG + j] = -C[i, j]
            F[_DV + i, _PHI + j] = b[i]
            F[_DV + i, _DV + j] = g[i] - c[i]
            F[_DV + i, _DP + j] = m[i]
            F[_DV + i, _BA + j] = C[i, j]
            F[_DP + i, _DV + j] = e[i]
            F[_DP + i, _DP + j] = -g[i] - n[i]
    # Gravity falls with height, and grows towards the poles (d sin L = a_h K dp).
    s2 = axis[2] * axis[2]
    F[_DV + 2, _DP + 2] += 0.005 * (_normal_gravity_at(s2, alt - 100.0) - _normal_gravity_at(s2, alt + 100.0))
    slope = 2.0 * axis[2] * 500.0 * (_normal_gravity_at(s2 - 1e-3, alt) - _normal_gravity_at(s2 + 1e-3, alt))
    F[_DV + 2, _DP] += slope * (axis[0] * Kxx + axis[1] * Kxy)
    F[_DV + 2, _DP + 1] += slope * (axis[0] * Kxy + axis[1] * Kyy)
    if fixed_altitude:
        for j in range(_BA + 3):
            F[_DV + 2, j] = 0.0
            F[_DP + 2, j] = 0.0


@compiled
def couple_sensors(C: Any, w: Any, f_b: Any, at: Any, fixed_altitude: bool, F: Any) -> None:
    """Fill in the columns by which slow biases and scale factors act as gyro and accelerometer errors.

    Parameters
    ----------
    C : (3, 3) array
        Body to level frame.
    w, f_b : (3,) arrays, rad/s and m/s^2
        Measured rate and specific force, body axes.
    at : (4,) array of int
        First state of the slow gyro and accelerometer bias, of the gyro and accelerometer scale factor; -1: none.
    fixed_altitude : bool
        Vertical velocity is zero: nothing drives it.
    F : (N, N) array
    """
    for i in range(3):
        for j in range(3):
            if at[0] >= 0:
                F[_PHI + i, at[0] + j] = -C[i, j]
            if at[2] >= 0:
                F[_PHI + i, at[2] + j] = -C[i, j] * w[j]
            if fixed_altitude and i == 2:
                continue
            if at[1] >= 0:
                F[_DV + i, at[1] + j] = C[i, j]
            if at[3] >= 0:
                F[_DV + i, at[3] + j] = C[i, j] * f_b[j]


@compiled
def transition(size: Any, F: Any, decay: Any, T: float, Phi: Any, Phi_t: Any) -> None:
    """``Phi = I + F T + (F T)^2/2`` of the first nine states, exact exponentials of the others', and its transpose.

    Parameters
    ----------
    size : tuple
        See :mod:`truenorth.core.linalg`.
    F : (N, N) array
        Rows 9 and on hold zeros: those states only decay.
    decay : (n,) array, 1/s
    T : float, s
    Phi, Phi_t : (N, N) arrays
        Filled in; zero beyond the states.
    """
    half = 0.5 * T * T
    n = len(decay)
    for i in range(DYNAMIC):
        for j in range(len(size)):
            total = 0.0
            for k in range(len(size)):
                total += F[i, k] * F[k, j]
            Phi[i, j] = F[i, j] * T + half * total
        for j in range(DYNAMIC, n):  # the sensors' own decay, which stands on the diagonal of their rows
            Phi[i, j] -= half * F[i, j] * decay[j]
        Phi[i, i] += 1.0
        for j in range(n):
            Phi_t[j, i] = Phi[i, j]
    for i in range(DYNAMIC, n):
        Phi[i, i] = math.exp(-decay[i] * T)
        Phi_t[i, i] = Phi[i, i]


@dataclass(frozen=True)
class Extra:
    """States beyond the fifteen: constants, Gauss-Markov processes or random walks that a specification asks for.

    Attributes
    ----------
    name : str
        Such as "odometer scale".
    sigma : (n,) array
        One-sigma at the start, and of the stationary process where it has a correlation time.
    correlation_time : float, s
        Infinite: a constant, or a random walk.
    walk : float
        Density of a random walk, sigma's unit/sqrt(s).
    """

    name: str
    sigma: Array
    correlation_time: float = math.inf
    walk: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigma", np.atleast_1d(np.asarray(self.sigma, dtype=np.float64)))
        if not (np.all(self.sigma >= 0.0) and self.correlation_time > 0.0 and self.walk >= 0.0):
            raise UsageError(f"{self.name}: a sigma, a correlation time or a walk is negative or not a number")


SLOW_GYRO, SLOW_ACCEL = "slow gyro bias", "slow accelerometer bias"
GYRO_SCALE, ACCEL_SCALE = "gyro scale factor", "accelerometer scale factor"


@dataclass(frozen=True)
class InsModel:
    """Noise of an INS, and its states; everything one-sigma, SI.

    Attributes
    ----------
    gyro_random_walk : float, rad/sqrt(s)
    accel_random_walk : float, m/s/sqrt(s)
    gyro_rate_walk, accel_rate_walk : float
        Random walk of the biases, rad/s/sqrt(s) and m/s^2/sqrt(s).
    turn_noise : (2,) tuple, s
        What scale factors and misalignments of the gyros do in turns, as noise: their variances times `TURN_TIME`.
    extras : tuple of Extra
        Further states, in order.
    fixed_altitude : bool
        Height held: its error and that of vertical velocity stay as they are.
    """

    gyro_random_walk: float
    accel_random_walk: float
    gyro_rate_walk: float = 0.0
    accel_rate_walk: float = 0.0
    turn_noise: tuple[float, float] = (0.0, 0.0)
    extras: tuple[Extra, ...] = ()
    fixed_altitude: bool = False

    @classmethod
    def from_spec(
        cls,
        spec: ImuSpec,
        *,
        scale_factors: bool = False,
        extras: tuple[Extra, ...] = (),
        fixed_altitude: bool = False,
    ) -> InsModel:
        """The model of a specification: its bias instabilities are Gauss-Markov states of their own.

        Parameters
        ----------
        spec : ImuSpec
        scale_factors : bool
            States for the scale factors; else they count as noise in turns, as the gyros' misalignments do.
        extras : tuple of Extra
            Of aiding sensors.
        fixed_altitude : bool
        """
        own: list[Extra] = []
        for name, sigma, time in (
            (SLOW_GYRO, spec.gyro_bias_instability, spec.correlation_time),
            (SLOW_ACCEL, spec.accel_bias_instability, spec.correlation_time),
            (GYRO_SCALE, spec.gyro_scale_factor * scale_factors, math.inf),
            (ACCEL_SCALE, spec.accel_scale_factor * scale_factors, math.inf),
        ):
            if sigma > 0.0:
                own.append(Extra(name, np.full(3, sigma), time))
        scale = 0.0 if scale_factors else spec.gyro_scale_factor
        return cls(
            gyro_random_walk=spec.gyro_random_walk,
            accel_random_walk=spec.accel_random_walk,
            turn_noise=(scale**2 * TURN_TIME, spec.gyro_misalignment**2 * TURN_TIME),
            gyro_rate_walk=spec.gyro_rate_random_walk,
            accel_rate_walk=spec.accel_rate_random_walk,
            extras=(*own, *extras),
            fixed_altitude=fixed_altitude,
        )

    @property
    def states(self) -> int:
        """How many."""
        return STATES + sum(len(extra.sigma) for extra in self.extras)

    def slice_of(self, name: str) -> slice | None:
        """Where the states of this name stand; None where the model has none."""
        start = STATES
        for extra in self.extras:
            if extra.name == name:
                return slice(start, start + len(extra.sigma))
            start += len(extra.sigma)
        return None

    def first_of(self, name: str) -> int:
        """The first state of this name, -1 where the model has none: for kernels."""
        found = self.slice_of(name)
        return -1 if found is None else int(found.start)

    @property
    def sensor_states(self) -> NDArray[np.int64]:
        """(4,) what :func:`couple_sensors` asks for."""
        return np.array([self.first_of(name) for name in (SLOW_GYRO, SLOW_ACCEL, GYRO_SCALE, ACCEL_SCALE)])

    @property
    def decay(self) -> Array:
        """(n,) inverse correlation time of each state, 1/s."""
        parts = [np.full(len(extra.sigma), 1.0 / extra.correlation_time) for extra in self.extras]
        return np.concatenate([np.zeros(STATES), *parts])

    @property
    def noise(self) -> Array:
        """(n,) spectral density of the white noise that drives each state, its unit^2/s."""
        q = np.zeros(self.states)
        q[PHI], q[DV] = self.gyro_random_walk**2, self.accel_random_walk**2
        q[BG], q[BA] = self.gyro_rate_walk**2, self.accel_rate_walk**2
        if self.fixed_altitude:
            q[DV.stop - 1] = 0.0
        start = STATES
        for extra in self.extras:
            stop = start + len(extra.sigma)
            q[start:stop] = 2.0 * extra.sigma**2 / extra.correlation_time + extra.walk**2
            start = stop
        return q

    def prior(self, P15: ArrayLike) -> Array:
        """(n, n) covariance at the start: the given one of the fifteen, the extras' own sigmas behind it."""
        P = np.zeros((self.states, self.states))
        P[:STATES, :STATES] = P15
        if self.fixed_altitude:
            P[DV.stop - 1, :] = 0.0
            P[:, DV.stop - 1] = 0.0
        if self.extras:
            P[STATES:, STATES:] = np.diag(np.concatenate([extra.sigma for extra in self.extras]) ** 2)
        return P

    def linearise(
        self,
        T: ArrayLike,
        C_nb: ArrayLike,
        f_n: ArrayLike,
        v_n: ArrayLike,
        lat: ArrayLike,
        alt: ArrayLike,
        w_ib_b: ArrayLike = (0.0, 0.0, 0.0),
    ) -> tuple[Array, Array]:
        """Stack the model over K intervals of a trajectory, in ENU, for :class:`truenorth.filters.LinearSystem`.

        Parameters
        ----------
        T : (K,) array, s
        C_nb : (K, 3, 3) array
            Mean over each interval, as all that follow.
        f_n : (K, 3) array, m/s^2
        v_n : (K, 3) array, m/s
        lat, alt : (K,) arrays, rad and m
        w_ib_b : (K, 3) array, rad/s
            Needed for scale factors and misalignments of the gyros.

        Returns
        -------
        Phi, Q : (K, n, n) arrays
            ``Q = (Phi q Phi' + q) T/2``: the noise's density by the trapezoid.
        """
        T, C, f, v, lat, alt = (np.ascontiguousarray(a, dtype=np.float64) for a in (T, C_nb, f_n, v_n, lat, alt))
        axis = np.stack([np.zeros_like(lat), np.cos(lat), np.sin(lat)], axis=-1)
        w_b = np.ascontiguousarray(np.broadcast_to(np.asarray(w_ib_b, dtype=np.float64), f.shape))
        f_b = np.einsum("kij,ki->kj", C, f)
        n = self.states
        Phi = np.empty((len(T), n, n))
        fixed, at = self.fixed_altitude, self.sensor_states
        _stack(padded(n), T, C, f, f_b, w_b, v, axis, alt, fixed, at, self.decay, Phi)
        q = np.zeros((len(T), n, n))
        q[:] = np.diag(self.noise)
        square = w_b**2
        turning = self.turn_noise[0] * square + self.turn_noise[1] * (square.sum(axis=1, keepdims=True) - square)
        q[:, PHI, PHI] += (C * turning[:, None, :]) @ np.swapaxes(C, 1, 2)
        return Phi, 0.5 * T[:, None, None] * (Phi @ q @ np.swapaxes(Phi, 1, 2) + q)


@compiled
def _stack(
    size: Any,
    T: Any,
    C: Any,
    f_n: Any,
    f_b: Any,
    w_b: Any,
    v: Any,
    axis: Any,
    alt: Any,
    fixed: bool,
    at: Any,
    decay: Any,
    out: Any,
) -> None:
    N, n = len(size), len(decay)
    F, Phi, Phi_t = np.zeros((N, N)), np.zeros((N, N)), np.zeros((N, N))
    for k in range(len(T)):
        error_dynamics(C[k], f_n[k], v[k], axis[k], alt[k], True, fixed, F)
        couple_sensors(C[k], w_b[k], f_b[k], at, fixed, F)
        transition(size, F, decay, T[k], Phi, Phi_t)
        for i in range(n):
            for j in range(n):
                out[k, i, j] = Phi[i, j]
