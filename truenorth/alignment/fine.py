"""Fine alignment: a Kalman filter on the base's mean velocity, re-linearised until it stands still.

From a coarse attitude the log is integrated, linearised about it and filtered; attitude and biases are corrected and
the log is integrated again (Gauss-Newton on the whole log). The velocity of the base is measurement noise: how large
it is, is read from the log itself, axis by axis, by making the innovations as large as the filter expects them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from truenorth.alignment.form import Form
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.position import Position
from truenorth.filters import Estimates, LinearSystem, kalman
from truenorth.filters.gains import Gains, filter_gains, initial_part
from truenorth.models.static import BA, BG, DV, PHI, STATES, StaticModel, mean_velocity
from truenorth.models.static_force import force_system, gained_velocity
from truenorth.records import ImuRecord
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, integrate

Array = NDArray[np.float64]

MAX_PASSES = 8
MAX_NOISE_PASSES = 6
SAME_NOISE = 0.1  # of the expected innovation variance
CONVERGED = 0.02  # a pass that moves no angle by more than this part of its sigma is the last
ROUGHLY = 0.3  # the same part, above which the answer is not to be trusted
LEVEL_PRIOR = 0.1  # rad: coarse alignment levels better than this on any base
HEADING_PRIOR = np.pi / np.sqrt(3.0)  # rad: nothing is known
VELOCITY_PRIOR = 1.0  # m/s: of the base at the first instant
QUIETEST_BASE = 1e-6  # m/s: keeps R positive on a base of stone and an IMU without noise
SLIGHT = 0.01  # of the sensors' variance: what a still base is taken to gain at least
COLOUR_BLOCK = 10  # epochs over which the innovations are added up to see colour
COLOUR_ALARM = 1e-3  # rate at which white innovations pass for coloured
COLOUR_RUNS = 5  # fewer blocks than this say nothing of it


@dataclass(frozen=True)
class FineAlignment:
    """What the last pass of the filter left.

    Attributes
    ----------
    integrals : InertialIntegrals
    C_n0_i : (3, 3) array
        Nominal attitude of the last pass; states are errors of it.
    nominal_bias : (6,) array
        Gyro and accelerometer biases taken off before the last pass.
    system : LinearSystem
    estimates : Estimates
        With the whole history of x and P.
    gains : Gains
        That the filter used.
    floor : (K, n, n) array
        The part of the covariance that the biases alone make, ``P = floor + random``: what waiting does not improve.
    disturbance : (3,) array, m/s
        RMS mean velocity of the base (E, N, U) as the filter took it.
    passes : int
    settled : bool
        Whether the last pass moved nothing by more than a small part of its sigma.
    form : {"velocity", "force"}
        What the innovations and the disturbance are of: the base's mean velocity, or the velocity it gains in an interval.
    """

    integrals: InertialIntegrals
    C_n0_i: Array
    nominal_bias: Array
    system: LinearSystem
    estimates: Estimates
    gains: Gains
    floor: Array
    disturbance: Array
    passes: int
    settled: bool
    form: Form = field(default="velocity", kw_only=True)

    @property
    def x(self) -> Array:
        """(n,) the last state estimate."""
        return self.estimates.x[-1]

    @property
    def P(self) -> Array:
        """(n, n) its covariance."""
        return self.estimates.P[-1]

    @property
    def bias(self) -> Array:
        """(6,) gyro and accelerometer bias at the last epoch."""
        return self.nominal_bias + self.x[6:STATES]

    def misalignment_at(self, C_ib: Array, time: float) -> tuple[Array, Array, Array]:
        """Attitude, misalignment covariance and its floor at any time of the log (smoothed to the end of the data).

        Parameters
        ----------
        C_ib : (3, 3) array
            Integrated attitude at that time.
        time : float, s
            Since the beginning of the first row's interval.

        Returns
        -------
        C_n0_b : (3, 3) array
        covariance, floor : (3, 3) arrays, rad^2, in ``n0``
        """
        J = self._carried_to(time)[PHI]
        C_n0_b = dcm_from_rotation_vector(J @ self.x) @ self.C_n0_i @ C_ib
        return C_n0_b, self.joint_at(time)[PHI, PHI], J @ self.floor[-1] @ J.T

    def joint_at(self, time: float) -> Array:
        """(9, 9) covariance of misalignment (``n0``), gyro and accelerometer bias (body axes) at any time of the log."""
        J = self._carried_to(time)
        P = J @ self.P @ J.T
        apart = abs(self.integrals.time[-1] - time)
        P[PHI, PHI] += self.system.Q[0, PHI, PHI] / self.integrals.intervals[0] * apart
        return np.asarray(P)

    def _carried_to(self, time: float) -> Array:
        """(9, n) misalignment and biases at a time from the last state: the whole log's knowledge carried back to it."""
        J = np.zeros((9, len(self.x)))
        J[PHI, PHI] = np.eye(3)
        J[PHI, BG] = self._turned_between(time)  # phi(t) = phi_end + int_t^end C_n0_b eps
        J[3:6, BG] = J[6:9, BA] = np.eye(3)
        return J

    def departures(self) -> Array:
        """(K, 3) how far the attitude known at each epoch is off the final one at the same time: phi in ``n0``, rad."""
        T = self.integrals.intervals[:, None, None]
        turns = T * (self.C_n0_i @ self.integrals.C_mean)
        # int from each epoch to the end of C_n0_b dt, with the final residual bias: the final answer carried back.
        after = np.concatenate([np.cumsum(turns[:0:-1], axis=0)[::-1], np.zeros((1, 3, 3))])
        return self.x[PHI] + after @ self.x[BG] - self.estimates.x[:, PHI]

    def _turned_between(self, time: float) -> Array:
        """``int C_n0_b dt`` from `time` to the last epoch; negative beyond it."""
        t, T = self.integrals.time, self.integrals.intervals
        C = self.C_n0_i @ self.integrals.C_mean
        part = np.clip((t[1:] - time) / T, 0.0, 1.0)
        inside = np.einsum("k,kab->ab", part * T, C)
        return inside + min(t[-1] - time, 0.0) * C[-1]


