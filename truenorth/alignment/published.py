"""Published filters of a base that stays, as their papers have them, on one's own log.

=========  =====================================================================================================
method     what it assumes
=========  =====================================================================================================
kf         12 states observed by sampled velocity; what the base moves is white noise of one size
sakf       the same; one factor enlarges the measurement noise where innovations are larger than expected
makf       the same; a factor for each measured velocity enlarges what is predicted from the past, without Q
imakf      the same; the factors enlarge Q too
states10   an INS at rest in the local level, 10 states observed by its velocity; still, level IMU
states8    the same without velocity, 8 states observed by the level accelerometers; still, level IMU
=========  =====================================================================================================

On an indexer the first four take the lever arm as known, as their paper does (:func:`turned_arm_velocity`).

All begin from optimisation-based alignment of the same log and go over it again from what they found, so that their start
is not an assumption; nothing is known of the heading before. The size of what the base moves is read from the log, and the
sigma of makf and imakf allows for what their factors moved. They are here to be compared: `kalman` and `swaying` of this
library know more of the base.

Sources: "Rotary SINS self-alignment under dynamic disturbance" (the first four; their lever arm is not known here);
"Kalman filters for static alignment" (the last two).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.assumptions import FADING, STATIONARY
from truenorth.alignment.fine import CoarseStart, FineAlignment
from truenorth.alignment.task import Task
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.errors import AlignmentError
from truenorth.errors import stationary
from truenorth.errors.stationary import StationaryModel
from truenorth.errors.staying import PHI, StaticModel, gained_velocity, sampled_system, sampled_velocity
from truenorth.estimate.base_motion import QUIETEST_BASE, white_variance
from truenorth.estimate.batch import ROUGHLY, Filtered, in_sigmas, settle
from truenorth.estimate.staying import HEADING_PRIOR, LEVEL_PRIOR, VELOCITY_PRIOR, StayingLog, prior_of
from truenorth.filters import Estimates, LinearSystem, fading, filter_gains, kalman
from truenorth.filters.gains import initial_part
from truenorth.records import ImuRecord
from truenorth.state.state import State
from truenorth.strapdown.inertial import earth_rotation, integrate
from truenorth.strapdown.level import mechanise

Array = NDArray[np.float64]
PASSES = 3
BIASES = slice(stationary.BG.start, stationary.BA.stop)
LEVEL_IMU = math.radians(5.0)  # a tilt up to which the two level accelerometers are those of the model


class SampledLog(StayingLog):
    """A log observed by its velocity at the ends of the intervals: one state a row, as multiple factors need it."""

    R: float = 0.0  # (m/s)^2
    arm_velocity: Array | None = None  # (K+1, 3) m/s: what a known lever arm makes, in the IMU's frame at the start

    def linearise(self) -> LinearSystem:
        """The static model with the size of what the base moves read from the log."""
        velocity = sampled_velocity(self.integrals, self.C_n0_i, self.position.lat, self.position.alt)[1:]
        if self.arm_velocity is not None:
            velocity = velocity - (self.arm_velocity[1:] - self.arm_velocity[0]) @ self.C_n0_i.T
        self.R = max(float(np.mean(white_variance(velocity))), QUIETEST_BASE**2)
        return sampled_system(super().linearise(), velocity, self.R)


def _plain(system: LinearSystem) -> Filtered:
    return Filtered(system, kalman(system, history="full"))


def faded_align(start: CoarseStart, method: str, arm_velocity: Array | None = None) -> FineAlignment:
    """Align by kf, sakf, makf or imakf; `arm_velocity` is that of `SampledLog`."""
    record, C_n0_i, position, model, P_bias, interval, rows_at, *_ = start
    kind, prior = FADING[method], prior_of(P_bias)
    log = SampledLog(record, C_n0_i, position, model, prior, interval, rows_at)
    log.arm_velocity = arm_velocity

    def faded(system: LinearSystem) -> Filtered:
        return _plain(system) if kind is None else Filtered(system, fading(system, kind=kind, history="full"))

    last = settle(log, faded, in_sigmas(PHI), most=PASSES)
    # The floor is that of the filter without factors.
    unfaded = replace(last, found=_plain(last.found.system))
    fine = FineAlignment.of(log, unfaded, prior.sensors, np.full(3, math.sqrt(log.R)))
    return replace(fine, estimates=_allowing(last.found.estimates, fine.estimates))


def factor_share(fine: FineAlignment) -> float | None:
    """Share of the epochs in which a factor was above 1; None of a filter without factors."""
    factors = fine.estimates.adaptation
    return float(np.mean(np.any(factors > 1.0, axis=-1))) if factors.shape[-1] else None


def turned_arm_velocity(record: ImuRecord, C_sb: Callable[[Array], Array], arm: Array, interval: float) -> Array:
    """(K+1, 3) velocity that a lever arm in a body makes of an IMU that turns in it, at the ends of the filter's intervals.

    Parameters
    ----------
    C_sb : callable
        (M, 3, 3) attitude of the body in the IMU at times (M,).
    arm : (3,) array, m
        From the body's centre of rotation to the IMU, body axes.
    """
    step = record.interval
    ends = integrate(record, interval).time[1:]
    rows = np.concatenate([[0], np.searchsorted(record.time, record.time[0] - step + ends + 0.5 * step) - 1])
    around = np.clip(rows[:, None] + np.array([-1, 0, 1]), 0, len(record) - 1)
    C_is = integrate(record, interval, rows_at=around.ravel()).C_ib_at.reshape(-1, 3, 3, 3)
    C_bs = np.swapaxes(C_sb(record.time[around.ravel()]), 1, 2).reshape(-1, 3, 3, 3)
    apart = record.time[around[:, 2]] - record.time[around[:, 0]]
    C_ib = C_is @ np.swapaxes(C_bs, -1, -2)
    return np.asarray((C_ib[:, 2] - C_ib[:, 0]) @ arm / apart[:, None])


def _allowing(faded: Estimates, plain: Estimates) -> Estimates:
    """The estimates with an allowance for what the factors themselves moved: the difference to the filter without them.

    Factors take the colour of a sway for news of the state. Their own covariance knows nothing of that: on a base that sways it
    was a sixteenth of the error.
    """
    apart = faded.x - plain.x
    P = faded.P + apart[..., :, None] * apart[..., None, :]
    return replace(faded, P=P, sigma=np.sqrt(np.einsum("...ii->...i", P)))


class Stationary(NamedTuple):
    """What a filter of ten or eight states found."""

    C_n0_b: Array  # (3, 3): at the epoch
    covariance: Array  # (3, 3) rad^2: of phi in ``n0``, and the part of it that the biases make
    floor: Array  # (3, 3) rad^2
    bias: Array  # (6,): gyros, accelerometers; that of the vertical accelerometer is no state and stays NaN
    bias_sigma: Array  # (6,)
    settled: bool


class StationaryLog:
    """An INS at rest in the local level: ten states observed by its velocity, or eight by the level accelerometers."""

    def __init__(self, task: Task, C_n0_i: Array, model: StaticModel, P_bias: Array, states: int) -> None:
        self.task, self.C_n0_i, self.model, self.states = task, C_n0_i, model, states
        self.biases = slice(states - 5, states)
        self.every = max(1, round(task.interval / task.record.interval))
        whole = np.diag([LEVEL_PRIOR**2] * 2 + [HEADING_PRIOR**2] + [VELOCITY_PRIOR**2] * 2 + [0.0] * 5)
        whole[BIASES, BIASES] = P_bias[:5, :5]
        kept = stationary.KEPT[states]
        self.P0 = whole[np.ix_(kept, kept)]

    def linearise(self) -> LinearSystem:
        """The model about the attitude that the gyros carry on from the start."""
        record, place, n = self.task.record, self.task.position, self.states
        walks, T = StationaryModel(place.lat, place.alt, self.model), self.every * record.interval
        start = State.at(self.C_n0_i, place.lat, place.lon, place.alt)
        out = mechanise(record, start, altitude="fixed", every=self.every)
        count = len(out.time)
        C_nb = out.C_nb if n == 10 else _by_gyros(self.task, self.C_n0_i, T, count)
        self.last, self.C_end = count * self.every - 1, C_nb[-1]
        self.C_n0_n = earth_rotation(float(out.time[-1] - record.time[0] + record.steps[0]), place.lat)
        Phi, Q = walks.discrete(T, self.C_end, n)
        if n == 10:
            z, H, noise = out.v_n[:, :2], np.eye(10)[stationary.DV], 0.0
        else:
            z = gained_velocity(integrate(record, T), self.C_n0_i, place.lat, place.alt)[:count, :2] / T
            H, noise = walks.accelerometer_rows(self.C_end), self.model.accel_random_walk**2 / T
        R = np.diag(np.maximum(white_variance(z), QUIETEST_BASE**2) + noise)
        return LinearSystem(Phi=Phi[None], Q=Q[None], H=H[None], R=R[None], z=z, x0=np.zeros(n), P0=self.P0)

    def correct(self, x: Array) -> None:
        """Begin with the attitude that the errors at the end say."""
        self.C_n0_i, _ = self.begun(x)

    def begun(self, x: Array) -> tuple[Array, Array]:
        """Attitude at the first sample by the errors (n,) at the end, and that of the task's epoch against it, (3, 3) each."""
        rows = np.array([self.task.epoch.row, self.last])
        C_ib = integrate(self.task.record, self.task.interval, x[self.biases][:3], np.zeros(3), rows).C_ib_at
        return self.C_n0_n @ dcm_from_rotation_vector(x[PHI]) @ self.C_end @ C_ib[1].T, C_ib[0]


