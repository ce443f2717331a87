"""Where a speed log sits: its arm from the IMU, known or shown by the hull's turns, taken off before damping.

A log at ``l`` in the hull's axes moves with the hull as it turns:

    v_log = v + d/dt (C_nb l) + G e + noise

A turn of 1 deg/s moves a log 30 m ahead by half a metre a second sideways. Taken for a velocity of the ship, that turned heading
and place 5 to 6 of their sigmas wrong. An arm that nobody has said is found before any filter runs. What INS and log differ by
otherwise, Schuler's oscillation and a current, runs straight over two `SPAN`, so that for second differences of means

    D(v_INS - v_log) = -D(d/dt C_nb) l - D(G) e + D(int C_nb dt) b + noise

with ``G e`` the scale, mounting and bias of :mod:`truenorth.errors.log` and b the biases of the accelerometers, which turn with the
hull and change the INS's velocity as it turns (of 250 ug the arm of a log at the IMU was found 1.8 m long, ten of its sigmas), by
robust least squares with their sigmas a priori. The means are by Hann's window, twice `SPAN` long: they have turns in them and no
sway, of which the filters of many logs leave a part. How far the log is below the IMU they hardly show, nor does it matter to them.
A log of forward speed alone, taken to make no leeway, has the arm to the point about which the hull turns.

Source: P. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed. (2013), sec. 14.3.3 and
16.3 (lever arm of an aiding velocity); the fit is ours.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import HULL
from truenorth.damping.course import motion_at
from truenorth.damping.waves import SPAN, hann_means
from truenorth.errors.log import DRIFT, LogErrors, log_rows
from truenorth.records import VelocityRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence, note
from truenorth.state.mounting import Mounting
from truenorth.state.track import Track

Array = NDArray[np.float64]

CLEAR = 3.0  # sigmas: an arm that is named
FEWEST = 30  # differences, below which none is sought
LEAST_NOISE = 1e-4  # m/s
LEAST_BIAS = 1e-9  # m/s^2, of an IMU without
# Covariance of second differences of such means of white noise with the next three, their variance being 1:
LAGS = (-0.607, 0.071, 0.036)


class Arm(NamedTuple):
    """A log's arm from the IMU, body axes, m."""

    arm: Array  # (3,) right, forward, up
    sigma: Array  # (2,) one-sigma, right and forward, of what turns show

    def evidence(self) -> list[Evidence]:
        """Where it sits, if the log shows that it is not at the IMU."""
        if not np.any(np.abs(self.arm[:2]) > CLEAR * self.sigma):
            return []
        right, ahead = map(float, self.arm[:2])
        return [note("log.arm", "log_arm", right=right, ahead=ahead, sigma=float(self.sigma.max()))]


def at_the_imu(
    course: Track, record: VelocityRecord, mounting: Mounting | None, errors: LogErrors, spec: ImuSpec
) -> tuple[VelocityRecord, Arm | None]:
    """A log as it would be at the IMU, and the arm by which it was carried there, where that was sought.

    Parameters
    ----------
    course : Track
        The INS at its finest epochs.
    record : VelocityRecord
        Along the IMU's axes or the navigation axes, on the IMU's clock.
    mounting : Mounting, optional
        An arm of zero, and none at all, is one of which nothing is said: it is sought within `HULL`.
    errors : LogErrors
        Its slow errors.
    spec : ImuSpec
        Of the IMU.
    """
    known = np.zeros(3) if mounting is None else np.asarray(mounting.lever_arm, dtype=np.float64)
    sigma = 0.0 if mounting is None else mounting.lever_arm_sigma
    if np.any(known):
        record = carried(course, record, known)
    else:
        sigma = sigma or HULL
    found = sought(course, record, errors, sigma, spec) if sigma else None
    if found is None:
        return record, None
    return carried(course, record, found.arm), Arm(known + found.arm, found.sigma)


def carried(course: Track, record: VelocityRecord, arm: Array) -> VelocityRecord:
    """The log less the velocity of its arm; rows outside the course as they are."""
    inside = _inside(course, record)
    C_nb, turning = _turning(course, record.time[inside])
    off = turning @ arm
    velocity = record.velocity.copy()
    velocity[inside] -= off if record.frame == "navigation" else np.einsum("kji,kj->ki", C_nb, off)
    return replace(record, velocity=velocity)


def sought(course: Track, record: VelocityRecord, errors: LogErrors, sigma: float, spec: ImuSpec) -> Arm | None:
    """The arm that the hull's turns and sway show, about zero with a one-sigma a priori; None: too few rows."""
    from scipy.integrate import cumulative_trapezoid
    from scipy.optimize import least_squares

    inside = _inside(course, record)
    measured = [0, 1] if record.frame == "navigation" else [1]
    inside &= np.isfinite(record.velocity[:, measured]).all(axis=1)
    if not inside.any():
        return None
    time, velocity = record.time[inside], np.nan_to_num(record.velocity[inside])
    C_nb, turning = _turning(course, time)
    _, v_n = motion_at(course, time)
    if record.frame == "body":
        velocity = np.einsum("kij,kj->ki", C_nb, velocity)
    groups = tuple(group for group in errors.groups() if group.name != DRIFT)
    pushed = -cumulative_trapezoid(C_nb[:, :2, :2], time, axis=0, initial=0.0)
    shown = np.concatenate([turning[:, :2, :2], pushed, log_rows(groups, C_nb, v_n)], axis=2)
    off, count = (v_n - velocity)[:, :2], shown.shape[2]
    found, _ = hann_means(time, np.hstack([off, shown.reshape(len(time), -1)]), float(time[0]), SPAN)
    apart = np.diff(found, 2, axis=0)
    z, H = apart[:, :2].reshape(-1), apart[:, 2:].reshape(-1, count)
    there = np.isfinite(z)
    if there.sum() < FEWEST:
        return None
    z, H = np.where(there, z, 0.0), np.where(there[:, None], H, 0.0)
    noise = max(float(1.4826 * np.median(np.abs(z[there]))), LEAST_NOISE)
    bias = max(math.sqrt(spec.bias_variance[3]), LEAST_BIAS)
    prior = np.concatenate([np.full(2, sigma), np.full(2, bias), *(group.prior for group in groups)])
    J = np.vstack([H / noise, np.diag(1.0 / prior)])
    y = np.append(-z / noise, np.zeros(len(prior)))
    x = least_squares(lambda x: J @ x - y, np.zeros(len(prior)), jac=lambda x: J, loss="soft_l1", f_scale=2.0).x
    A = np.linalg.inv(J.T @ J)
    pairs = H.reshape(-1, 2, H.shape[1]) / noise
    V = J.T @ J
    for lag, part in enumerate(LAGS, start=1):
        across = np.einsum("kai,kaj->ij", pairs[lag:], pairs[:-lag])
        V += part * (across + across.T)
    return Arm(np.append(x[:2], 0.0), np.sqrt(np.diag(A @ V @ A)[:2]))


def _inside(course: Track, record: VelocityRecord) -> NDArray[np.bool_]:
    return np.asarray((record.time >= course.time[0]) & (record.time <= course.time[-1]))


def _turning(course: Track, time: Array) -> tuple[Array, Array]:
    """``C_nb`` and ``d/dt C_nb``, (M, 3, 3), between the epochs of a course: by a cubic spline, which sway needs."""
    from scipy.interpolate import CubicSpline

    slope = CubicSpline(course.time, course.C_nb.reshape(-1, 9)).derivative()(time)
    return motion_at(course, time)[0], np.asarray(slope).reshape(-1, 3, 3)
