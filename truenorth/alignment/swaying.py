"""Fine alignment of a base that sways: its lever arm and its own motion are states of the filter.

A windowed least-squares fit, which needs to know nothing of the sway, is re-linearised until it stands still. What it leaves of the
velocity tells how the base moves along each axis (:mod:`truenorth.alignment.motion_fit`); with that a Kalman filter estimates
attitude, biases, lever arm and motion together, twice: the second time about the first answer, the motion fitted anew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.alignment.fine import (
    CONVERGED,
    HEADING_PRIOR,
    LEVEL_PRIOR,
    QUIETEST_BASE,
    ROUGHLY,
    VELOCITY_PRIOR,
    FineAlignment,
)
from truenorth.alignment.motion_fit import fit_motion
from truenorth.alignment.motion_likelihood import Walks
from truenorth.alignment.windowed import windowed_fit
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import normal_gravity
from truenorth.core.position import Position
from truenorth.filters import LinearSystem, kalman
from truenorth.filters.gains import filter_gains, initial_part
from truenorth.models.disturbance import AxisMotion
from truenorth.models.static import BA, BG, DV, PHI, STATES, StaticModel
from truenorth.models.swaying import (
    ARM,
    MOST_OSCILLATORS,
    SWAYING_STATES,
    arm_rows,
    with_arm,
    with_motion,
    without_sway,
)
from truenorth.records import ImuRecord
from truenorth.strapdown.inertial import InertialIntegrals, integrate

Array = NDArray[np.float64]

ARM_PRIOR = 30.0  # m, one sigma along each axis, where nobody knows the arm
WINDOWED_PASSES = 6
SMALL_TURN = 1e-6  # rad: a pass of the windowed fit that turns by less is the last
FILTER_PASSES = 3


@dataclass(frozen=True)
class Mount:
    """How the IMU sits on the base.

    Attributes
    ----------
    arm : (3,) array, m
        From the base's centre of rotation to the IMU, base axes.
    arm_sigma : float, m
        One sigma along each axis; zero where it is known.
    C_sb : (K+1, 3, 3) array or None
        Attitude of the base in the IMU at the ends of the filter intervals (an indexer's); None where the two are one.
    """

    arm: Array
    arm_sigma: float = 0.0
    C_sb: Array | None = None


UNKNOWN_ARM = Mount(np.zeros(3), ARM_PRIOR)


@dataclass(frozen=True)
class SwayAlignment(FineAlignment):
    """What the last pass of the filter left; see :class:`FineAlignment`.

    Attributes
    ----------
    motion : tuple of three AxisMotion
        Along E, N, U.
    arm, arm_sigma : (3,) arrays, m
    """

    motion: tuple[AxisMotion, ...]
    arm: Array
    arm_sigma: Array


class _Nominal:
    """What the log is linearised about, and the system about it."""

    def __init__(
        self, record: ImuRecord, C_n0_i: Array, position: Position, model: StaticModel, mount: Mount, P_bias: Array
    ) -> None:
        self.record, self.position, self.model, self.mount = record, position, model, mount
        self.P0 = np.zeros((ARM.stop, ARM.stop))
        self.P0[PHI, PHI] = np.diag([LEVEL_PRIOR**2, LEVEL_PRIOR**2, HEADING_PRIOR**2])
        self.P0[DV, DV] = VELOCITY_PRIOR**2 * np.eye(3)
        self.P0[6:STATES, 6:STATES] = P_bias
        self.P0[ARM, ARM] = mount.arm_sigma**2 * np.eye(3)
        self.C_n0_i, self.bias, self.arm = C_n0_i, np.zeros(6), mount.arm
        self.integrals: InertialIntegrals

    def integrate(self, interval: float, rows: ArrayLike) -> None:
        """Anew, the biases taken off."""
        self.integrals = integrate(self.record, interval, self.bias[:3], self.bias[3:], rows)

    def system(self) -> LinearSystem:
        """Of 15 states, without the base's motion."""
        place = self.position
        system = self.model.linearise(
            without_sway(self.integrals, self.mount.C_sb),
            self.C_n0_i,
            place.lat,
            place.alt,
            self.P0[:STATES, :STATES],
            np.zeros(3),
        )
        x0 = np.zeros(STATES)
        x0[6:] = -self.bias
        rows = arm_rows(self.integrals, self.C_n0_i, place.lat, self.mount.C_sb)
        system = with_arm(replace(system, x0=x0), rows, self.arm, self.P0[ARM, ARM])
        system.x0[ARM] = self.arm - self.mount.arm
        return system

    def correct(self, x: Array) -> None:
        """Take the state at the last epoch off: attitude back at the start, biases, arm."""
        turned = np.einsum("k,kab->ab", self.integrals.intervals, self.C_n0_i @ self.integrals.C_mean)
        self.C_n0_i = dcm_from_rotation_vector(x[PHI] + turned @ x[BG]) @ self.C_n0_i
        self.bias = self.bias + np.concatenate([x[BG], x[BA]])
        self.arm = self.arm - x[ARM]


def sway_align(
    record: ImuRecord,
    C_n0_i: Array,
    position: Position,
    model: StaticModel,
    P_bias: Array,
    interval: float,
    rows_at: Array | None = None,
    mount: Mount = UNKNOWN_ARM,
) -> SwayAlignment:
    """Estimate attitude, biases, lever arm and the base's motion from a whole log.

    Parameters
    ----------
    record, C_n0_i, position, model, P_bias, interval, rows_at
        As in :func:`truenorth.alignment.fine.fine_align`.
    mount : Mount

    Returns
    -------
    SwayAlignment
    """
    rows = np.zeros(0, dtype=np.int64) if rows_at is None else rows_at
    nominal = _Nominal(record, C_n0_i, position, model, mount, P_bias)
    system, residual = _settle(nominal, interval, rows)
    step = float(np.mean(nominal.integrals.intervals))
    walks = Walks(model.accel_random_walk, model.gyro_random_walk * float(normal_gravity(position.lat, position.alt)))
    motion = _fit(residual, step, walks)
    for passes in range(1, FILTER_PASSES + 1):
        full = with_motion(system, step, motion)
        estimates = kalman(full, history="full")
        x, P = estimates.x[-1], estimates.P[-1]
        moved = float(np.max(np.abs(x[PHI]) / np.sqrt(np.diag(P)[PHI])))
        if passes == FILTER_PASSES or (passes > 1 and moved < CONVERGED):
            break
        nominal.correct(x)
        nominal.integrate(interval, rows)
        system = nominal.system()
        if passes == 1:  # about a good attitude: what was in the first residual besides the motion is gone
            motion = _fit(system.z, step, walks, motion)

    gains = filter_gains(full, estimates)
    P0_bias = np.zeros((SWAYING_STATES, SWAYING_STATES))
    P0_bias[6:STATES, 6:STATES] = P_bias
    return SwayAlignment(
        integrals=nominal.integrals,
        C_n0_i=nominal.C_n0_i,
        nominal_bias=nominal.bias,
        system=full,
        estimates=estimates,
        gains=gains,
        floor=initial_part(gains.step, P0_bias),
        disturbance=np.array([item.sigma for item in motion]),
        passes=passes,
        settled=moved < ROUGHLY,
        motion=motion,
        arm=nominal.arm - x[ARM],
        arm_sigma=np.sqrt(np.diag(P)[ARM]),
    )


def windowed_align(
    record: ImuRecord,
    C_n0_i: Array,
    position: Position,
    model: StaticModel,
    P_bias: Array,
    interval: float,
    mount: Mount = UNKNOWN_ARM,
) -> tuple[Array, InertialIntegrals]:
    """Attitude by windowed least squares alone, re-linearised; parameters as in :func:`sway_align`.

    Returns
    -------
    C_n0_i : (3, 3) array
        At the start.
    integrals : InertialIntegrals
        With the estimated biases taken off: ``C_n0_i @ integrals.C_ib`` is the attitude at their times.
    """
    nominal = _Nominal(record, C_n0_i, position, model, mount, P_bias)
    _settle(nominal, interval, np.zeros(0, dtype=np.int64))
    return nominal.C_n0_i, nominal.integrals


def _settle(nominal: _Nominal, interval: float, rows: ArrayLike) -> tuple[LinearSystem, Array]:
    """Windowed fits until the attitude stands still; the last system, and what the fit leaves of its measurements."""
    for _ in range(WINDOWED_PASSES):
        nominal.integrate(interval, rows)
        system = nominal.system()
        fit = windowed_fit(system)
        if np.max(np.abs(fit.x[PHI])) < SMALL_TURN:
            break
        nominal.correct(fit.x)
    return system, fit.residual


def _fit(
    residual: Array, interval: float, walks: Walks, start: tuple[AxisMotion, ...] | None = None
) -> tuple[AxisMotion, ...]:
    """Motion along E, N, U; no quieter than a base of stone."""
    fits = []
    for axis in range(3):
        # The vertical carries no attitude: its strongest motion is enough.
        most = 1 if axis == 2 else MOST_OSCILLATORS
        item = fit_motion(residual[:, axis], interval, walks, None if start is None else start[axis], most)
        fits.append(replace(item, white=max(item.white, QUIETEST_BASE)))
    return tuple(fits)
