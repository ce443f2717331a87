"""A log of a base that stays: what is taken off it, and the linear system of the errors that are left.

States: misalignment, velocity error, gyro and accelerometer bias (:mod:`truenorth.errors.staying`), then groups by name:
``matrices``, the scale factors and misalignments of the sensors, ``arm``, the lever arm, ``offset``, that of the IMU from the axes
of its indexer, along its own axes, and ``rate``, the earth's level rate of an INS that is levelled to some heading.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.indexing import indexer_turns
from truenorth.core.position import Position
from truenorth.core.remembered import remembered
from truenorth.errors.arm import arm_rows, slow_arm_rows, with_arm
from truenorth.errors.level_rate import LEVEL_RATE, with_level_rate
from truenorth.errors.matrices import (
    MATRICES,
    Moments,
    known_moments,
    matrices_of,
    smooth_moments,
    with_matrices,
    without_errors,
)
from truenorth.errors.staying import (
    BG,
    BIASES,
    PHI,
    QUIETEST_BASE,
    STATES,
    Form,
    StaticModel,
    force_system,
    measured_at_rest,
)
from truenorth.errors.sway import without_rocking, without_shaking, without_sway
from truenorth.estimate.cells import cell_of, system_of_cell
from truenorth.filters import LinearSystem
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.prior import joined
from truenorth.strapdown.inertial import InertialIntegrals, integrate

Array = NDArray[np.float64]

LEVEL_PRIOR = 0.1  # rad: coarse alignment levels better than this on any base
HEADING_PRIOR = np.pi / np.sqrt(3.0)  # rad: nothing is known
WIDEST = 1.0  # rad, by which a pass turns heading
VELOCITY_PRIOR = 1.0  # m/s: of the base at the first instant


class KnownSensors(NamedTuple):
    """Errors of the sensors as something has shown them besides a specification."""

    mean: Array  # (6,) biases of gyros and accelerometers, or (24,) with the matrices of both behind
    P: Array  # (6, 6) or (24, 24)


@dataclass(frozen=True)
class Prior:
    """What is known of attitude, velocity and sensors before the log."""

    mean: Array  # (n,): expected errors of the sensors and the arm; zero of misalignment and velocity
    P: Array  # (n, n)
    groups: Mapping[str, slice]  # where the states behind the first twelve stand

    @property
    def sensors(self) -> slice:
        """Biases and, where they are states, the matrices: what can be taken off a record."""
        return slice(BIASES.start, self.groups.get("matrices", BIASES).stop)

    def with_sensors(self, known: KnownSensors) -> Prior:
        """With what is known of the sensors besides."""
        mean, P, s = self.mean.copy(), self.P.copy(), self.sensors
        mean[s], P[s, s] = known
        return replace(self, mean=mean, P=P)


def prior_of(
    P_bias: Array,
    *,
    bias: ArrayLike = (0.0,) * 6,
    spec: ImuSpec | None = None,
    arm: ArrayLike | None = None,
    arm_sigma: float = 0.0,
    offset_sigma: float = 0.0,
    slow_arm_sigma: float = 0.0,
    level_rate: float = 0.0,
) -> Prior:
    """The prior of a base of whose attitude nothing is known but that it is about level.

    Parameters
    ----------
    P_bias : (6, 6) array
        Covariance of what acts as gyro and accelerometer bias.
    bias : (6,) array
        Its expectation.
    spec : ImuSpec, optional
        With it, the sensors' scale factors and misalignments are states, as large as it says.
    arm : (3,) array, m, optional
        With it, the lever arm from the base's centre of rotation to the IMU is a state.
    arm_sigma : float, m
        One sigma along each axis; zero where it is known.
    offset_sigma : float, m
        One sigma of each component of the way from the axes of an indexer to the IMU, which turns with it; zero: it has none.
    slow_arm_sigma : float, m
        One sigma of each component of a level arm by which the slow part of the heading acts, besides the arm; zero: there is none.
    level_rate : float, rad/s
        One sigma, along east and along north, of the earth's level rate where heading is a convention; zero where it is not.
    """
    heading = 0.0 if level_rate else HEADING_PRIOR
    start = np.array([LEVEL_PRIOR, LEVEL_PRIOR, heading, *[VELOCITY_PRIOR] * 3])
    means, blocks, groups = [np.zeros(6), np.asarray(bias, dtype=np.float64)], [start, P_bias], {}
    size = STATES
    if spec is not None:
        one = np.eye(3, dtype=bool)
        gyro = np.where(one, spec.gyro_scale_factor, spec.gyro_misalignment).ravel()
        accel = np.where(one, spec.accel_scale_factor, spec.accel_misalignment).ravel()
        groups["matrices"] = slice(size, size + MATRICES)
        means.append(np.zeros(MATRICES))
        blocks.append(np.concatenate([gyro, accel]))
        size += MATRICES
    if arm is not None:
        groups["arm"] = slice(size, size + 3)
        means.append(np.asarray(arm, dtype=np.float64))
        blocks.append(np.full(3, arm_sigma))
        size += 3
    if offset_sigma:
        groups["offset"] = slice(size, size + 3)
        means.append(np.zeros(3))
        blocks.append(np.full(3, offset_sigma))
        size += 3
    if slow_arm_sigma:
        groups["slow arm"] = slice(size, size + 2)
        means.append(np.zeros(2))
        blocks.append(np.full(2, slow_arm_sigma))
        size += 2
    if level_rate:
        groups["rate"] = slice(size, size + LEVEL_RATE)
        means.append(np.zeros(LEVEL_RATE))
        blocks.append(np.full(LEVEL_RATE, level_rate))
        size += LEVEL_RATE
    return Prior(np.concatenate(means), joined(*blocks), groups)


class StayingLog:
    """A log about a nominal attitude, with nominal errors of the sensors and a nominal arm taken off.

    Parameters
    ----------
    record : ImuRecord
    C_n0_i : (3, 3) array
        Attitude at the start, about.
    position : Position
    noise : StaticModel
    prior : Prior
    interval : float, s
        Filter interval.
    rows_at : (M,) int array
        Rows after which the integrated attitude is wanted.
    integrals : InertialIntegrals, optional
        Of the log as it is, where they are known already.
    sways : bool
        Whether the sway is averaged out of the attitude by which biases act.
    C_sb : (K+1, 3, 3) array, optional
        Attitude of the base in the IMU at the ends of the intervals (an indexer's); the two are one when left out.
    form : {"velocity", "force"}
        Measure the mean velocity of each interval, or the velocity gained in it.
    taken : (n,) array, optional
        Errors to take off to begin with; the prior's mean when left out.
    shares : bool
        Whether biases act by the attitude of a cell, where the log stays in it (:mod:`truenorth.estimate.cells`).

    Attributes
    ----------
    C_n0_i : (3, 3) array
    taken : (n,) array
        Errors taken off; zero of misalignment and velocity.
    integrals : InertialIntegrals
        Of the record without them.
    """

    def __init__(
        self,
        record: ImuRecord,
        C_n0_i: Array,
        position: Position,
        noise: StaticModel,
        prior: Prior,
        interval: float,
        rows_at: Array | None = None,
        *,
        integrals: InertialIntegrals | None = None,
        sways: bool = False,
        C_sb: Array | None = None,
        form: Form = "velocity",
        taken: Array | None = None,
        shares: bool = False,
    ) -> None:
        self.record, self.C_n0_i, self.position, self.noise = record, C_n0_i, position, noise
        self.prior, self.interval, self.form, self.sways, self.C_sb = prior, interval, form, sways, C_sb
        self.shares = shares
        self.rows: Array = np.zeros(0, dtype=np.int64) if rows_at is None else rows_at
        self.taken = (prior.mean if taken is None else taken).copy()
        self._turns = np.zeros((0, 3, MATRICES))
        self.integrals = self._integrated() if integrals is None else integrals

    def with_record(self, record: ImuRecord) -> StayingLog:
        """Another record about the same attitude, with the same errors taken off."""
        return StayingLog(
            record,
            self.C_n0_i,
            self.position,
            self.noise,
            self.prior,
            self.interval,
            self.rows,
            sways=self.sways,
            C_sb=self.C_sb,
            form=self.form,
            taken=self.taken,
            shares=self.shares,
        )

    @property
    def bias(self) -> Array:
        """(6,) gyro and accelerometer bias taken off."""
        return self.taken[BIASES]

    def linearise(self) -> LinearSystem:
        """The system of the errors that are left; of the base's own motion R holds the least that it can be."""
        if self.shares and not (self.sways or self.prior.groups):
            cell = cell_of(self.C_n0_i, self.integrals, self.position.lat)
            if cell is not None:
                return self._of_cell(cell)
        if self.sways:
            if "rate" in self.prior.groups:  # of gyros that do not see the earth turn
                return self._system(without_rocking(self.integrals, self.C_n0_i, self.position.lat))
            return self._system(without_sway(self.integrals, self.C_sb))
        if self.prior.groups:
            return self._system(self.integrals)
        return self._system(without_shaking(self.integrals, self.C_n0_i, self.position.lat))

    def _of_cell(self, cell: Array) -> LinearSystem:
        log, C, lat, alt = self.integrals, self.C_n0_i, self.position.lat, self.position.alt
        common = system_of_cell(cell, self.noise, self.form, log.time, lat, alt)
        z = measured_at_rest(self.form, log, C, lat, alt)
        return common.with_log(z, self.prior.mean - self.taken, np.ascontiguousarray(self.prior.P))

    def averaged(self) -> LinearSystem:
        """The same system of an IMU on an indexer, where a sway shows no error of a sensor: neither a bias nor the matrices.

        About an attitude that is good already. It is no derivative of what a pass does: of biases and scale factors that act
        nearly as one it takes the difference, which its attitude without sway has wrong, and passes by it may run away.
        """
        slow, C_sb = without_sway(self.integrals, self.C_sb), self.C_sb
        turns = indexer_turns(C_sb) if C_sb is not None else np.zeros((len(slow.intervals), 3))
        return self._system(slow, smooth_moments(slow, turns, self.C_n0_i, self.position.lat, self.position.alt))

    def _system(self, slow: InertialIntegrals, moments: Moments | None = None) -> LinearSystem:
        """With the attitude by which biases act, and what the matrices act by."""
        lat, alt, groups = self.position.lat, self.position.alt, self.prior.groups
        P0 = self.prior.P
        system = core_system(
            self.noise, slow, self.integrals, self.C_n0_i, self.position, P0[:STATES, :STATES], self.form
        )
        if "matrices" in groups:
            moments = moments or known_moments(self.right_record, self.integrals)
            system = with_matrices(system, moments, self.integrals, self.C_n0_i, lat)
            self._turns = system.Phi[:, PHI, groups["matrices"]]
        if "arm" in groups:
            rows = arm_rows(self.integrals, self.C_n0_i, lat, self.C_sb)
            system = with_arm(system, rows, self.taken[groups["arm"]])
        if "offset" in groups:
            rows = arm_rows(self.integrals, self.C_n0_i, lat)
            system = with_arm(system, rows, self.taken[groups["offset"]])
        if "slow arm" in groups:
            rows = slow_arm_rows(self.integrals, self.C_n0_i, lat, self.C_sb)
            system = with_arm(system, rows, self.taken[groups["slow arm"]])
        if "rate" in groups:
            system = with_level_rate(system, self.integrals, lat, alt)
        return system.with_made(x0=self.prior.mean - self.taken, P0=P0)

    def correct(self, x: Array) -> None:
        """Take the errors at the last epoch off: of attitude back at the start, of sensors and arm as they are.

        A part of them where they turn heading by more than a radian: farther away the system is another one.
        """
        x = x * min(1.0, WIDEST / max(abs(float(x[PHI][2])), 1e-9))
        back = self.at_start()  # of its own states: those of a base's motion turn nothing
        self.C_n0_i = dcm_from_rotation_vector(back @ x[: back.shape[1]]) @ self.C_n0_i
        # The level rate is no error of a sensor that could be taken off: it stays, and the attitude is right at the end.
        rate = self.prior.groups.get("rate")
        behind = slice(BIASES.start, len(self.taken) if rate is None else rate.start)
        self.taken = self.taken.copy()  # a log that was kept stays as it was
        self.taken[behind] += x[behind]
        self.integrals = self._integrated()

    def at_start(self) -> Array:
        """(3, n) the misalignment at the start by the errors at the last epoch: ``phi(0) = phi + int C_n0_b (eps + M_g w)``."""
        J = np.zeros((3, len(self.prior.mean)))
        J[:, PHI] = np.eye(3)
        J[:, BG] = np.einsum("k,kab->ab", self.integrals.intervals, self.C_n0_i @ self.integrals.C_mean)
        matrices = self.prior.groups.get("matrices")
        if matrices is not None:
            J[:, matrices] = -np.sum(self._turns, axis=0)
        return J

    def right_record(self) -> ImuRecord:
        """The record without the errors of its sensors that are taken off, as increments."""
        matrices = self.prior.groups.get("matrices")
        off = (np.zeros((3, 3)),) * 2 if matrices is None else matrices_of(self.taken[matrices])
        return without_errors(self.record, self.bias, *off)

    def _integrated(self) -> InertialIntegrals:
        if "matrices" in self.prior.groups:
            return integrate(self.right_record(), self.interval, rows_at=self.rows)
        return integrate(self.record, self.interval, self.bias[:3], self.bias[3:], self.rows)


@remembered
def _about(integrals: InertialIntegrals) -> dict[tuple[object, ...], LinearSystem]:
    """The last system of these integrals, by all else that decides it: the check of a log and its alignment begin with the same."""
    return {}


def core_system(
    noise: StaticModel,
    slow: InertialIntegrals,
    integrals: InertialIntegrals,
    C_n0_i: Array,
    position: Position,
    P0: Array,
    form: Form,
) -> LinearSystem:
    """The system of the first twelve states; of the base's own motion R holds the least that it can be.

    Parameters
    ----------
    slow, integrals : InertialIntegrals
        With the attitude by which biases act, and as they are.
    """
    lat, alt = position.lat, position.alt
    about = _about(slow)
    key = noise, C_n0_i.tobytes(), lat, alt
    if key not in about:
        about.clear()
        about[key] = noise.linearise(slow, C_n0_i, lat, alt, P0, np.full(3, QUIETEST_BASE**2))
    system = about[key].with_made(P0=np.ascontiguousarray(P0))
    return force_system(system, integrals, C_n0_i, lat, alt) if form == "force" else system