def fine_align(
    record: ImuRecord,
    C_n0_i: Array,
    position: Position,
    model: StaticModel,
    P_bias: Array,
    interval: float,
    rows_at: Array | None = None,
    integrals: InertialIntegrals | None = None,
    form: Form = "velocity",
) -> FineAlignment:
    """Estimate attitude and biases from a whole log.

    Parameters
    ----------
    record : ImuRecord
    C_n0_i : (3, 3) array
        Coarse attitude.
    position : Position
    model : StaticModel
    P_bias : (6, 6) array
        Prior covariance of the biases about zero.
    interval : float, s
        Filter interval.
    rows_at : (M,) int array, optional
        Rows after which the integrated attitude is wanted.
    integrals : InertialIntegrals, optional
        Of the log as it is, with `interval` and `rows_at`, where they are known already.
    form : {"velocity", "force"}
        Measure the mean velocity of each interval, or the velocity gained in it.

    Returns
    -------
    FineAlignment
    """
    lat, alt = position.lat, position.alt
    rows = np.zeros(0, dtype=np.int64) if rows_at is None else rows_at
    bias = np.zeros(6)
    P0 = np.zeros((STATES, STATES))
    P0[PHI, PHI] = np.diag([LEVEL_PRIOR**2, LEVEL_PRIOR**2, HEADING_PRIOR**2])
    P0[DV, DV] = VELOCITY_PRIOR**2 * np.eye(3)
    P0[6:, 6:] = P_bias

    if integrals is None:
        integrals = integrate(record, interval, rows_at=rows)
    if form == "velocity":
        R = white_variance(mean_velocity(integrals, C_n0_i, lat, alt))
    else:
        expected = model.accel_random_walk**2 * interval
        R = np.maximum(white_variance(gained_velocity(integrals, C_n0_i, lat, alt)) - expected, SLIGHT * expected)

    for passes in range(1, MAX_PASSES + 1):
        x0 = np.zeros(STATES)
        x0[6:] = -bias
        system = model.linearise(integrals, C_n0_i, lat, alt, P0, R, x0)
        if form == "force":
            system = force_system(system, integrals, C_n0_i, lat, alt, R)
        system, estimates, R = _with_base_variance(system, R)
        x, P = estimates.x[-1], estimates.P[-1]
        moved = float(np.max(np.abs(x[PHI]) / np.sqrt(np.diag(P)[PHI])))
        if moved < CONVERGED or passes == MAX_PASSES:
            break
        # Back to the start: phi(0) = phi(end) + int C_n0_b (eps - nominal); then everything anew about the estimate.
        turned = np.einsum("k,kab->ab", integrals.intervals, C_n0_i @ integrals.C_mean)
        C_n0_i = dcm_from_rotation_vector(x[PHI] + turned @ x[BG]) @ C_n0_i
        bias = bias + np.concatenate([x[BG], x[BA]])
        integrals = integrate(record, interval, bias[:3], bias[3:], rows)

    gains = filter_gains(system, estimates)
    P0_bias = np.zeros((STATES, STATES))
    P0_bias[6:, 6:] = P_bias
    return FineAlignment(
        integrals=integrals,
        C_n0_i=C_n0_i,
        nominal_bias=bias,
        system=system,
        estimates=estimates,
        gains=gains,
        floor=initial_part(gains.step, P0_bias),
        disturbance=np.sqrt(R),
        passes=passes,
        settled=moved < ROUGHLY,
        form=form,
    )


