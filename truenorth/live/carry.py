"""What happened since an alignment's epoch: attitude, and the velocity that the base has gained, row by row."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.result import Alignment
from truenorth.core.earth import normal_gravity
from truenorth.live.going import Going
from truenorth.live.log import Kind, record_of
from truenorth.strapdown.increments import increments, interval_lengths
from truenorth.strapdown.inertial import earth_rotation, gravity_velocity
from truenorth.strapdown.inertial_integration import inertial_integrals

Array = NDArray[np.float64]

WINDOW = 60.0  # s, after which the gained velocity is counted anew: tilt and bias would add up to a drive
GAINED = 6.0  # sigmas
LEAST_GAIN = 0.5  # m/s: people who get in and out, a gust at the quay
SWAY = 6.0  # times the RMS of the base's own motion: its largest swing, and the lever arm's
BLOCK = 0.25  # s: a block costs as much as a row
SLACK = 10_000  # rows for which the filter waits when nobody asks: many at once cost it less
LASTING = 5.0  # s
QUIET = 0.1  # of the limit: a base that gains less stands, or swings through its place
MARGIN = 2.0  # s, before the last quiet row: a drive may begin slower than can be seen


class Carry:
    """Attitude carried on from an alignment: by its filter, or by the gyros alone, the biases taken off.

    The filter takes rows in that came before the base was last seen in its place, and no others.

    Parameters
    ----------
    alignment : Alignment
        At its epoch.
    kind : {"rates", "increments"}
        Of the rows.
    """

    def __init__(self, alignment: Alignment, kind: Kind) -> None:
        self.solution, self._kind = alignment, kind
        self.time = alignment.time
        self._before = np.empty((0, 7))
        self._waiting: list[Array] = []
        self._C_ib = np.eye(3)  # i: the body at the epoch
        self._C_sum = np.zeros((3, 3))  # int C_ib dt
        self._window_start, self._velocity = alignment.time, np.zeros(3)
        self._quiet_at = alignment.time
        self._gone_since: float | None = None
        self.left: float | None = None  # s: when the base began to leave its place; None as long as it stays
        self.going = None if alignment.ongoing is None else Going(alignment, kind)

    def add(self, rows: Array) -> None:
        """Take rows ``time, gyro (3), accel (3)`` in; they are gone through in blocks of `BLOCK`, or by :meth:`advance`."""
        self._waiting.append(rows)
        if self.going is not None:
            self.going.add(rows)
        if rows[-1, 0] - self.time > BLOCK:
            self.advance()

    def advance(self) -> None:
        """Go through the rows that wait, in ascending time; those up to `time` are passed over."""
        rows = np.vstack(self._waiting) if self._waiting else np.empty((0, 7))
        self._waiting = []
        rows = rows[rows[:, 0] > self.time]
        if not len(rows):
            return
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        context = self._before if len(self._before) else np.array([[self.time, *rows[0, 1:]]])
        both = np.vstack([context, rows])
        record = record_of(both, self._kind)
        dtheta, dvel = (values[len(context) :] for values in increments(record))
        T = interval_lengths(record)[len(context) :, None]
        C, velocity, _ = inertial_integrals(
            dtheta - T * self.solution.gyro_bias, dvel - T * self.solution.accel_bias, T[:, 0], [len(rows)]
        )
        span = float(T.sum())
        self._C_sum += 0.5 * span * (self._C_ib + self._C_ib @ C[0])
        self._velocity += self._C_ib @ velocity[0]
        self._C_ib = self._C_ib @ C[0]
        self._before = both[-2:].copy()
        self.time = float(rows[-1, 0])
        self._watch()
        if self.going is not None and self.going.behind > SLACK:
            self._filter()

    def _filter(self) -> None:
        """Let the filter go on: over rows of the base in its place, then over those since it left."""
        assert self.going is not None
        self.going.advance(self._quiet_at - MARGIN if self.left is None else self.left)
        if self.left is not None:
            self.going.advance(self.time - MARGIN, measured=False)

    def now(self) -> tuple[float, Array, Array]:
        """Time, attitude (3, 3) and covariance (3, 3) of the misalignment (E, N, U), at the newest row."""
        self.advance()
        if self.going is not None:
            self._filter()
        return (self.time, self.C_nb, self.phi_covariance) if self.going is None else self.going.now()

    @property
    def elapsed(self) -> float:
        """Since the epoch of the solution, s."""
        return self.time - self.solution.time

    @property
    def C_nb(self) -> Array:
        """(3, 3) attitude now."""
        return self._turned(self.time) @ self.solution.C_nb @ self._C_ib

    @property
    def phi_covariance(self) -> Array:
        """(3, 3) covariance of the misalignment (E, N, U) now: the epoch's, and what gyro bias and noise have added."""
        at = self.solution
        turn = self._turned(self.time)
        joint = at.handover
        bias = np.diag(at.gyro_bias_sigma**2)
        P = np.zeros((6, 6))
        P[:3, :3], P[3:, 3:] = at.phi_covariance, bias
        if joint is not None:
            P = joint.P[:6, :6]
        G = np.hstack([turn, -turn @ at.C_nb @ self._C_sum])
        return G @ P @ G.T + at.imu.gyro_random_walk**2 * self.elapsed * np.eye(3)

    def _turned(self, time: float) -> Array:
        """``C_n_n0``: the level frame now, seen from that of the epoch."""
        return earth_rotation(time - self.solution.time, self.solution.position.lat).T

    def _watch(self) -> None:
        """Compare the velocity gained in the window with what errors of the alignment and the base's own motion explain."""
        at, span = self.solution, self.time - self._window_start
        level = self._turned(self._window_start) @ at.C_nb
        gained = level @ self._velocity + gravity_velocity(span, at.position.lat, at.position.alt)
        gravity = float(normal_gravity(at.position.lat, at.position.alt))
        tilt = float(np.sqrt(np.trace(at.phi_covariance[:2, :2])))
        push = gravity * tilt + float(np.max(at.accel_bias_sigma))
        sway = float(np.nanmax(np.nan_to_num(at.disturbance)))
        speed, limit = float(np.hypot(gained[0], gained[1])), LEAST_GAIN + GAINED * push * span + SWAY * sway
        if speed < QUIET * limit:
            self._quiet_at = self.time
        if speed < limit:
            self._gone_since = None
        elif self._gone_since is None:
            self._gone_since = self.time
        if self.left is None and self._gone_since is not None and self.time - self._gone_since >= LASTING:
            self.left = self._quiet_at - MARGIN
        if span > WINDOW and self._gone_since is None:
            self._window_start, self._velocity = self.time, np.zeros(3)
