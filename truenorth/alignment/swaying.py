"""Fine alignment of a base that sways: its lever arm and its own motion are states of the filter.

A windowed least-squares fit, which needs to know nothing of the sway, is re-linearised until it stands still. What it leaves of the
velocity shows how the base moves along each axis (:mod:`truenorth.alignment.motion_fit`); with that a Kalman filter estimates
attitude, biases, lever arm and motion together, about the first answer and the next ones, the motion fitted anew
(:mod:`truenorth.alignment.motion_filter`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import bias_signatures
from truenorth.alignment.circle_passes import settled_on_circle
from truenorth.alignment.fine import ARM_PRIOR, CoarseStart, FineAlignment
from truenorth.alignment.heave import Heave
from truenorth.alignment.late_gyros import response_to_late_gyros
from truenorth.alignment.matched import innovations_of, matched
from truenorth.alignment.motion_filter import MotionFilter, SwingFilter
from truenorth.alignment.motion_likelihood import Walks
from truenorth.alignment.slow_sway import slow_sway_evidence
from truenorth.alignment.sway_noise import noisier_sensors
from truenorth.alignment.swing import may_swing, swings
from truenorth.alignment.swing_fit import ARM
from truenorth.alignment.windowed import BASE_VELOCITY, windowed_fit
from truenorth.coarse import oba
from truenorth.coarse.uncertainty import detrended, own_motion
from truenorth.core.earth import gravity_of_place
from truenorth.core.position import Position
from truenorth.errors.staying import PHI
from truenorth.errors.sway import AxisMotion
from truenorth.estimate.batch import ROUGHLY, settle
from truenorth.estimate.staying import Prior, StayingLog, prior_of
from truenorth.filters import LinearSystem, kalman
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence
from truenorth.strapdown.inertial import InertialIntegrals, gravity_position, integrate

Array = NDArray[np.float64]

WINDOWED_PASSES = 6
SMALL_TURN = 1e-6  # rad: a pass of the windowed fit that turns by less is the last
DIVERGED = 1e-2  # rad: a windowed fit whose last pass turns by more has not settled
FILTER_PASSES = 24  # of gyros with a bias of some earth rates that turn on an indexer; the others settle in five
POOR_PASSES = 60  # of such gyros whose heading is known to 40 deg: it goes on by some degrees a pass
FITS = 5  # of the motion, one a pass: another would make 13 of 14 logs no likelier


@dataclass(frozen=True)
class Mount:
    """How the IMU sits on the base."""

    arm: Array  # (3,) m: from the base's centre of rotation to the IMU, base axes
    arm_sigma: float = 0.0  # m; one sigma along each axis; zero where it is known
    # (K+1, 3, 3): attitude of the base in the IMU at the ends of the filter intervals (an indexer's); None where the two are
    # one
    C_sb: Array | None = None
    # m; one sigma, along each of its axes, of an IMU from the axes of its indexer; zero: on them
    offset_sigma: float = 0.0


UNKNOWN_ARM = Mount(np.zeros(3), ARM_PRIOR)


@dataclass(frozen=True)
class SwayAlignment(FineAlignment):
    """What the last pass of the filter left; see :class:`FineAlignment`."""

    about: StayingLog  # as the last pass was linearised
    estimator: MotionFilter  # that made it
    arm: Array  # (3,) m
    arm_sigma: Array  # (3,) m
    misfit_at: Callable[[Position], float]  # how badly the log fits another place: :func:`misfit_at`
    slow_arm: slice | None = None  # states of the arm of a base that swings on lines; None of another

    # Of several alignments of a log one is the answer: what the others need not know is worked out where it is asked for.

    @property
    def motion(self) -> tuple[AxisMotion, ...]:
        """Along E, N, U."""
        return self.estimator.motion

    @cached_property
    def begun(self) -> tuple[Evidence, ...]:
        """That a slow part of the motion may be something that began within the log."""
        return tuple(slow_sway_evidence(self, self.estimator.full, self.motion, self.estimator.without))

    @cached_property
    def noisier(self) -> Mapping[str, float]:
        """Times its specification, by sensor."""
        return noisier_sensors(self.about, self.motion, self.estimator.interval, self._bias_of)

    @cached_property
    def late(self) -> Array:
        """(K, 3) what gyros that are late add to the measurements, by the second of their delay."""
        return response_to_late_gyros(self.about, self.system.z)

    @cached_property
    def heave(self) -> Heave | None:
        """Of a base that is one with the IMU."""
        return _heave(self.about) if self.about.C_sb is None else None

    def _bias_of(self, system: LinearSystem) -> float:
        """:func:`best_bias` of the log by another system."""
        return best_bias(self.filtered_by(system, kalman(system, history="full")))

    def suspect(self) -> bool:
        """Whether something seems to have begun within the log, or a sensor to be noisier than specified."""
        return any(item.kind != "hint" for item in self.begun) or bool(self.noisier)


@dataclass(frozen=True)
class _Fitted:
    """A windowed fit: errors at the last epoch, and what it leaves of the measurements."""

    end: Array
    residual: Array


def sway_align(
    start: CoarseStart, mount: Mount = UNKNOWN_ARM, turned: ImuSpec | None = None, axes: ImuSpec | None = None
) -> SwayAlignment:
    """Estimate attitude, biases, lever arm and the base's motion from a whole log.

    Parameters
    ----------
    start : CoarseStart
    mount : Mount
        Where the IMU sits.
    turned : ImuSpec, optional
        Of an IMU that is turned about in the base: its scale factors and misalignments are states then.
    axes : ImuSpec, optional
        Whose scale factors and misalignments are states where the log is asked whether it fits another place.
    """
    return swinging(usual_sway(start, mount, turned, axes), start, mount, turned)


def usual_sway(
    start: CoarseStart, mount: Mount = UNKNOWN_ARM, turned: ImuSpec | None = None, axes: ImuSpec | None = None
) -> SwayAlignment:
    """The same of a base that no lines hold; parameters as in :func:`sway_align`."""
    log, estimator = _with_motion(start, mount, turned)
    return _filtered(log, estimator, partial(misfit_at, start, mount, turned or axes))


def swinging(plain: SwayAlignment, start: CoarseStart, mount: Mount, turned: ImuSpec | None) -> SwayAlignment:
    """The alignment of a base that swings on lines, where the log shows that it does; else the one that was found without.

    Parameters
    ----------
    plain : SwayAlignment
        Of :func:`usual_sway`.
    start, mount, turned
        That it was made of.
    """
    log, position = plain.about, start.position
    if not may_swing(plain, position, plain.suspect):
        return plain
    prior = _prior(start, mount, turned, ARM)
    on_lines = StayingLog(
        log.record,
        log.C_n0_i,
        position,
        start.model,
        prior,
        log.interval,
        start.rows_at,
        integrals=log.integrals,
        sways=log.sways,
        C_sb=mount.C_sb,
        taken=np.append(log.taken, np.zeros(len(prior.mean) - len(log.taken))),
    )
    swung = _filtered(on_lines, SwingFilter(plain.estimator, prior.groups["slow arm"]), plain.misfit_at)
    believed = swings(swung, swung.motion, plain, lambda: plain.begun, position) and not swung.suspect()
    return swung if believed else plain


def misfit_at(start: CoarseStart, mount: Mount, turned: ImuSpec | None, position: Position) -> float:
    """Minus twice the logarithm of the likelihood of a whole log in a place, aligned there from its coarse attitude on.

    The motion is fitted until it settles: one fit may be some hundred short of the likeliest motion, which comparisons of places
    cannot have. Nor can they have axes that are taken for perfect: on a raft that turns by 20 deg those of a tactical IMU made the
    other hemisphere likelier by 84, and by none as states. Parameters as in :func:`sway_align`; `start` may be of another place.
    """
    C_n0_i = oba(integrate(start.right_record(), start.interval), position.lat, position.alt, history=False).C_n0_i
    log, estimator = _with_motion(start._replace(C_n0_i=C_n0_i, position=position), mount, turned, FITS)
    last = settle(log, estimator, estimator.moved, most=FILTER_PASSES, least=1 + FITS)
    return -2.0 * float(last.found.estimates.log_likelihood)


def _with_motion(
    start: CoarseStart, mount: Mount, turned: ImuSpec | None, fits: int = 1
) -> tuple[StayingLog, MotionFilter]:
    """A log about its windowed fit, and the filter with the motion that the fit leaves."""
    log, residual = _settled(start, mount, turned)
    model, position = start.model, start.position
    walks = Walks(model.accel_random_walk, model.gyro_random_walk * gravity_of_place(position.lat, position.alt))
    return log, MotionFilter(residual, float(np.mean(log.integrals.intervals)), walks, fits, poor=not log.sways)


def _filtered(log: StayingLog, estimator: MotionFilter, misfit: Callable[[Position], float]) -> SwayAlignment:
    """The log about its last pass."""
    last = settle(log, estimator, estimator.moved, most=FILTER_PASSES if log.sways else POOR_PASSES, least=2)
    if last.moved >= ROUGHLY and log.sways and "matrices" in log.prior.groups:  # of an IMU that was turned
        last = settled_on_circle(log, estimator)
    if not log.sways:  # its passes believe what the sway shows of the sensors: the answer does not
        last = replace(last, found=estimator(log.averaged()))
    position, arm = log.position, log.prior.groups["arm"]
    # The sigma of a slow model is that of its whole life: no more than what the IMU itself did in this log.
    seen = own_motion(log.integrals, log.C_n0_i, position.lat, position.alt)
    return SwayAlignment.of(
        log,
        last,
        log.prior.sensors,
        np.minimum([item.sigma for item in estimator.motion], seen),
        about=log,
        estimator=estimator,
        arm=log.taken[arm] + last.found.end[arm],
        arm_sigma=np.sqrt(np.diag(last.found.P)[arm]),
        misfit_at=misfit,
        slow_arm=log.prior.groups.get("slow arm"),
    )


def _heave(log: StayingLog) -> Heave:
    """Of a log, with the errors of its sensors that were found taken off."""
    return Heave(log.right_record(), log.C_n0_i, log.position, log.noise.accel_random_walk)


def best_bias(fine: SwayAlignment) -> float:
    """Twice the logarithm of the likelihood ratio of the best step or ramp of a bias."""
    return float(matched(innovations_of(fine), bias_signatures(fine))[0].ratio.max())


def farthest(fine: FineAlignment, position: Position) -> float:
    """How far the IMU is from its mean place at most, level, by the last integration of its log, m.

    A slow course of the place is that of errors that are left: a cubic in time is taken off.
    """
    t = fine.integrals.time
    place = fine.integrals.position @ fine.C_n0_i.T + gravity_position(t, position.lat, position.alt)
    return float(np.max(np.linalg.norm(detrended(t, place)[:, :2], axis=1)))


def windowed_align(start: CoarseStart, mount: Mount = UNKNOWN_ARM) -> tuple[Array, InertialIntegrals]:
    """Attitude by windowed least squares alone, re-linearised; parameters as in :func:`sway_align`.

    Returns
    -------
    C_n0_i : (3, 3) array
        At the start.
    integrals : InertialIntegrals
        With the estimated biases taken off: ``C_n0_i @ integrals.C_ib`` is the attitude at their times.
    """
    log, _ = _settled(start, mount)
    return log.C_n0_i, log.integrals


def _settled(start: CoarseStart, mount: Mount, turned: ImuSpec | None = None) -> tuple[StayingLog, Array]:
    """A log about windowed fits until the attitude stands still, and what the last fit leaves of its measurements.

    The fit knows no random walk. Of gyros that make a large one it takes the wander for signal, and its passes may run away:
    then the log is fitted with as little weight as the walk leaves it.
    """
    record, C_n0_i, position, model, _, interval, rows_at, sensors, _ = start
    prior = _prior(start, mount, turned)
    g = gravity_of_place(position.lat, position.alt)
    walked = math.sqrt(record.duration / 3.0) * math.hypot(
        model.accel_random_walk, g * model.gyro_random_walk * record.duration
    )

    def turn(found: _Fitted) -> float:
        return float(np.max(np.abs(found.end[PHI])))

    speeds, most = [BASE_VELOCITY, max(BASE_VELOCITY, walked)], WINDOWED_PASSES
    if sensors is not None:  # such gyros walk that far
        speeds, most = speeds[1:], FILTER_PASSES
    for speed in speeds:
        log = StayingLog(
            record, C_n0_i, position, model, prior, interval, rows_at, sways=sensors is None, C_sb=mount.C_sb
        )
        last = settle(log, partial(_fitted, speed), turn, enough=SMALL_TURN, most=most)
        if last.moved < DIVERGED:
            break
    return log, last.found.residual


def _fitted(base_velocity: float, system: LinearSystem) -> _Fitted:
    found = windowed_fit(system, base_velocity)
    return _Fitted(found.x, found.residual)


def _prior(start: CoarseStart, mount: Mount, turned: ImuSpec | None, slow_arm: float = 0.0) -> Prior:
    prior = prior_of(
        start.P_bias,
        spec=turned,
        arm=mount.arm,
        arm_sigma=mount.arm_sigma,
        offset_sigma=mount.offset_sigma,
        slow_arm_sigma=slow_arm,
    )
    return prior if start.sensors is None else prior.with_sensors(start.sensors)