def _with_base_variance(system: LinearSystem, R: Array) -> tuple[LinearSystem, Estimates, Array]:
    """Filter with the variance of the base's velocity that the innovations ask for: first as white, then for its colour."""
    estimates = kalman(system, history="full")
    for colour in (False, True):
        for _ in range(MAX_NOISE_PASSES):
            R_next, expected = base_variance(estimates, R, colour)
            if np.all(np.abs(R_next - R)[:2] < SAME_NOISE * expected[:2]):  # the vertical carries no attitude
                break
            system = replace(system, R=system.R + np.diag(R_next - R))
            R = R_next
            estimates = kalman(system, history="full")
    return system, estimates, R


def white_variance(velocity: Array) -> Array:
    """Variance (3,) of what is white in a velocity (K, 3): half the variance of its differences.

    A start for the variance of the base's motion that slow errors of the INS do not enter; a bias of 100 ug is a difference of
    a mm/s every second.
    """
    return np.maximum(0.5 * np.var(np.diff(velocity, axis=0), axis=0), QUIETEST_BASE**2)


def base_variance(estimates: Estimates, R: Array, colour: bool) -> tuple[Array, Array]:
    """Variance of the base's velocity that makes the innovations as large as expected, at low frequency too.

    Returns it with the mean expected variance of the innovations.
    """
    skip = min(5, len(estimates.innovation) // 5)
    nu = estimates.innovation[skip:]
    expected = np.einsum("kii->ki", estimates.innovation_covariance[skip:])
    ratio = np.mean(nu**2 / expected, axis=0)
    # White innovations add up as their variances. A base that wanders slowly adds up to more, and that is what tilts
    # the answer: then R is what a white noise of that low-frequency density would have. Less is never taken off.
    blocks = len(nu) // COLOUR_BLOCK
    if colour and blocks >= COLOUR_RUNS:
        e = (nu / np.sqrt(expected))[: blocks * COLOUR_BLOCK].reshape(blocks, COLOUR_BLOCK, 3)
        low = np.mean(e.sum(axis=1) ** 2, axis=0) / COLOUR_BLOCK
        chance = chdtri(blocks, COLOUR_ALARM) / blocks  # what white noise itself may give
        # Innovations within it are left alone although they are coloured: a larger R would only colour them more.
        coloured = low > chance * ratio
        ratio = np.where(coloured, np.where(low > chance, np.maximum(low, ratio), np.maximum(ratio, 1.0)), ratio)
    mean = expected.mean(axis=0)
    return np.maximum(R + (ratio - 1.0) * mean, QUIETEST_BASE**2), mean


def attitude_history(fine: FineAlignment, lat: float) -> tuple[Array, Array, Array]:
    """Attitude in n, covariance of the misalignment in n and the biases' part of it, at each epoch, (K, 3, 3) each."""
    t = fine.integrals.time[1:]
    C_n_n0 = np.swapaxes(earth_rotation(t, lat), 1, 2)
    turn = dcm_from_rotation_vector(fine.estimates.x[:, PHI])
    C_nb = C_n_n0 @ turn @ fine.C_n0_i @ fine.integrals.C_ib[1:]
    C_n0_n = np.swapaxes(C_n_n0, 1, 2)
    return C_nb, C_n_n0 @ fine.estimates.P[:, PHI, PHI] @ C_n0_n, C_n_n0 @ fine.floor[:, PHI, PHI] @ C_n0_n
