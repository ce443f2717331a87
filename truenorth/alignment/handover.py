"""What an alignment hands on: its filter to the rows that come; to navigation how what it found hangs together.

Heading error and east gyro bias of an alignment at rest cancel each other, and so do tilt and accelerometer bias: what
is left of them in navigation is far less than either. The fine filter knows both with their covariance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.swaying import SwayAlignment
from truenorth.alignment.task import Task
from truenorth.coarse.analytic import static_jacobian
from truenorth.core.earth import DEFLECTION
from truenorth.errors.matrices import by_matrix
from truenorth.errors.staying import BIASES, STATES, StaticModel
from truenorth.errors.sway import rest_trend, sway_trend
from truenorth.estimate.ongoing import Ongoing, block_limits
from truenorth.navigation.handover import Handover
from truenorth.strapdown.inertial import earth_rotation

if TYPE_CHECKING:
    from truenorth.alignment.result import Alignment

Array = NDArray[np.float64]


def hand_over(task: Task, fine: FineAlignment, answer: Alignment) -> Handover:
    """The joint estimate at the epoch asked for, its covariance in navigation axes; of attitude that of the answer.

    Scale factors and misalignments of an IMU that was turned are no states of the start of navigation: what they make of gravity is
    a part of the accelerometers' bias, as it is of an IMU that was not. Left out, velocities of navigation IMUs on bases that
    sheer by 17 deg were 5.3 sigmas off after a minute, RMS, 12 at the worst; so .5 and 1.0.
    """
    force = task.gravity * answer.C_nb[2]
    P = fine.joint_at(task.epoch.elapsed, force)
    turn = np.eye(len(P))
    turn[:3, :3] = earth_rotation(task.epoch.elapsed, task.position.lat).T
    # Gravity that is deflected tilts the answer and acts as an accelerometer bias: both hide each other.
    deflected = np.zeros((len(P), 2))
    deflected[:3] = static_jacobian(task.position.lat, task.gravity)[:, :2] * (DEFLECTION * task.gravity)
    deflected[6:] = answer.C_nb[:2].T * (DEFLECTION * task.gravity)
    P = turn @ P @ turn.T + deflected @ deflected.T
    P[:3, :3] = answer.phi_covariance
    bias, prior = fine.bias[3:], fine.system.P0.diagonal()[BIASES].copy()
    if (own := fine.accel_matrix).start < own.stop:
        acts = by_matrix(force)
        bias = bias + acts @ (fine.taken[own] + fine.end[own])
        prior[3:] += acts**2 @ fine.system.P0.diagonal()[own]
    return Handover(answer.C_nb, bias, P, prior)


def go_on(task: Task, fine: FineAlignment, noise: StaticModel) -> Ongoing:
    """The filter's end, from which it goes on."""
    integrals = fine.integrals
    sways = isinstance(fine, SwayAlignment)
    rest = None if sways else rest_trend(integrals, fine.C_n0_i, task.position.lat)
    sensors = fine.accel_matrix.stop  # behind their states: of an IMU that was turned, scale factors and misalignments
    # The arm of a sway of less than a minute is left behind: rows that follow show it as motion of the base.
    kept = np.arange(fine.system.states if sways else sensors)
    if isinstance(fine, SwayAlignment) and fine.slow_arm is not None:
        kept = np.delete(kept, fine.slow_arm)  # what is slow in a heading shows itself afterwards only
    return Ongoing(
        position=task.position,
        noise=noise,
        interval=task.interval,
        form=fine.form,
        C_n0_i=fine.C_n0_i,
        bias=fine.taken[BIASES],
        matrices=fine.taken[STATES:sensors] if sensors > STATES else None,
        R=fine.disturbance**2,
        arm=fine.taken[sensors : sensors + 3] if sways else None,
        motion=fine.motion if isinstance(fine, SwayAlignment) else (),
        trend=(sway_trend(integrals.C_mean), sway_trend(integrals.C_late)) if sways else rest,
        epochs=len(integrals.intervals),
        fitted=len(integrals.intervals),
        start=integrals.start,
        elapsed=float(integrals.time[-1]),
        C_ib=integrals.C_ib[-1].copy(),  # not the whole log's, which a view would hold
        velocity=integrals.velocity[-1].copy(),
        place=integrals.position[-1].copy(),
        x=fine.end[kept],
        P=fine.P[kept[:, None], kept],
        largest=block_limits(fine.estimates),
    )
