"""Fine alignment: a Kalman filter on the base's mean velocity, re-linearised until it stands still.

From a coarse attitude the log is integrated, linearised about it and filtered; attitude and biases are corrected and
the log is integrated again (:mod:`truenorth.estimate.batch`). The velocity of the base is measurement noise: how large
it is, is read from the log itself, axis by axis, by making the innovations as large as the filter expects them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector, length_of, quaternion_from_rotation_vector, rotate
from truenorth.core.compiled import compiled
from truenorth.core.position import Position
from truenorth.errors.arm import SLOWEST_SEA
from truenorth.errors.matrices import MATRICES, by_matrix, matrices_of, without_errors
from truenorth.errors.staying import (
    BA,
    BG,
    BIASES,
    PHI,
    QUIETEST_BASE,
    STATES,
    Form,
    StaticModel,
    gained_velocity,
    mean_velocity,
)
from truenorth.estimate.base_motion import FilteredAsKnown, VelocityNoise, white_variance
from truenorth.estimate.batch import ROUGHLY, Filtered, Settled, in_sigmas, settle
from truenorth.estimate.staying import KnownSensors, StayingLog, prior_of
from truenorth.filters import Estimates, LinearSystem
from truenorth.filters.gains import Gains, filter_gains, initial_part
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation

Array = NDArray[np.float64]

MAX_PASSES = 8
BENT_PASSES = 24  # of a log as short as `BEND`, whose heading moves by tens of degrees a pass
MAX_NOISE_PASSES = 6
ARM_PRIOR = 30.0  # m, one sigma along each axis, of a base that sways, where nobody knows the arm
BEND = 2.0 * SLOWEST_SEA  # s: of a turn slower than the sea a log as short as this shows no course of its own
TURN_ARM = 1.0  # m, one sigma along each axis: from the axis of a turntable to the IMU
TURNED = 3.0  # how much of a correction the next pass may move, for each radian that the linearisation turns; twice the most seen
LEVEL = slice(PHI.start, PHI.stop - 1)
SLIGHT = 0.01  # of the sensors' variance: what a still base is taken to gain at least
EXPLAINED = 2.0  # times what accelerometers make by themselves: less is begun with as no motion, which most filters then confirm


@dataclass(frozen=True)
class FineAlignment(Filtered):
    """What the last pass of the filter left; its estimates have the whole history of x and P."""

    integrals: InertialIntegrals
    C_n0_i: Array  # (3, 3): nominal attitude of the last pass; states are errors of it
    # (n,): errors of the sensors (and the arm) taken off before the last pass; zero of attitude and velocity
    taken: Array
    gains: Gains  # that the filter used
    # (n, n): the part of the last covariance that the biases alone make, ``P = floor + random``: what waiting does not improve
    floor: Array
    floors: Array  # (K, 3, 3): of the misalignment, at each epoch
    disturbance: Array  # (3,) m/s: RMS mean velocity of the base (E, N, U) as the filter took it
    passes: int
    settled: bool  # whether another pass would move nothing by more than a small part of its sigma
    # what the innovations and the disturbance are of: the base's mean velocity, or the velocity it gains in an interval
    form: Form

    @classmethod
    def of(cls, log: StayingLog, last: Settled[Filtered], kept: slice, disturbance: Array, **more: Any) -> Self:
        """What the last pass over a log left; `kept` are the states whose prior makes the floor, `more` a subclass's own."""
        system, estimates = last.found.system, last.found.estimates
        P0 = np.zeros((system.states, system.states))
        P0[kept, kept] = log.prior.P[kept, kept]
        if isinstance(last.found, FilteredAsKnown):
            shared = last.found.gains  # of one prior: the part kept decides
            gains: Gains = shared
            floors, floor = shared.once(("floor", kept.start, kept.stop), lambda: initial_part(shared.step, P0, PHI))
        else:
            gains = filter_gains(system, estimates)
            floors, floor = initial_part(gains.step, P0, PHI)
        # What follows needs the noise of the first interval alone; that of all takes memory.
        system = system.with_made(Q=system.Q[:1].copy(), S=None if system.S is None else system.S[:1].copy())
        return cls(
            integrals=log.integrals,
            C_n0_i=log.C_n0_i,
            taken=log.taken,
            system=system,
            estimates=estimates,
            gains=gains,
            floor=floor,
            floors=floors,
            disturbance=disturbance,
            passes=last.passes,
            settled=last.moved < ROUGHLY,
            form=log.form,
            **more,
        )

    def filtered_by(self, system: LinearSystem, estimates: Estimates) -> Self:
        """The same log by another system, and what a filter made of that."""
        return replace(self, system=system, estimates=estimates, gains=filter_gains(system, estimates))

    @property
    def bias(self) -> Array:
        """(6,) gyro and accelerometer bias at the last epoch."""
        return np.asarray(self.taken[BIASES] + self.end[BIASES])

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
        C_n0_b = dcm_from_rotation_vector(J @ self.end) @ self.C_n0_i @ C_ib
        return C_n0_b, J @ self.P @ J.T + self._walked(time), J @ self.floor @ J.T

    @property
    def accel_matrix(self) -> slice:
        """States of the accelerometers' scale factors and misalignments, by rows; none but of an IMU that was turned."""
        turned = len(self.taken) >= STATES + MATRICES
        return slice(STATES + MATRICES // 2, STATES + MATRICES) if turned else slice(STATES, STATES)

    def joint_at(self, time: float, force: Array) -> Array:
        """(9, 9) covariance of misalignment (``n0``), gyro bias and what acts as accelerometer bias at any time of the log.

        Parameters
        ----------
        time : float, s
            Since the beginning of the first row's interval.
        force : (3,) array, m/s^2
            Body axes: at it scale factors and misalignments act as a bias, where they are states.
        """
        J = self._carried_to(time).copy()
        if (own := self.accel_matrix).start < own.stop:
            J[6:9, own] += by_matrix(force)
        P = J @ self.P @ J.T
        P[PHI, PHI] += self._walked(time)
        return np.asarray(P)

    def _walked(self, time: float) -> Array:
        """(3, 3) covariance by which the misalignment walks from a time to the last epoch."""
        apart = abs(self.integrals.time[-1] - time)
        return np.asarray(self.system.Q[0, PHI, PHI] / self.integrals.intervals[0] * apart)

    def _carried_to(self, time: float) -> Array:
        """(9, n) misalignment and biases at a time from the last state: the whole log's knowledge carried back to it."""
        if self._carried[0] == time:
            return self._carried[1]
        J = np.zeros((9, len(self.end)))
        J[PHI, PHI] = np.eye(3)
        J[PHI, BG] = self._turned_between(time)  # phi(t) = phi_end + int_t^end C_n0_b eps
        if len(self.end) > STATES:
            behind, share = self._behind(time)
            J[PHI, STATES:] = -np.einsum("k,kij->ij", share, self.system.Phi[behind, PHI, STATES:])
        J[3:6, BG] = J[6:9, BA] = np.eye(3)
        self._carried[:] = time, J
        return J

    @cached_property
    def _carried(self) -> list[Any]:
        """The last time and what :meth:`_carried_to` gave; an answer asks twice for its epoch."""
        return [None, None]

    def departures(self) -> Array:
        """(K, 3) how far the attitude known at each epoch is off the final one at the same time: phi in ``n0``, rad."""
        turned = self.integrals.intervals[:, None] * (self.integrals.C_mean.reshape(-1, 3) @ self.end[BG]).reshape(
            -1, 3
        )
        # int from each epoch to the end of C_n0_b dt, with the final residual bias: the final answer carried back.
        after = np.zeros_like(turned)
        np.cumsum(turned[:0:-1], axis=0, out=after[-2::-1])
        return np.asarray(self.end[PHI] + after @ self.C_n0_i.T - self.estimates.x[:, PHI])

    def _turned_between(self, time: float) -> Array:
        """``int C_n0_b dt`` from `time` to the last epoch; negative beyond it."""
        behind, share = self._behind(time)
        T, C = self.integrals.intervals[behind], self.integrals.C_mean
        beyond = min(self.integrals.time[-1] - time, 0.0)
        return np.asarray(self.C_n0_i @ (np.einsum("k,kab->ab", share * T, C[behind]) + beyond * C[-1]))

    def _behind(self, time: float) -> tuple[slice, Array]:
        """The intervals that end behind a time, and the share of each that lies behind it."""
        ends, T = self.integrals.time[1:], self.integrals.intervals
        first = int(np.searchsorted(ends, time, side="right"))
        return slice(first, None), np.minimum((ends[first:] - time) / T[first:], 1.0)


class CoarseStart(NamedTuple):
    """What a fine alignment begins from: a log, its coarse attitude, and what is known of its IMU."""

    record: ImuRecord
    C_n0_i: Array  # (3, 3): coarse attitude
    position: Position
    model: StaticModel
    P_bias: Array  # (6, 6): prior covariance of the biases about zero
    interval: float  # s; of the filter
    rows_at: Array | None = None  # (M,) int: rows after which the integrated attitude is wanted
    sensors: KnownSensors | None = None  # coarse errors, to take off to begin with
    shares: bool = (
        False  # whether biases act by the attitude of a cell (:mod:`truenorth.estimate.cells`), of which `P_bias` is
    )

    def right_record(self) -> ImuRecord:
        """The record without the coarse errors of its sensors."""
        if self.sensors is None:
            return self.record
        x = self.sensors.mean
        off = matrices_of(x[6:]) if len(x) > 6 else (np.zeros((3, 3)),) * 2
        return without_errors(self.record, x[:6], *off)


def fine_align(
    start: CoarseStart,
    integrals: InertialIntegrals | None = None,
    form: Form = "velocity",
    turned: ImuSpec | None = None,
    *,
    sways: bool = False,
) -> FineAlignment:
    """Estimate attitude and biases from a whole log.

    Parameters
    ----------
    start : CoarseStart
    integrals : InertialIntegrals, optional
        Of the log as it is, with `interval` and `rows_at`, where they are known already.
    form : {"velocity", "force"}
        Measure the mean velocity of each interval, or the velocity gained in it.
    turned : ImuSpec, optional
        Of an IMU that is turned about on its base: scale factors, misalignments and the arm from the axis of the turns are states
        then, and `P_bias` is of the biases proper.
    sways : bool
        Whether the base sways. The arm from its centre is a state then, and its sway is averaged out of the attitude by which
        biases act (:func:`truenorth.errors.sway.without_sway`): what moves in step with the tilt is no signature of a bias.
    """
    log, last, disturbance = settle_fine(start, integrals, form, turned, sways=sways)
    return FineAlignment.of(log, last, log.prior.sensors, disturbance)


def settle_fine(
    start: CoarseStart,
    integrals: InertialIntegrals | None = None,
    form: Form = "velocity",
    turned: ImuSpec | None = None,
    *,
    sways: bool = False,
    history: bool = True,
) -> tuple[StayingLog, Settled[Filtered], Array]:
    """The log, its last pass and the disturbance of a :func:`fine_align`, where floors and gains (or a history) are not wanted."""
    record, C_n0_i, position, model, P_bias, interval, rows_at, _, shares = start
    arm_sigma = ARM_PRIOR if sways else TURN_ARM
    arm = None if turned is None and not sways else np.zeros(3)
    # Of a log that short the slow turn is a bend, which an arm that waves show would make a bent course, and a tilt, of.
    bent = sways and record.duration <= BEND
    slow_arm = ARM_PRIOR if bent else 0.0
    prior = prior_of(P_bias, spec=turned, arm=arm, arm_sigma=arm_sigma, slow_arm_sigma=slow_arm)
    log = StayingLog(
        record,
        C_n0_i,
        position,
        model,
        prior,
        interval,
        rows_at,
        integrals=integrals,
        sways=sways,
        form=form,
        shares=shares,
    )
    if form == "velocity":
        own, least = model.accel_random_walk**2 * interval / 3.0, QUIETEST_BASE**2
        R = white_variance(mean_velocity(log.integrals, C_n0_i, position.lat, position.alt))
        R = np.where(EXPLAINED * own > R, least, R)
    else:
        expected = model.accel_random_walk**2 * interval
        least = max(SLIGHT * expected, QUIETEST_BASE**2)
        gained = gained_velocity(log.integrals, C_n0_i, position.lat, position.alt)
        R = np.maximum(white_variance(gained) - expected, least)
    if shares:  # no motion, with which the filter is known already: it costs nothing to ask it
        R = np.full(3, least)
    everywhere = np.ones(len(log.integrals.intervals), dtype=np.bool_)
    noise = VelocityNoise(
        np.full((len(everywhere), 3), R), [everywhere], MAX_NOISE_PASSES, history=history, usual=shares
    )
    most = BENT_PASSES if bent else MAX_PASSES
    last = settle(log, noise, left_over(float(log.integrals.time[-1])), most=most)
    return log, last, np.sqrt(noise.R[0])


def left_over(elapsed: float) -> Callable[[Filtered], float]:
    """How much the pass behind a pass over so many seconds would move the misalignment, in sigmas: a measure for `settle`.

    The system depends on the nominal attitude alone. A pass that finds it off by an angle turns the next system by that angle at
    the most, and what is found changes by as much of itself. Of 48 alignments (three grades of IMU, 45 and 75 degrees north, by
    both forms) the next pass moved .1 to 1.4 times the correction and the angle.

    A heading that is not known to a radian moves as it likes: it is not asked.
    """

    def left(found: Filtered) -> float:
        end = found.end
        turned = length_of(end[PHI]) + length_of(end[BG]) * elapsed
        asked = PHI if found.P[PHI, PHI][2, 2] < 1.0 else LEVEL
        return in_sigmas(asked)(found) * min(1.0, TURNED * turned)

    return left


def attitude_history(fine: FineAlignment, lat: float) -> tuple[Array, Array, Array]:
    """Attitude in n, covariance of the misalignment in n and the biases' part of it, at each epoch, (K, 3, 3) each."""
    C_nb, covariance, floor = np.empty((3, len(fine.floors), 3, 3))
    C_n0_n, C_n0_b = earth_rotation(fine.integrals.time[1:], lat), fine.C_n0_i @ fine.integrals.C_ib[1:]
    _turn_each(C_n0_n, C_n0_b, fine.estimates.x, fine.estimates.P, fine.floors, C_nb, covariance, floor)
    return C_nb, covariance, floor


@compiled
def _turn_each(C_n0_n: Any, C_n0_b: Any, x: Any, P: Any, floors: Any, C_nb: Any, covariance: Any, floor: Any) -> None:
    """From ``n0`` to n: attitude without the misalignment that begins the states x, its covariance, and the floor of that."""
    work = np.empty((3, 3))
    for k in range(len(C_nb)):
        q, C = quaternion_from_rotation_vector((x[k, 0], x[k, 1], x[k, 2])), C_n0_n[k]
        for j in range(3):
            axis = rotate(q, (C_n0_b[k, 0, j], C_n0_b[k, 1, j], C_n0_b[k, 2, j]))
            for i in range(3):
                C_nb[k, i, j] = C[0, i] * axis[0] + C[1, i] * axis[1] + C[2, i] * axis[2]
        _turn(C, P[k], work, covariance[k])
        _turn(C, floors[k], work, floor[k])


@compiled
def _turn(C: Any, P: Any, work: Any, turned: Any) -> None:
    """``C' P C`` of the first three rows and columns."""
    for i in range(3):
        for j in range(3):
            work[i, j] = P[i, 0] * C[0, j] + P[i, 1] * C[1, j] + P[i, 2] * C[2, j]
    for i in range(3):
        for j in range(3):
            turned[i, j] = C[0, i] * work[0, j] + C[1, i] * work[1, j] + C[2, i] * work[2, j]
