"""Error model of an INS on a base that stays where it is: still, shaken or swaying.

States (12), errors computed minus true, in the frozen level frame ``n0``:

| slice | state | unit |
| --- | --- | --- |
| PHI | misalignment phi, ``C_n0_b_hat = (I - [phi x]) C_n0_b`` | rad |
| DV | velocity error | m/s |
| BG | gyro bias eps, body axes | rad/s |
| BA | accelerometer bias nabla, body axes | m/s^2 |

``phi' = -C_n0_b (eps + w_g)``, ``dv' = -g_n0 x phi + C_n0_b (nabla + w_a)``: the 12-state inertial-frame model of
"Rotary SINS self-alignment under dynamic disturbance" (eqs. 30-33), its signs mapped to ours. The force is gravity's
reaction, known exactly, not the measured one: the base's own acceleration in it would be correlated with the base's own
velocity, which is the measurement's noise, and the filter would take their product for knowledge of the azimuth.

The measurement is the *mean* velocity of an interval, in navigation axes: what the INS computes for a base that in
truth goes nowhere. Its noise is the base's own bounded motion. A mean, not a sample, since on a vehicle the engine
shakes the samples; the mean's tie to the states and to the process noise inside the interval is kept exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, wraps
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import skew
from truenorth.core.compiled import borrowing, compiled
from truenorth.core.remembered import remembered
from truenorth.core.vectors import load3, load4, minus4, plus4, store3, store4, times4, zero4
from truenorth.errors.walks import Walks
from truenorth.filters import LinearSystem
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, gravity_position, gravity_velocity

Array = NDArray[np.float64]
Form = Literal["velocity", "force"]
OfNominal = Callable[
    [InertialIntegrals, Array, float, float], Array
]  # of a nominal attitude, at a latitude and an altitude

PHI = slice(0, 3)
DV = slice(3, 6)
BG = slice(6, 9)
BA = slice(9, 12)
BIASES = slice(BG.start, BA.stop)
STARTS = tuple(states.start for states in (PHI, DV, BG, BA))  # for kernels
STATES = 12
QUIETEST_BASE = 1e-6  # m/s: keeps R positive on bedrock and an IMU without noise


@dataclass(frozen=True)
class StaticModel(Walks):
    """The model of a base that stays, by its noise."""

    def linearise(
        self,
        integrals: InertialIntegrals,
        C_n0_i: Array,
        lat: float,
        alt: float,
        P0: Array,
        R: Array,
        x0: Array | None = None,
    ) -> LinearSystem:
        """Stack the model over the K intervals of a log.

        Parameters
        ----------
        integrals : InertialIntegrals
        C_n0_i : (3, 3) array
            The nominal attitude at the start.
        lat, alt : float, rad and m
        P0 : (12, 12) array
            Covariance before the first interval, as it must be: it is not checked.
        R : (3,) array, (m/s)^2
            Variance of the base's mean velocity over an interval (E, N, U).
        x0 : (12,) array, optional
            States before the first interval; zero without it.

        Returns
        -------
        LinearSystem
            ``Phi, Q, H, R, S, z`` with K epochs; `S` ties process noise and measurement within an interval.
        """
        known = _known_of(self, integrals.time.tobytes(), lat, alt)
        count, C_n_n0 = len(integrals.intervals), known.C_n_n0
        Phi, H = np.zeros((count, STATES, STATES)), np.zeros((count, 3, STATES))
        nominal = (np.ascontiguousarray(x) for x in (C_n0_i, integrals.C_mean, integrals.C_late))
        _transitions(integrals.intervals, *nominal, known.f, known.f_late, C_n_n0, Phi, H)
        z = measured_at_rest("velocity", integrals, C_n0_i, lat, alt)
        before = {"x0": np.zeros(STATES) if x0 is None else x0, "P0": np.ascontiguousarray(P0)}
        return known.noise.with_made(Phi=Phi, H=H, R=known.noise.R + np.diag(R), z=z, **before)

    def linearise_at_rest(self, form: Form, time: Array, C_n0_b: Array, lat: float, alt: float) -> LinearSystem:
        """The system of a base that has not turned on the earth, without what was measured; R is that of the quietest base.

        Parameters
        ----------
        form : {"velocity", "force"}
        time : (K+1,) array, s
            Ends of the intervals.
        C_n0_b : (3, 3) array
            Attitude at the start, by which biases act.
        """
        known, T = _known_of(self, time.tobytes(), lat, alt), np.diff(time)
        count = len(T)
        Phi, H = np.zeros((count, STATES, STATES)), np.zeros((count, 3, STATES))
        # The earth turns by 7e-5 rad a second: the mean of an attitude is the one in the middle, to some 1e-10, ...
        mean = earth_rotation((time[1:] + time[:-1]) / 2, lat) @ C_n0_b
        late = 0.5 * (earth_rotation(time[:-1] + T * (2.0 / 3.0), lat) @ C_n0_b)  # ... and int s C ds = T^2/2 C(2T/3)
        _transitions(T, np.eye(3), mean, late, known.f, known.f_late, known.C_n_n0, Phi, H)
        system = known.noise.with_made(Phi=Phi, H=H, R=known.noise.R + QUIETEST_BASE**2 * np.eye(3))
        return system.with_made(**_seen_by_force(system, time, lat)) if form == "force" else system


@compiled
def _transitions(
    T: Any, C_n0_i: Any, C_ib_mean: Any, C_ib_late: Any, f: Any, f_late: Any, C_n_n0: Any, Phi: Any, H: Any
) -> None:
    """Fill ``Phi`` (K, 12, 12) and ``H`` (K, 3, 12), both zero so far.

    Mean velocity error by the states at the interval's end: ``dv(t) = dv_k - int_t^k (f x phi + C nabla)``, f = -g,
    ``phi(t) = phi_k + int_t^k C eps``; averaged, the force counts with its elapsed part s/T of the interval.

    Parameters
    ----------
    T : (K,) array, s
    C_n0_i : (3, 3) array
    C_ib_mean, C_ib_late : (K, 3, 3) arrays
        ``(1/T) int C_ib`` and ``(1/T^2) int s C_ib``.
    f, f_late : (K, 3, 3) arrays
        As of :func:`gravity_force`.
    C_n_n0 : (K, 3, 3) array
    """
    phi, dv, bg, ba = STARTS
    mean, late, own = np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((3, STATES))
    for i in range(3):
        own[i, dv + i] = 1.0
    for k in range(len(T)):
        _turned(C_n0_i, C_ib_mean[k], mean)
        _turned(C_n0_i, C_ib_late[k], late)
        for i in range(STATES):
            Phi[k, i, i] = 1.0
        for i in range(3):
            turned, fallen = zero4(), zero4()
            for r in range(3):
                row = load4(mean, (r, 0))
                turned = plus4(turned, times4(f[k, i, r], row))
                fallen = plus4(fallen, times4(f_late[k, i, r], minus4(row, load4(late, (r, 0)))))
            row = load4(mean, (i, 0))
            store3(Phi, (k, phi + i, bg), times4(-T[k], row))
            store3(Phi, (k, dv + i, phi), times4(T[k], load3(f, (k, i, 0))))
            store3(Phi, (k, dv + i, bg), times4(-2.0 * T[k], fallen))
            store3(Phi, (k, dv + i, ba), times4(T[k], row))
            store3(own, (i, phi), times4(-1.0, load3(f_late, (k, i, 0))))
            store3(own, (i, bg), times4(-(T[k] ** 2) / 6.0, turned))
            store3(own, (i, ba), times4(-T[k], load4(late, (i, 0))))
        _three_rows(C_n_n0[k], own, H[k])


@borrowing(forceinline=True)
def _turned(A: Any, B: Any, C: Any) -> None:
    """``C = A B`` of three rows and columns; `C` has a fourth column, of zeros."""
    for i in range(3):
        total = zero4()
        for r in range(3):
            total = plus4(total, times4(A[i, r], load3(B, (r, 0))))
        store4(C, (i, 0), total)


@borrowing(forceinline=True)
def _three_rows(A: Any, B: Any, C: Any) -> None:
    """``C = A B`` of three rows and `STATES` columns; `C` is neither."""
    for j in range(0, STATES, 4):
        x, y, z = zero4(), zero4(), zero4()
        for k in range(B.shape[0]):
            row = load4(B, (k, j))
            x, y, z = plus4(x, times4(A[0, k], row)), plus4(y, times4(A[1, k], row)), plus4(z, times4(A[2, k], row))
        store4(C, (0, j), x)
        store4(C, (1, j), y)
        store4(C, (2, j), z)


class _Known(NamedTuple):
    """What time and place alone decide: alike in all passes over a log, and in all runs of a campaign."""

    f: Array  # [f x] and
    f_late: Array  # [f_late x], (K, 3, 3), as of :func:`gravity_force`
    C_n_n0: Array  # (K, 3, 3)
    noise: (
        LinearSystem  # whose Q, R (of the noise inside the intervals) and S are known; of the log it knows nothing yet
    )


@lru_cache(maxsize=1)
def _known_of(model: StaticModel, times: bytes, lat: float, alt: float) -> _Known:
    """Noise of a model over intervals between times (of doubles); nobody writes to it."""
    time = np.frombuffer(times)
    T, eye = np.diff(time)[:, None, None], np.eye(3)
    f, f_late = gravity_force(time, lat, alt)
    ff = f @ np.swapaxes(f, 1, 2)
    q_g, q_a = model.gyro_random_walk**2, model.accel_random_walk**2
    # White gyro noise reaches phi at once and dv as a ramp.
    Q = np.zeros((len(T), STATES, STATES))
    Q[:, PHI, PHI] = q_g * T * eye
    Q[:, DV, PHI] = q_g * T**2 / 2 * f
    Q[:, PHI, DV] = np.swapaxes(Q[:, DV, PHI], 1, 2)
    Q[:, DV, DV] = q_a * T * eye + q_g * T**3 / 3 * ff
    Q[:, BG, BG] = model.gyro_rate_walk**2 * T * eye
    Q[:, BA, BA] = model.accel_rate_walk**2 * T * eye
    # Noise inside the interval acts on its mean with the weight (T-s)/T (accelerometers) and (T-s)^2/(2T)
    # (gyros); less what H x_k already holds, -s/T and s^2/(2T) are left: their covariance, and that with Q's.
    R_inside = q_a * T / 3 * eye + q_g * T**3 / 20 * ff
    S = np.zeros((len(T), STATES, 3))
    S[:, PHI] = q_g * T**2 / 6 * np.swapaxes(f, 1, 2)
    S[:, DV] = -q_a * T / 2 * eye + q_g * T**3 / 24 * ff
    C_n_n0 = local_axes(time, lat)
    C_n0_n = np.swapaxes(C_n_n0, 1, 2)
    R, S = C_n_n0 @ R_inside @ C_n0_n, S @ C_n0_n
    one, H, z = np.eye(STATES), np.zeros((1, 3, STATES)), np.zeros((len(T), 3))
    # A variance that is zero may be -1e-21 by rounding; no base is as quiet as that.
    noise = LinearSystem(one[None], Q, H, R + np.eye(3), z, np.zeros(STATES), one, S=S).with_made(R=R)
    return _Known(f, f_late, C_n_n0, noise)


def _known_about(work: OfNominal) -> OfNominal:
    """Remember the last of the same integrals: a check, the choice of a form and a system ask for one about the same attitude."""

    @remembered
    def known(integrals: InertialIntegrals) -> dict[tuple[bytes, float, float], Array]:
        return {}

    @wraps(work)
    def found(integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float) -> Array:
        about, key = known(integrals), (C_n0_i.tobytes(), lat, alt)
        velocity = about.get(key)
        if velocity is None:
            velocity = work(integrals, C_n0_i, lat, alt)
            velocity.flags.writeable = False
            about.clear()
            about[key] = velocity
        return velocity

    return found


@_known_about
def mean_velocity(integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float) -> Array:
    """(K, 3) mean velocity over each interval that the INS computes in ``n0``, m/s; zero for a perfect one at rest. Read-only."""
    p = integrals.position @ C_n0_i.T + gravity_position(integrals.time, lat, alt)
    return np.asarray((p[1:] - p[:-1]) / integrals.intervals[:, None])


def gravity_force(time: Array, lat: float, alt: float) -> tuple[Array, Array]:
    """``[f x]`` (K, 3, 3) of the mean of ``f = -g_n0`` over intervals between times, m/s^2, and of ``(1/T) int s f ds``, m/s."""
    v, p, T = -gravity_velocity(time, lat, alt), -gravity_position(time, lat, alt), np.diff(time)[:, None]
    return skew(np.diff(v, axis=0) / T), skew(v[1:] - np.diff(p, axis=0) / T)


def sampled_velocity(integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float) -> Array:
    """(K+1, 3) velocity at the ends of the intervals that the INS computes in ``n0``, m/s; zero for a perfect one at rest."""
    return np.asarray(integrals.velocity @ C_n0_i.T + gravity_velocity(integrals.time, lat, alt))


@_known_about
def gained_velocity(integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float) -> Array:
    """(K, 3) velocity that the INS gains in each interval in ``n0``, m/s; zero for a perfect one at rest. Read-only."""
    v = sampled_velocity(integrals, C_n0_i, lat, alt)
    return np.asarray(v[1:] - v[:-1])


def local_axes(time: Array, lat: float) -> Array:
    """(K, 3, 3) ``C_n_n0`` at the middle of each interval between times."""
    middle = (time[1:] + time[:-1]) / 2
    return np.asarray(np.swapaxes(earth_rotation(middle, lat), 1, 2))


def sampled_system(core: LinearSystem, z: Array, variance: float) -> LinearSystem:
    """A system observed by the velocity (K, 3) at the ends of the intervals: one state a row, as multiple factors need it."""
    H = np.zeros((1, 3, STATES))
    H[0, :, DV] = np.eye(3)
    return core.with_arrays(H=H, R=variance * np.eye(3)[None], S=None, z=z)


def force_system(
    core: LinearSystem, integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float
) -> LinearSystem:
    """A system of :meth:`StaticModel.linearise` observed by the level accelerometers themselves: the velocity gained.

        z_k = dv_k - dv_{k-1} = int (-g_n0 x phi + C nabla + w_a) dt + (the base's own gain)

    On a base that does not move beyond the noise of its accelerometers it says what the velocity says, and asks nothing of where
    the velocity began; on one that does, the base's motion comes in differentiated, and the velocity form is the better.

    Source: system 4, "Kalman filters for static alignment": its eight states next to its ten.

    Parameters
    ----------
    core : LinearSystem
        Its measurement is left out.
    integrals, C_n0_i, lat, alt
        That it was linearised with.

    Returns
    -------
    LinearSystem
        Whose R holds the variance of the quietest base only.
    """
    z = measured_at_rest("force", integrals, C_n0_i, lat, alt)
    return core.with_made(z=z, **_seen_by_force(core, integrals.time, lat))


def _seen_by_force(core: LinearSystem, time: Array, lat: float) -> dict[str, Array]:
    """``H, R, S`` of :func:`force_system` over intervals between times."""
    C, count = local_axes(time, lat), len(time) - 1
    H, R, S = np.empty((count, 3, STATES)), np.empty((count, 3, 3)), np.empty((count, STATES, 3))
    _gains_of_velocity(core.Phi, core.Q, np.ascontiguousarray(C), H, R, S)
    return {"H": H, "R": R, "S": S}


def measured_at_rest(form: Form, integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float) -> Array:
    """(K, 3) what a form measures, in navigation axes, m/s."""
    found = (mean_velocity if form == "velocity" else gained_velocity)(integrals, C_n0_i, lat, alt)
    return np.asarray((local_axes(integrals.time, lat) @ found[..., None])[..., 0])


@compiled
def _gains_of_velocity(Phi: Any, Q: Any, C: Any, H: Any, R: Any, S: Any) -> None:
    """The measurement of :func:`force_system`, of ``Phi`` and ``Q`` (K, 12, 12) in axes ``C_n_n0`` (K, 3, 3).

    ``z = J x_{k-1} + w_dv``, and ``x_{k-1} = Phi^-1 (x_k - w)``: by the state after the interval, as the filter has it,
    ``z = J Phi^-1 x_k + (E - J Phi^-1) w`` with ``E`` the rows of velocity. ``Phi = I + N``, whose only chain is from gyro bias by
    misalignment to velocity: ``J Phi^-1 = J - J N``.
    """
    phi, dv, bg, _ = STARTS
    back, own, work, noise = np.zeros((3, STATES)), np.zeros((3, STATES)), np.zeros((3, STATES)), np.zeros((3, 3))
    for k in range(len(Phi)):
        for i in range(3):
            for j in range(STATES):
                back[i, j] = Phi[k, dv + i, j]
            back[i, dv + i] -= 1.0
        for i in range(3):
            for j in range(3):
                for r in range(3):
                    back[i, bg + j] -= back[i, phi + r] * Phi[k, phi + r, bg + j]
        for i in range(3):
            for j in range(STATES):
                own[i, j] = -back[i, j]
            own[i, dv + i] += 1.0
        _three_rows(C[k], back, H[k])
        _three_rows(C[k], own, work)
        _three_rows(work, Q[k], own)  # C (E - J Phi^-1) Q: the transpose of S, as Q is symmetric
        for i in range(3):
            for j in range(STATES):
                S[k, j, i] = own[i, j]
            for j in range(3):
                noise[i, j] = 0.0
                for r in range(STATES):
                    noise[i, j] += own[i, r] * work[j, r]
        for i in range(3):
            for j in range(3):
                R[k, i, j] = 0.5 * (noise[i, j] + noise[j, i])
            R[k, i, i] += QUIETEST_BASE**2


def grown(system: LinearSystem, n: int) -> dict[str, Array]:
    """Arrays of a system with more states behind its own, zero so far."""
    K, old, rows = len(system.z), system.states, system.rows
    shapes = {"Phi": (K, n, n), "Q": (K, n, n), "H": (K, rows, n), "S": (K, n, rows), "P0": (n, n), "x0": (n,)}
    arrays = {name: np.zeros(shape) for name, shape in shapes.items()}
    own = slice(0, old)
    arrays["Phi"][:, own, own], arrays["Q"][:, own, own], arrays["H"][:, :, own] = system.Phi, system.Q, system.H
    arrays["P0"][own, own], arrays["x0"][own] = system.P0, system.x0
    if system.S is not None:
        arrays["S"][:, own] = system.S
    return arrays