def stationary_align(task: Task, C_n0_i: Array, model: StaticModel, P_bias: Array, method: str) -> Stationary:
    """Align by states10 or states8.

    Parameters
    ----------
    C_n0_i : (3, 3) array
        Coarse attitude at the first sample.
    model : StaticModel
        Noise of the sensors.
    P_bias : (6, 6) array
    method : {"states10", "states8"}

    Raises
    ------
    AlignmentError
        A base that moves, or an IMU that is not level: outside what the model holds for.
    """
    tilt = math.acos(min(1.0, float(C_n0_i[2, 2])))
    if task.motion.overall != "still" or tilt > LEVEL_IMU:
        raise AlignmentError(
            f"{task.record.source}: the base is {task.motion.overall}, the IMU tilted by {math.degrees(tilt):.1f} deg; the method "
            f"{method} holds for a still base and an IMU level to {math.degrees(LEVEL_IMU):g} deg: choose another method"
        )
    log = StationaryLog(task, C_n0_i, model, P_bias, STATIONARY[method])
    last = settle(log, _plain, in_sigmas(PHI), most=PASSES)
    found, C_n0_n = last.found, log.C_n0_n
    C_n0_i, C_ib = log.begun(found.end)
    P_floor = log.P0.copy()
    P_floor[: log.biases.start, : log.biases.start] = 0.0
    _, floor = initial_part(filter_gains(found.system, found.estimates).step, P_floor, PHI)
    return Stationary(
        C_n0_i @ task.epoch.attitude(C_ib),
        C_n0_n @ found.P[PHI, PHI] @ C_n0_n.T,
        C_n0_n @ floor[PHI, PHI] @ C_n0_n.T,
        np.append(found.end[log.biases], math.nan),
        np.append(np.sqrt(np.diag(found.P)[log.biases]), math.nan),
        last.moved < ROUGHLY,
    )


def _by_gyros(task: Task, C_n0_i: Array, T: float, count: int) -> Array:
    """(K, 3, 3) attitude of a platform that turns with gyros and earth alone, fed by no velocity."""
    integrals = integrate(task.record, T)
    t = integrals.time[1 : count + 1]
    return np.asarray(np.swapaxes(earth_rotation(t, task.position.lat), 1, 2) @ C_n0_i @ integrals.C_ib[1 : count + 1])
