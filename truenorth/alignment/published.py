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
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.task import Task
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.errors import AlignmentError
from truenorth.core.position import Position
from truenorth.errors import stationary
from truenorth.errors.stationary import StationaryModel
from truenorth.errors.staying import PHI, StaticModel, gained_velocity, sampled_system, sampled_velocity
from truenorth.estimate.base_motion import QUIETEST_BASE, white_variance
from truenorth.estimate.batch import CONVERGED, ROUGHLY, Filtered, in_sigmas, settle
from truenorth.estimate.staying import HEADING_PRIOR, LEVEL_PRIOR, VELOCITY_PRIOR, StayingLog, prior_of
from truenorth.filters import Estimates, LinearSystem, fading, filter_gains, kalman
from truenorth.filters.fading import Fading
from truenorth.filters.gains import initial_part
from truenorth.records import ImuRecord
from truenorth.strapdown.inertial import earth_rotation, integrate
from truenorth.strapdown.level import NavigationState, mechanise

Array = NDArray[np.float64]
Published = Literal["kf", "sakf", "makf", "imakf", "states10", "states8"]

# Kind of fading of each; SAKF of the paper's introduction corrects the measurement noise.
FADING: dict[str, Fading | None] = {"kf": None, "sakf": "noise", "makf": "multiple", "imakf": "improved"}
STATIONARY = {"states10": 10, "states8": 8}
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


def faded_align(
    record: ImuRecord,
    C_n0_i: Array,
    position: Position,
    model: StaticModel,
    P_bias: Array,
    interval: float,
    rows_at: Array,
    method: str,
    arm_velocity: Array | None = None,
) -> FineAlignment:
    """Align by kf, sakf, makf or imakf; arguments as :func:`truenorth.alignment.fine.fine_align` and of `SampledLog`."""
    kind, prior = FADING[method], prior_of(P_bias)
    log = SampledLog(record, C_n0_i, position, model, prior, interval, rows_at)
    log.arm_velocity = arm_velocity

    def plain(system: LinearSystem) -> Filtered:
        return Filtered(system, kalman(system, history="full"))

    def faded(system: LinearSystem) -> Filtered:
        return plain(system) if kind is None else Filtered(system, fading(system, kind=kind, history="full"))

    last = settle(log, faded, in_sigmas(PHI), most=PASSES)
    # The floor is that of the filter without factors.
    unfaded = replace(last, found=plain(last.found.system))
    fine = FineAlignment.of(log, unfaded, prior.sensors, np.full(3, math.sqrt(log.R)))
    return replace(fine, estimates=_allowing(last.found.estimates, fine.estimates))


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
    n, lat, alt = STATIONARY[method], task.position.lat, task.position.alt
    tilt = math.acos(min(1.0, float(C_n0_i[2, 2])))
    if task.motion.overall != "still" or tilt > LEVEL_IMU:
        raise AlignmentError(
            f"{task.record.source}: the base is {task.motion.overall}, the IMU tilted by {math.degrees(tilt):.1f} deg; the method "
            f"{method} holds for a still base and an IMU level to {math.degrees(LEVEL_IMU):g} deg: choose another method"
        )
    walks = StationaryModel(lat, alt, model)
    whole = np.diag([LEVEL_PRIOR**2] * 2 + [HEADING_PRIOR**2] + [VELOCITY_PRIOR**2] * 2 + [0.0] * 5)
    whole[BIASES, BIASES] = P_bias[:5, :5]
    kept = stationary.KEPT[n]
    P0, biases = whole[np.ix_(kept, kept)], slice(n - 5, n)
    every = max(1, round(task.interval / task.record.interval))
    T = every * task.record.interval
    bias = np.zeros(6)
    for _ in range(PASSES):
        start = NavigationState.at(C_n0_i, lat, task.position.lon, alt)
        out = mechanise(task.record, start, altitude="fixed", every=every)
        C_nb = out.C_nb if n == 10 else _by_gyros(task, C_n0_i, T, len(out.time))
        Phi, Q = walks.discrete(T, C_nb[-1], n)
        if n == 10:
            z, H, noise = out.v_n[:, :2], np.eye(10)[stationary.DV], 0.0
        else:
            integrals = integrate(task.record, T)
            z = gained_velocity(integrals, C_n0_i, lat, alt)[: len(out.time), :2] / T
            H, noise = walks.accelerometer_rows(C_nb[-1]), model.accel_random_walk**2 / T
        R = np.diag(np.maximum(white_variance(z), QUIETEST_BASE**2) + noise)
        system = LinearSystem(Phi=Phi[None], Q=Q[None], H=H[None], R=R[None], z=z, x0=np.zeros(n), P0=P0)
        estimates = kalman(system, history="full")
        x, P = estimates.x[-1], estimates.P[-1]
        bias = np.append(x[biases], math.nan)
        end = float(out.time[-1] - task.record.time[0] + task.record.steps[0])
        rows = np.array([task.epoch.row, len(out.time) * every - 1])
        inside = integrate(task.record, task.interval, bias[:3], np.zeros(3), rows)
        C_n0_n = earth_rotation(end, lat)
        moved = float(np.max(np.abs(x[:3]) / np.sqrt(np.diag(P)[:3])))
        C_n0_i = C_n0_n @ dcm_from_rotation_vector(x[:3]) @ C_nb[-1] @ inside.C_ib_at[1].T
        if moved < CONVERGED:
            break
    P_floor = P0.copy()
    P_floor[: biases.start, : biases.start] = 0.0
    floor = initial_part(filter_gains(system, estimates).step, P_floor)[-1]
    sigma = np.append(np.sqrt(np.diag(P)[biases]), math.nan)
    return Stationary(
        C_n0_i @ task.epoch.attitude(inside.C_ib_at[0]),
        C_n0_n @ P[:3, :3] @ C_n0_n.T,
        C_n0_n @ floor[:3, :3] @ C_n0_n.T,
        bias,
        sigma,
        moved < ROUGHLY,
    )


def _by_gyros(task: Task, C_n0_i: Array, T: float, count: int) -> Array:
    """(K, 3, 3) attitude of a platform that turns with gyros and earth alone, fed by no velocity."""
    integrals = integrate(task.record, T)
    t = integrals.time[1 : count + 1]
    return np.asarray(np.swapaxes(earth_rotation(t, task.position.lat), 1, 2) @ C_n0_i @ integrals.C_ib[1 : count + 1])
