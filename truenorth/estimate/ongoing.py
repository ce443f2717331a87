"""The filter of a base that stays, at the end of a log: it goes on as rows come.

What a batch has found (nominal attitude, biases taken off, how the base moves) stays as it is; the rows that come are linearised
about it and filtered. The state after some more rows is that of the batch's own filter on all of them, about the same nominal
solution. Only a new batch finds the motion anew. A base that moves more, or otherwise, than in the log would make the filter too
sure. So rows are filtered in blocks of ten intervals, and a block is filtered again, with as much noise as it shows, when its
innovations are larger, or more of one sign, than chance makes them and than those of any ten intervals of the log.

Of an IMU that was turned the batch has found scale factors and misalignments, too: they are taken off the rows that come as they
were of its own, and stay among the states.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.position import Position
from truenorth.errors.arm import arm_rows, with_arm
from truenorth.errors.matrices import MATRICES, Moments, matrices_of, moments_of, with_matrices, without_errors
from truenorth.errors.staying import BG, PHI, QUIETEST_BASE, STATES, Form, StaticModel
from truenorth.errors.sway import AxisMotion, about_rest, with_motion
from truenorth.estimate.staying import core_system
from truenorth.filters import Estimates, FilterState, LinearSystem, kalman
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import increments
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, integrate
from truenorth.strapdown.inertial_integration import inertial_integrals

Array = NDArray[np.float64]

BLOCK = 10  # intervals
AT_ONCE = 20  # blocks that are filtered together, as long as the base moves no more in them than in the log
# Chi-square of 3 BLOCK and of 3 degrees of freedom exceeds these in one block of a thousand.
LARGE, COLOURED = 59.7, 16.3
CONTEXT = 3  # rows before the first one that the integration rules look back to
STEPS = 50  # points at which an attitude between two epochs is summed up


@dataclass(frozen=True)
class Ongoing:
    """A filter's end."""

    position: Position
    noise: StaticModel
    interval: float  # s
    form: Form
    C_n0_i: Array  # (3, 3): nominal attitude; the states are errors of it
    bias: Array  # (6,): gyro and accelerometer bias that are taken off
    matrices: (
        Array | None
    )  # (18,): scale factors and misalignments that are, where they are states, behind the first twelve
    R: Array  # (3,) (m/s)^2: variance of the base's own velocity, east, north, up
    arm: Array | None  # (3,) m: nominal lever arm, where it is a state
    motion: tuple[AxisMotion, ...]  # of the base, where it is a state; else empty
    # (2, 9) each: of the attitude by which biases act; of a base that rests in the local frame
    trend: tuple[Array, Array] | None
    epochs: int  # so far
    fitted: int  # epochs of the batch
    start: float  # s: when the inertial frame was frozen
    elapsed: float  # s: since then
    C_ib: Array  # (3, 3), with velocity and place (3,) the inertial integrals at the last epoch
    velocity: Array
    place: Array
    x: Array  # (n,)
    P: Array  # (n, n)
    largest: Array  # (2,): size and colour of a block of innovations, beyond which the base moves more than in the log
    disturbed: int = 0  # blocks since the batch, in which it did

    @property
    def time(self) -> float:
        """Of the last epoch, s."""
        return self.start + self.elapsed

    def after(self, record: ImuRecord, context: int, *, measured: bool = True) -> Ongoing:
        """Go on over as many whole blocks as there are rows.

        Parameters
        ----------
        record : ImuRecord
            Rows after the last epoch.
        context : int
            Rows at its beginning that are older, `CONTEXT` at the most.
        measured : bool
            Whether the base is where it was; else attitude and its uncertainty alone go on.
        """
        now = self
        length, half = BLOCK * self.interval, 0.5 * record.interval
        while (whole := int((record.time[-1] - now.time - half) // length)) > 0:
            now = now._blocks(record, min(whole, AT_ONCE), context, measured)
            first = int(np.searchsorted(record.time, now.time + half))
            context = min(first, CONTEXT)
            record = _rows(record, slice(first - context, None))
            if len(record) < context + 2:
                break
        return now

    def attitude(self, record: ImuRecord | None, context: int) -> tuple[float, Array, Array]:
        """Attitude at the last of some rows after the last epoch.

        Returns
        -------
        time : float, s
        C_nb : (3, 3) array
        covariance : (3, 3) array, rad^2
            Of the misalignment, east, north, up.
        """
        gyros = slice(STATES, STATES + (0 if self.matrices is None else MATRICES // 2))
        states = np.r_[PHI, BG, gyros]
        elapsed, C_ib, J = self.elapsed, self.C_ib, np.eye(3, len(states))
        if record is not None and len(record) > context:
            turn, acting = _turned(*self._right(record), context)
            elapsed = float(record.time[-1]) - self.start
            J[:, 3:] = -self.C_n0_i @ C_ib @ acting[:, : len(states) - 3]
            C_ib = C_ib @ turn
        P = J @ self.P[np.ix_(states, states)] @ J.T
        P += self.noise.gyro_random_walk**2 * (elapsed - self.elapsed) * np.eye(3)
        C_n_n0 = earth_rotation(elapsed, self.position.lat).T
        C_n0_b = dcm_from_rotation_vector(J @ self.x[states]) @ self.C_n0_i @ C_ib
        return self.start + elapsed, C_n_n0 @ C_n0_b, C_n_n0 @ P @ C_n_n0.T

    def _blocks(self, record: ImuRecord, count: int, context: int, measured: bool) -> Ongoing:
        """Go on over `count` blocks; over fewer, at least one, where the base moves more in one of them than in the log."""
        end = self.time + count * BLOCK * self.interval + 0.5 * record.interval
        part = _rows(record, slice(int(np.searchsorted(record.time, end))))
        part, bias = self._right(part)
        found = integrate(part, self.interval, bias[:3], bias[3:], context=context)
        C, T = self.C_ib, found.time[:, None]
        whole = InertialIntegrals(
            start=self.start,
            time=self.elapsed + found.time,
            C_ib=C @ found.C_ib,
            velocity=self.velocity + found.velocity @ C.T,
            position=self.place + T * self.velocity + found.position @ C.T,
            C_mean=C @ found.C_mean,
            C_late=C @ found.C_late,
            C_ib_at=found.C_ib_at,
        )
        moments = None if self.matrices is None else moments_of(part, found, context, C)
        system = self._linearise(whole, moments)
        if not measured:
            system = system.with_arrays(z=np.full_like(system.z, np.nan))
        state = FilterState(self.x, self.P, np.zeros(()), np.zeros(0))
        estimates = kalman(system, state, innovations=True)
        sizes = _sizes(estimates, min(BLOCK, len(system.z)))
        large = np.flatnonzero(np.any(sizes > self.largest, axis=1)) if measured else np.empty(0, np.intp)
        if large.size and count > 1:
            return self._blocks(record, max(1, int(large[0])), context, measured)
        disturbed = bool(large.size)
        if disturbed:
            estimates = kalman(system.with_arrays(R=system.R + _disturbance(estimates)), state)
        return replace(
            self,
            epochs=self.epochs + len(found.intervals),
            elapsed=float(whole.time[-1]),
            C_ib=whole.C_ib[-1].copy(),
            velocity=whole.velocity[-1].copy(),
            place=whole.position[-1].copy(),
            x=estimates.x[-1].copy(),
            P=estimates.P[-1].copy(),
            disturbed=self.disturbed + disturbed,
        )

    def _right(self, record: ImuRecord) -> tuple[ImuRecord, Array]:
        """The record without scale factors and misalignments, and the biases (6,) that it still has."""
        if self.matrices is None:
            return record, self.bias
        return without_errors(record, self.bias, *matrices_of(self.matrices)), np.zeros(6)

    def _linearise(self, integrals: InertialIntegrals, moments: Moments | None) -> LinearSystem:
        place, slow = self.position, integrals
        if self.trend is not None:
            t = -1.0 + 2.0 * (self.epochs + np.arange(len(integrals.C_mean))) / (self.fitted - 1)
            if (
                self.arm is None
            ):  # a base that rests stays as it was at the end: a step of its tilt makes a line that goes on
                t = np.minimum(t, 1.0)
            basis = np.stack([np.ones_like(t), t], axis=1)
            mean, late = (basis @ coefficients for coefficients in self.trend)
            if self.arm is None:  # of a base that rests
                slow = about_rest(integrals, (mean, late), self.C_n0_i, place.lat)
            else:
                slow = replace(integrals, C_mean=mean.reshape(-1, 3, 3), C_late=late.reshape(-1, 3, 3))
        P0 = np.zeros((STATES, STATES))
        system = core_system(self.noise, slow, integrals, self.C_n0_i, place, P0, self.form)
        if moments is not None:
            system = with_matrices(system, moments, integrals, self.C_n0_i, place.lat)
        if self.arm is not None:
            system = with_arm(system, arm_rows(integrals, self.C_n0_i, place.lat), self.arm)
        if self.motion:
            return with_motion(system, float(np.mean(integrals.intervals)), self.motion)
        return system.with_arrays(R=system.R + np.diag(self.R - QUIETEST_BASE**2))


def _rows(record: ImuRecord, rows: slice) -> ImuRecord:
    return replace(record, time=record.time[rows], gyro=record.gyro[rows], accel=record.accel[rows])


def block_limits(estimates: Estimates) -> Array:
    """(2,) size and colour of ten innovations that neither chance nor this filter's log exceeds."""
    return np.maximum(_sizes(estimates, BLOCK).max(axis=0, initial=0.0), [LARGE, COLOURED])


def _sizes(estimates: Estimates, length: int) -> Array:
    """(B, 2) of each block of so many epochs: sum of the squared innovations, and squares of their sums, in sigmas."""
    e = estimates.innovation / np.sqrt(estimates.innovation_covariance.diagonal(axis1=1, axis2=2))
    blocks = len(e) // length
    e = e[: blocks * length]
    flat, sums = e.reshape(blocks, -1), np.ones(length) @ e.reshape(blocks, length, -1)
    return np.stack([np.einsum("bi,bi->b", flat, flat), np.einsum("bi,bi->b", sums, sums) / length], axis=1)


def _disturbance(estimates: Estimates) -> Array:
    """(3, 3) noise besides that of the filter, which the innovations of a block show in their size and at low frequency."""
    expected = np.einsum("kii->ki", estimates.innovation_covariance)
    e = estimates.innovation / np.sqrt(expected)
    ratio = np.maximum(np.mean(e**2, axis=0), np.sum(e, axis=0) ** 2 / len(e))
    return np.diag(np.maximum(ratio - 1.0, 0.0) * expected.mean(axis=0))


def _turned(record: ImuRecord, bias: Array, context: int) -> tuple[Array, Array]:
    """Attitude after the last row in the body axes before the first, (3, 3), and by what the gyros' errors act until then.

    Of biases that is the integral of the attitude, s; of scale factors and misalignments, by rows, that of its product with each
    angular rate: (3, 12).
    """
    dtheta, dvel = increments(record)
    steps = record.steps
    points = np.unique(np.linspace(context, len(record), STEPS).astype(np.int64))
    C, _, _ = inertial_integrals(dtheta, dvel, steps, points, bias[:3], bias[3:])
    C = C[0].T @ C
    edges = np.concatenate([[0.0], np.cumsum(steps)])[points]
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(dtheta, axis=0)])[points]
    half = 0.5 * (C[1:] + C[:-1])
    by_bias = np.einsum("k,kij->ij", np.diff(edges), half)
    by_rate = np.einsum("kai,kj->aij", half, np.diff(angle, axis=0))
    return C[-1], np.hstack([by_bias, by_rate.reshape(3, 9)])
