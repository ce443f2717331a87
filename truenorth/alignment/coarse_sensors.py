"""Coarse calibration of poor gyros on an indexer: what they turn more than its encoder, of a body that comes back.

A gyro bias of .28 deg/s is a turn of 67 deg after 240 s, a scale factor of 1 % one of 3.6 deg a turn of the indexer: a solution
that begins without them is so far away that its passes go anywhere. The encoder knows how the IMU turns in the body. With ``w_bs``
the indexer's rate in the IMU's axes, what the gyros show of the body's attitude about its first or mean one is, a rotation vector,

    theta(t) = a + b t + sway(t) + int C_bs (eps + M_g w_bs) dt

of a body that goes nowhere: `a` is a constant, `b` the earth's rate and a slow turn of its own. A sway comes back, and a window
leaves next to nothing of it. It is no part of what stands with the errors: by rates with the sway in them a fit explains it by
``M_g = -I``. So the fit is linear. It finds what the indexer brings to light, and of the rest what a specification says: a bias
along an axis that turns at one rate and the scale factor of that gyro act as one.

First theta is the sum of the body's turns in its own axes, which no size of an error makes ambiguous; then, with the errors found
taken off, it is the rotation vector itself. How well it knows them is said of a sway as large as it leaves, whose waves are `WAVE`
long: that the body keeps its attitude is news to a filter that sees velocities alone, and carries its heading through the log.

Source: ours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import CoarseStart
from truenorth.alignment.inference import WORST_ACCEL, WORST_GYRO
from truenorth.alignment.swaying import Mount
from truenorth.alignment.task import Task
from truenorth.alignment.turning import with_usual
from truenorth.alignment.usual import usual
from truenorth.alignment.windowed import hann
from truenorth.coarse import oba
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.earth import EARTH_RATE
from truenorth.core.indexing import indexer_turns
from truenorth.errors.staying import BIASES, StaticModel
from truenorth.estimate.staying import KnownSensors, prior_of
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import ANY_EFFECT, Evidence, Figure
from truenorth.state.limits import limit
from truenorth.strapdown.inertial import InertialIntegrals, integrate

Array = NDArray[np.float64]

SLOW_TURN = 0.1  # rad, one sigma about each axis, by which the body turns within the log besides the earth and its sway
LEFT = math.radians(0.3)  # of a sway behind the window
WAVE = 10.0  # s
PASSES = 4  # the last of a consumer IMU moves its biases by less than 1 deg/h
GYRO_BIAS, GYRO_MATRIX = slice(0, 3), slice(6, 15)  # of the errors of the sensors
NUISANCES = 6  # `a` and `b`


def calibrated(start: CoarseStart, mount: Mount, turned: ImuSpec | None) -> CoarseStart:
    """The same start with what the encoder shows of poor gyros, and the coarse attitude of the record without their errors.

    Poor are gyros whose biases may be larger than the earth's rate, and usually are with such a noise; others stay as they are.

    Parameters
    ----------
    start : CoarseStart
    mount : Mount
        With the attitude of the body in the IMU at the ends of the filter intervals; without it the start stays as it is.
    turned : ImuSpec, optional
        With it, scale factors and misalignments of the gyros are found, too.
    """
    usually = usual("gyro", "bias", start.model.gyro_random_walk)
    if mount.C_sb is None or min(math.sqrt(float(start.P_bias[0, 0])), usually) < EARTH_RATE:
        return start
    place, start = start.position, start._replace(sensors=known_sensors(start, mount.C_sb, turned))
    integrals = integrate(start.right_record(), start.interval)
    return start._replace(C_n0_i=oba(integrals, place.lat, place.alt, history=False).C_n0_i)


def shown_biases(task: Task, C_n0_i: Array, C_sb: Array, noise: StaticModel) -> tuple[Array, Array]:
    """What an encoder shows of the biases of gyros of which nothing but their noise is known, (3,) rad/s, and their sigmas.

    The noise of these estimates is what the window leaves of a sway: as large as the sway itself, it would allow biases where the
    log shows that there are none.
    """
    turned = with_usual(ImuSpec(gyro_random_walk=noise.gyro_random_walk, accel_random_walk=noise.accel_random_walk))
    P_bias = np.diag([WORST_GYRO**2] * 3 + [WORST_ACCEL**2] * 3)
    start = CoarseStart(task.record, C_n0_i, task.position, noise, P_bias, task.interval)
    known = known_sensors(start, C_sb, turned, waves=False)
    return known.mean[GYRO_BIAS], np.sqrt(np.diag(known.P)[GYRO_BIAS])


def known_sensors(start: CoarseStart, C_sb: Array, turned: ImuSpec | None, *, waves: bool = True) -> KnownSensors:
    """What an encoder shows of the gyros; parameters as in :func:`calibrated`, with `C_sb` (K+1, 3, 3) of its mount.

    `waves`: whether its covariance is that of a sway as large as is left; else of what the window leaves of one.
    """
    prior = prior_of(start.P_bias, spec=turned)
    P = prior.P[prior.sensors, prior.sensors]
    known = KnownSensors(np.zeros(len(P)), P)
    for attempt in range(PASSES):
        integrals = integrate(start._replace(sensors=known).right_record(), start.interval)
        known = _fitted(_turned(integrals, C_sb, small=attempt > 0), integrals, C_sb, known.mean, P, waves=waves)
    # They were so on the average of the log.
    known.P[GYRO_BIAS, GYRO_BIAS] += start.model.gyro_rate_walk**2 * start.record.duration * np.eye(3)
    return known


def matrix_evidence(start: CoarseStart, spec: ImuSpec) -> list[Evidence]:
    """The entry of the gyros' matrix that is furthest beyond its specification: units, axes, signs, or the encoder's.

    Of what was found counts what the log shows next to a sway as large as it leaves: by a slow one a body makes entries of its own.
    """
    known = start.sensors
    if known is None or len(known.mean) == BIASES.stop - BIASES.start:
        return []
    prior = prior_of(start.P_bias, spec=spec)
    variance = np.diag(prior.P)[prior.sensors]
    as_said = np.divide(known.mean, variance, out=np.zeros_like(variance), where=variance > 0.0)
    M = (known.mean - known.P @ as_said)[GYRO_MATRIX].reshape(3, 3)
    allowed = np.where(np.eye(3, dtype=bool), spec.gyro_scale_factor, spec.gyro_misalignment)
    times = np.abs(M) / np.maximum(allowed, math.ulp(0.0))
    row, column = divmod(int(np.argmax(times)), 3)
    if times[row, column] < limit("specification"):
        return []
    figures: dict[str, Figure] = {"axis": "xyz"[row], "about": "xyz"[column], "imu": spec.name}
    figures |= {"found": float(M[row, column]), "allowed": float(allowed[row, column])}
    return [Evidence("encoder.gyro_matrix", figures, "unknown", ANY_EFFECT, ("imu_axes", "units"))]


def _turned(integrals: InertialIntegrals, C_sb: Array, *, small: bool) -> Array:
    """(K+1, 3) attitude of the body as the gyros show it, rad: a rotation vector about its mean; else the sum of its turns."""
    C_ib = integrals.C_ib @ C_sb
    if not small:
        return _summed(rotation_vector_from_dcm(np.swapaxes(C_ib[:-1], 1, 2) @ C_ib[1:]))
    U, _, Vt = np.linalg.svd(C_ib.mean(axis=0))
    return rotation_vector_from_dcm((U @ Vt).T @ C_ib)


def _fitted(
    theta: Array, integrals: InertialIntegrals, C_sb: Array, off: Array, P: Array, *, waves: bool
) -> KnownSensors:
    """All errors of the sensors.

    Parameters
    ----------
    theta : (K+1, 3) array, rad
    integrals : InertialIntegrals
        Of the record without the errors `off` (n,), which theta shows no more.
    C_sb : (K+1, 3, 3) array
    P : (n, n) array
        Covariance of all the errors about zero, as specified.
    waves : bool
        As in :func:`known_sensors`.
    """
    n, count = len(off), len(theta)
    H = np.concatenate([_response(integrals, C_sb, n), _line(integrals.time)], axis=2)
    before = np.zeros((n + NUISANCES, n + NUISANCES))
    before[:n, :n] = P
    before[n : n + 3, n : n + 3] = np.eye(3)
    before[n + 3 :, n + 3 :] = (EARTH_RATE**2 + (SLOW_TURN / integrals.time[-1]) ** 2) * np.eye(3)
    x0 = np.append(-off, np.zeros(NUISANCES))
    weight = hann(count)
    N = np.einsum("k,kmi,kmj->ij", weight, H, H) / LEFT**2
    y = np.einsum("k,kmi,km->i", weight, H, theta - H @ x0) / LEFT**2
    x = x0 + before @ np.linalg.solve(np.eye(len(x0)) + N @ before, y)
    worse = max(WAVE / float(integrals.intervals[0]), 1.0)
    if waves:
        worse *= max(float(np.average(np.mean((theta - H @ x) ** 2, axis=1), weights=weight)) / LEFT**2, 1.0)
    after = before @ np.linalg.inv(np.eye(len(x0)) + N / worse @ before)
    return KnownSensors(off + x[:n], 0.5 * (after + after.T)[:n, :n])


def _response(integrals: InertialIntegrals, C_sb: Array, n: int) -> Array:
    """(K+1, 3, n) the turn by each error of the sensors."""
    turns = indexer_turns(C_sb)
    C_bs = np.swapaxes(C_sb[:-1], 1, 2) @ dcm_from_rotation_vector(0.5 * turns)
    rates = np.zeros((len(turns), 3, n))
    rates[:, :, GYRO_BIAS] = C_bs * integrals.intervals[:, None, None]
    if n > BIASES.stop - BIASES.start:
        rates[:, :, GYRO_MATRIX] = np.einsum("kab,kc->kabc", C_bs, turns).reshape(-1, 3, 9)
    return _summed(rates)


def _line(time: Array) -> Array:
    """(K+1, 3, 6) of a constant and a rate."""
    one = np.broadcast_to(np.eye(3), (len(time), 3, 3))
    return np.concatenate([one, time[:, None, None] * one], axis=2)


def _summed(x: Array) -> Array:
    """From nothing on: (K+1, ...) of (K, ...)."""
    return np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
