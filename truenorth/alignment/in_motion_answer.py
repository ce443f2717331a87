"""The last epoch of a track on the move as an `Alignment`, with its history; the verdict comes after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from truenorth.alignment.in_motion_spread import Spread
from truenorth.alignment.in_motion_start import departures
from truenorth.alignment.in_motion_task import MovingTask
from truenorth.alignment.moving import Moving, fifteen, gone, moving_of, off_by_heading, turning
from truenorth.alignment.result import Alignment, History
from truenorth.alignment.task import deflection_covariance
from truenorth.core.attitude import UNIFORM_SIGMA
from truenorth.core.earth import normal_gravity
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.position import Position
from truenorth.errors.axes import proper_bias, standing
from truenorth.estimate.latency import delays_found, rates_found
from truenorth.records import OdometerRecord
from truenorth.state.layout import ACCEL_AXES, ANTENNA_ARM, BG, DP, GYRO_AXES, PHI
from truenorth.state.track import Track


def moving_answer(
    task: MovingTask, track: Track, method: str, why: str, spread: Spread, driven: Track | None = None
) -> Alignment:
    """The alignment at the end of a track, before any verdict; `spread`: of heading, besides the filter's.

    `driven` shows how far the vehicle went, where the track itself is of a loop that feeds nothing back: its velocities are off by
    up to metres a second as long as it does not know its heading.
    """
    place = track.position[-1]
    sigma = track.sigma[-1]
    try:
        position = Position(
            float(place[0]), float(place[1]), float(place[2]), float(np.max(sigma[6:8])), float(sigma[8])
        )
    except UsageError:
        raise AlignmentError(
            f"the solution runs away: a height of {place[2]:.3g} m at the end; the measurements do not hold it: check their clock, "
            "axes and units, and the specification `imu`"
        ) from None
    history = _history(track, task)
    own = history.phi_covariance
    apart = spread.covariance(float(own[-1][2, 2]))
    covariance = own[-1] + apart
    covariance[2, 2] = min(covariance[2, 2], UNIFORM_SIGMA**2)
    sensor = "odometer" if isinstance(task.odometer, OdometerRecord) else "velocity log"
    mounting = None if task.odometer is None else (sensor, task.wheel.C_mb, task.wheel.lever_arm)
    way = track if driven is None else driven
    distance = float(np.trapezoid(np.linalg.norm(way.v_n, axis=1), way.time))
    prior = np.sqrt(task.spec.bias_variance)
    prior[3:] = np.hypot(prior[3:], np.sqrt(task.spec.acting_variance(standing())))
    groups = (GYRO_AXES, ACCEL_AXES) if task.antenna.lever_arm.any() else (GYRO_AXES, ACCEL_AXES, ANTENNA_ARM)
    moving = moving_of(track, distance, "motion" if method == "motion" else "the earth's rate", mounting, groups)
    delays = delays_found(track, {"GNSS": task.antenna, "odometer": task.wheel, "velocity log": task.wheel})
    before = np.diag(moving.P)[BG]
    # Navigation goes on from there: what heading is less sure of belongs to it, too.
    less_sure = covariance[2, 2] - own[-1][2, 2]
    if task.gnss is None and not task.more:
        moving = moving.turned(less_sure)
        position = replace(position, horizontal_sigma=float(np.sqrt(np.diag(moving.P)[DP][:2].max())))
    elif spread.heading > 0.0:
        moving = moving.off_together(apart)
    # A heading that is less sure goes with what the gyros' biases make of the earth's rate.
    gyro_more = np.diag(moving.P)[BG] - before
    clocks = rates_found(track, task.antenna)
    moving = replace(moving, delays=delays, clocks=clocks, acting_bias=track.accel_bias[-1])
    gyro_bias_sigma = np.sqrt(history.gyro_bias_sigma[-1] ** 2 + gyro_more)
    if spread.moment.any():
        moving, history = less_sure_all_along(moving, history, spread)
    return Alignment(
        status="not_converged",
        evidence=(),
        method=method,
        method_reason=why,
        time=float(track.time[-1]),
        C_nb=track.C_nb[-1],
        phi_covariance=covariance,
        phi_floor=history.phi_floor[-1],
        gyro_bias=track.gyro_bias[-1],
        gyro_bias_sigma=gyro_bias_sigma,
        gyro_bias_prior=prior[:3],
        accel_bias=history.accel_bias[-1],
        accel_bias_sigma=history.accel_bias_sigma[-1],
        accel_bias_prior=prior[3:],
        position=position,
        imu=task.spec,
        imu_source=f"specification {task.spec.name!r}",
        duration=task.record.duration,
        disturbance=np.full(3, np.nan),
        history=history,
        source=task.record.source,
        moving=moving,
    )


def less_sure_all_along(moving: Moving, history: History, spread: Spread) -> tuple[Moving, History]:
    """The track and the history with what other guesses of heading make of every epoch, not of the last alone."""
    track, known = moving.track, history.phi_covariance
    apart = np.stack([spread.covariance(heading) for heading in known[:, 2, 2].tolist()])
    P, gyro_sigma = track.P.copy(), history.gyro_bias_sigma
    if moving.in_body:
        way = gone(track.position[0], track.position)
        turn = turning(P.shape[-1], track.v_n, way, track.C_nb, track.position[:, 0])
        P = off_by_heading(P, apart[:, 2, 2], turn)
        gyro_sigma = np.hypot(gyro_sigma, np.sqrt(apart[:, 2, 2])[:, None] * turn[:, BG])
    else:
        P[:, PHI, PHI] += apart
    history = replace(history, phi_covariance=known + apart, gyro_bias_sigma=gyro_sigma)
    return replace(moving, track=replace(track, P=P)), history


def _history(track: Track, task: MovingTask) -> History:
    P = fifteen(track)
    sigma = np.sqrt(np.maximum(np.einsum("kii->ki", P), 0.0))
    g = float(normal_gravity(task.position.lat, task.position.alt))
    deflection = deflection_covariance(task.position.lat, g)
    accel_bias, accel_sigma = proper_bias(track, standing(), task.spec.acting_variance(standing()))
    count = len(track.time)
    aided = max((r for r in track.residuals if len(r.time)), key=lambda r: len(r.time), default=None)
    innovation, expected, nis = np.full((count, 3), np.nan), np.full((count, 3), np.nan), np.full(count, np.nan)
    if aided is not None:
        last = np.searchsorted(aided.time, track.time, "right") - 1
        known = last >= 0
        innovation[known], expected[known] = aided.innovation[last[known]], aided.sigma[last[known]]
        nis[known] = aided.nis[last[known]]
    return History(
        time=track.time,
        C_nb=track.C_nb,
        phi_covariance=P[:, PHI, PHI] + deflection,
        phi_floor=np.broadcast_to(deflection, (count, 3, 3)),
        departure=departures(task.record, track),
        gyro_bias=track.gyro_bias,
        gyro_bias_sigma=sigma[:, BG],
        accel_bias=accel_bias,
        accel_bias_sigma=accel_sigma,
        innovation=innovation,
        innovation_sigma=expected,
        nis=nis,
        innovation_of=aided.name if aided is not None else "nothing",
        innovation_unit=aided.unit if aided is not None else "1",
        innovation_axes=aided.axes if aided is not None else (),
    )
