"""From what a method found to an `Alignment`: navigation axes, the asked epoch, floors, history."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias import true_bias
from truenorth.alignment.fine import FineAlignment, attitude_history
from truenorth.alignment.handover import hand_over
from truenorth.alignment.inference import INFERRED, apart_from_axes
from truenorth.alignment.result import Alignment, History
from truenorth.alignment.task import Task
from truenorth.core.attitude import UNIFORM_SIGMA
from truenorth.core.earth import EARTH_RATE, radii
from truenorth.errors.staying import BA, BG, BIASES
from truenorth.records.specs import ImuSpec
from truenorth.strapdown.inertial import earth_rotation

Array = NDArray[np.float64]

FARTHEST = 100.0  # lengths of the log: a power law is not carried further
EXCURSION = 0.3  # m, one sigma: how far the place about which a base sways may have moved over a log


def at_epoch(
    task: Task,
    spec: ImuSpec,
    where: str,
    C_n0_b: Array,
    covariance: Array,
    floor: Array,
) -> Alignment:
    """An answer given in n0, turned into navigation axes at the epoch asked for."""
    time = task.epoch.elapsed
    covariance, floor = task.in_navigation_axes(covariance, time), task.in_navigation_axes(floor, time)
    C_nb = earth_rotation(time, task.position.lat).T @ C_n0_b
    return assemble(task, spec, where, C_nb, covariance, floor)


def assemble(task: Task, spec: ImuSpec, where: str, C_nb: Array, covariance: Array, floor: Array) -> Alignment:
    """An answer in navigation axes, with biases as specified and no verdict yet."""
    spec = apart_from_axes(spec, task.gravity) if where == INFERRED else spec
    prior = np.sqrt(spec.bias_variance)
    return Alignment(
        status="not_converged",
        evidence=(),
        method="",
        method_reason="",
        time=task.epoch.time,
        C_nb=C_nb,
        phi_covariance=covariance + task.deflection,
        phi_floor=floor + task.deflection,
        gyro_bias=np.zeros(3),
        gyro_bias_sigma=prior[:3],
        gyro_bias_prior=prior[:3],
        accel_bias=np.zeros(3),
        accel_bias_sigma=prior[3:],
        accel_bias_prior=prior[3:],
        position=task.position,
        imu=spec,
        imu_source=where,
        duration=task.record.duration,
        disturbance=np.full(3, np.nan),
        source=task.record.source,
    )


def answer_of(
    task: Task,
    fine: FineAlignment,
    used: ImuSpec,
    where: str,
    P_bias: Array,
    *,
    sways: bool = False,
    bent: Array | None = None,
    goes_on: bool = True,
) -> Alignment:
    """The answer of a filter at the epoch asked for, with its history.

    Parameters
    ----------
    task, fine, used, where
    P_bias : (6, 6) array
        Prior covariance of the biases.
    sways : bool
        Whether the base does.
    bent : (3, 3) array, optional
        More covariance of the misalignment.
    goes_on : bool
        Whether navigation may go on from the answer.
    """
    C_ib = task.epoch.attitude(fine.integrals.C_ib_at[0])
    answer = at_epoch(task, used, where, *fine.misalignment_at(C_ib, task.epoch.elapsed))
    if sways:
        answer = replace(answer, phi_covariance=answer.phi_covariance + creep(task, task.record.duration))
    proper = answer.imu.bias_variance[3:]
    history = make_history(task, fine, proper, sways)
    if bent is not None:
        answer = replace(answer, phi_covariance=answer.phi_covariance + bent)
        history = replace(history, phi_covariance=history.phi_covariance + bent)
    variance, prior = fine.P.diagonal(), P_bias.diagonal()[3:]
    accel_bias, accel_sigma = true_bias(fine.bias[3:], variance[BA], prior, proper)
    return replace(
        answer,
        gyro_bias=fine.bias[:3],
        gyro_bias_sigma=np.sqrt(variance[BG]),
        accel_bias=accel_bias,
        accel_bias_sigma=accel_sigma,
        disturbance=fine.disturbance,
        history=history,
        pays_until=pays_until(history, answer, fine),
        handover=hand_over(task, fine, answer) if goes_on else None,
    )


def creep(task: Task, elapsed: Array | float) -> Array:
    """(..., 3, 3) covariance of phi from a base that sways about a place which moves by `EXCURSION` in the time elapsed (s).

    A constant north velocity v cannot be seen by anyone: it equals a heading error of ``v / (R w_ie cos L)``.
    """
    R_M, _ = radii(task.position.lat)
    v = EXCURSION / np.asarray(elapsed, dtype=np.float64)
    result = np.zeros((*v.shape, 3, 3))
    result[..., 2, 2] = (v / (R_M * EARTH_RATE * math.cos(task.position.lat))) ** 2
    return result


def make_history(task: Task, fine: FineAlignment, proper: Array, sways: bool = False) -> History:
    """How a filter came to its answer, in navigation axes; on a base that sways with the allowance for its creep.

    `proper` is the variance of the accelerometers' biases proper, (3,) (m/s^2)^2.
    """
    C_nb, covariance, floor = attitude_history(fine, task.position.lat)
    if sways:
        covariance = covariance + creep(task, fine.integrals.time[1:])
    e = fine.estimates
    bias, variance = fine.taken[BIASES] + e.x[:, BIASES], e.P[:, BA, BA].diagonal(axis1=1, axis2=2)
    prior = fine.system.P0.diagonal()[BA]
    accel_bias, accel_sigma = true_bias(bias[:, 3:], variance, prior, proper)
    return History(
        time=fine.integrals.start + fine.integrals.time[1:],
        C_nb=C_nb,
        phi_covariance=covariance + task.deflection,
        phi_floor=floor + task.deflection,
        departure=np.einsum(
            "kji,kj->ki", earth_rotation(fine.integrals.time[1:], task.position.lat), fine.departures()
        ),
        gyro_bias=bias[:, :3],
        gyro_bias_sigma=e.sigma[:, BG].copy(),
        accel_bias=accel_bias,
        accel_bias_sigma=accel_sigma,
        innovation=e.innovation,
        innovation_sigma=np.sqrt(e.innovation_covariance.diagonal(axis1=1, axis2=2)),
        nis=e.nis,
    )


def pays_until(history: History, answer: Alignment, fine: FineAlignment) -> float | None:
    """Length of data after which the random part of heading's sigma is below half its floor.

    Read off the history, or extrapolated by the power law of its second half.
    """
    floor = math.sqrt(answer.phi_floor[2, 2])
    elapsed = history.time - fine.integrals.start
    random = np.sqrt(np.maximum(history.phi_covariance[:, 2, 2] - history.phi_floor[:, 2, 2], 1e-20))
    below = (random < 0.5 * floor).nonzero()[0]
    if below.size:
        return float(elapsed[below[0]])
    half = len(elapsed) // 2
    slope = math.log(random[-1] / random[half]) / math.log(elapsed[-1] / elapsed[half])
    if slope > -0.2:
        return None
    wanted = float(elapsed[-1] * (0.5 * floor / random[-1]) ** (1.0 / slope))
    return wanted if wanted < FARTHEST * elapsed[-1] else None


def of_level_alone(answer: Alignment, more: Array | float = 0.0) -> Alignment:
    """The same answer and history, with nothing known of heading; `more`, (3, 3) rad^2, is added to the covariance of both."""
    found, history = answer, answer.history
    if history is not None:
        covariance, floor = (without_heading(P + more) for P in (history.phi_covariance, history.phi_floor))
        found = replace(found, history=replace(history, phi_covariance=covariance, phi_floor=floor))
    covariance, floor = (without_heading(P + more) for P in (answer.phi_covariance, answer.phi_floor))
    return replace(found, phi_covariance=covariance, phi_floor=floor)


def without_heading(covariance: Array) -> Array:
    """The same covariance of level, with nothing known of heading."""
    result = covariance.copy()
    result[..., 2, :] = 0.0
    result[..., :, 2] = 0.0
    result[..., 2, 2] = UNIFORM_SIGMA**2
    return result
