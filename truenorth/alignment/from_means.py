"""Attitude from the means of a log: of one that is too short for a filter, and of gyros that do not see the earth turn.

A mean is that of the whole log, and the answer is of its epoch. What a base has moved about its mean in between the gyros carry,
where that is more than they drift in the time; what they do not carry is in sigma.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.answer import assemble, without_heading
from truenorth.alignment.check import LogCheck, check_means
from truenorth.alignment.inference import allan_noise, specification
from truenorth.alignment.result import Alignment
from truenorth.alignment.task import Task, last_part, level_of
from truenorth.alignment.turning import turning_noise
from truenorth.alignment.usual import usual, wandering_as_usual
from truenorth.coarse import analytic
from truenorth.coarse.analytic import BLOCKS, Means, scatter_of, static_covariance
from truenorth.core.earth import EARTH_RATE
from truenorth.core.errors import AlignmentError
from truenorth.errors.staying import StaticModel
from truenorth.errors.whole_bias import about_average
from truenorth.quality.own_velocity import own_velocity
from truenorth.records.specs import ImuSpec
from truenorth.state.limits import limit
from truenorth.strapdown.increments import increments
from truenorth.strapdown.inertial_integration import inertial_integrals

Array = NDArray[np.float64]

SHORTEST_FILTER = 20.0  # s: below that a filter cannot tell the base's motion from tilt
STEADY = 20.0  # times the scatter of a mean rate over parts of the log
WINDOW = 10.0  # s, over which a wander of the attitude is taken
WANDER = 1.0 / 15.0  # of a random walk N over T about its line: N sqrt(T / 15)


def from_means(task: Task, spec: ImuSpec | None) -> tuple[Alignment, LogCheck]:
    """Attitude by the mean force and the mean rate, heading where the latter shows it.

    Parameters
    ----------
    spec : ImuSpec, optional
        Inferred from the log where it is left out.

    Returns
    -------
    answer : Alignment
    check : LogCheck
        What the means show of the biases.
    """
    lat, alt = task.position.lat, task.position.alt
    noise = cache(lambda: turning_noise(task.record))  # from row to row: short logs have no more
    rough, _ = specification(spec, _check(task, task.means, False), noise)
    means, moved = _at_the_epoch(task, rough)
    # Of a base that sways the mean of the force in body axes is less than gravity: that of the force as it was carried counts.
    carried = means is not task.means
    check = _check(task, means, carried)
    used, where = specification(spec, check, noise)
    P = task.bias_prior(used, level_of(means.f_b).T)
    C_nb, covariance, floor = analytic(means, lat, alt, P)
    covariance = covariance + moved**2 * np.eye(3)
    if carried:  # the mean rate is the base's own
        covariance, floor = without_heading(covariance), without_heading(floor)
    answer = assemble(task, used, where, C_nb, covariance, floor)
    return replace(answer, disturbance=_own_velocity(task)), check


def level_from_means(task: Task, spec: ImuSpec | None) -> tuple[Alignment, LogCheck]:
    """Level alone, from the mean specific force of a base that does not turn; heading zero by convention.

    Raises
    ------
    AlignmentError
        Gyros that read zero in every row.
    """
    whole = check_means(task.means, task.position.lat, task.gravity)
    # A base that turns by itself does so more in one part of the log than in another; what is steady is the gyros'.
    steady = spec is not None and float(np.hypot(*whole.rate_residual)) > STEADY * float(np.max(whole.rate_noise))
    task = last_part(task)
    if not task.record.gyro.any():
        raise AlignmentError(
            f"{task.record.source}: all gyros read zero in every row: are they dead, or written too coarsely to see any motion?"
        )
    check = check_means(task.means, task.position.lat, task.gravity)
    used, where = specification(spec, check, lambda: _blind_noise(task))
    moves = _wander(task, used) > _drift(task, used)
    check = whole if steady else _check(task, task.means, moves)
    means, moved = _at_the_epoch(task, used)
    C_nb = level_of(means.f_b)
    P = task.bias_prior(used, C_nb.T)
    covariance, floor = static_covariance(C_nb, means, task.position.lat, task.position.alt, P)
    covariance = without_heading(covariance + moved**2 * np.eye(3))
    answer = assemble(task, used, where, C_nb, covariance, without_heading(floor))
    # The mean rate is the gyro bias but for the earth's rate, of which the part about the vertical is known.
    up = C_nb[2]
    level_rate = EARTH_RATE * math.cos(task.position.lat)
    own = float(np.linalg.norm(task.means.w_ib_b)) if moves else 0.0
    variance = np.diag(task.means.w_covariance) + 0.5 * level_rate**2 * (1.0 - up**2) + own**2
    bias_sigma = np.sqrt(variance + _wandered(task, used))
    bias = task.means.w_ib_b - EARTH_RATE * math.sin(task.position.lat) * up
    return replace(answer, gyro_bias=bias, gyro_bias_sigma=bias_sigma, disturbance=_own_velocity(task)), check


def _own_velocity(task: Task) -> Array:
    """(3,) RMS velocity of the base's own motion, m/s; what is faster than any base is tilt."""
    return np.minimum(own_velocity(task.record), limit("fastest base"))


def _wandered(task: Task, spec: ImuSpec) -> float:
    """Variance of the gyros' bias at the epoch about its mean over the log, (rad/s)^2: it wanders within it."""
    before, whole = task.epoch.elapsed, task.record.duration
    after = max(whole - before, 0.0)
    bounded = about_average(before / spec.correlation_time, after / spec.correlation_time)
    walk = (before**3 + after**3) / (3.0 * whole**2)  # of a random walk, Brownian motion about its mean
    return spec.gyro_bias_instability**2 * bounded + spec.gyro_rate_random_walk**2 * walk


def _blind_noise(task: Task) -> StaticModel:
    """Random walks of a log of gyros that do not see the earth turn; biases wander as is usual: minutes hardly show it."""
    return wandering_as_usual(_louder(allan_noise(task.record), turning_noise(task.record)), promised=True)


def _louder(a: StaticModel, b: StaticModel) -> StaticModel:
    """The larger random walks: an Allan variance takes vibration for quantisation, and leaves too little for noise."""
    walks = {name: max(getattr(a, name), getattr(b, name)) for name in ("gyro_random_walk", "accel_random_walk")}
    return replace(a, **walks)


def _check(task: Task, means: Means, moves: bool) -> LogCheck:
    """What means show of the biases: the mean rate of a base that moves may all be its own."""
    check = check_means(means, task.position.lat, task.gravity)
    if not moves and task.motion.overall in ("still", "unknown"):
        return check
    return replace(check, rate_noise=np.hypot(check.rate_noise, float(np.linalg.norm(task.means.w_ib_b))))


def _at_the_epoch(task: Task, spec: ImuSpec) -> tuple[Means, float]:
    """Means in the axes of the body at the epoch, and one sigma of what it may have turned about them, rad.

    The gyros carry each force to the epoch, unless they drift by more over the log than the base has moved about its mean. In the
    inertial frame that they keep the vertical turns with the earth: towards where, a heading would say. Over a log that is long
    enough for a filter they carry nothing.
    """
    record, rows = task.record, task.epoch.row + 1
    if record.duration >= SHORTEST_FILTER:
        return task.means, _wander(task, spec)
    dtheta, dvel = increments(record)
    turned = np.cumsum(dtheta, axis=0)
    away = turned[task.epoch.row] - turned.mean(axis=0)
    up = task.means.f_b / np.linalg.norm(task.means.f_b)
    away = away - (away @ up) * up
    drift = _drift(task, spec)
    moved = max(_wander(task, spec), math.sqrt(max(float(away @ away) - drift**2, 0.0)))
    if moved < drift:
        return task.means, moved
    edges = np.unique(np.append(np.linspace(0, len(record), BLOCKS + 1).astype(int), rows))
    C_ib, velocity, _ = inertial_integrals(dtheta, dvel, record.steps, edges)
    C_be_i = task.epoch.attitude(C_ib[int(np.searchsorted(edges, rows))]).T
    lengths = np.diff(np.append(0.0, np.cumsum(record.steps))[edges])
    f = np.diff(velocity, axis=0) @ C_be_i.T / lengths[:, None]
    mean = C_be_i @ velocity[-1] / lengths.sum()
    return replace(task.means, f_b=mean, f_covariance=scatter_of(f) / len(f)), drift


def _drift(task: Task, spec: ImuSpec) -> float:
    """One sigma of what gyros add to the level that they carry from the middle of a log to its end, and the earth does, rad."""
    T = task.record.duration
    turned = EARTH_RATE * math.cos(task.position.lat) / math.sqrt(2.0)
    axes = max(spec.gyro_misalignment, usual("gyro", "misalignment", spec.gyro_random_walk)) * turned_by(task)
    walk = spec.gyro_random_walk * math.sqrt(T / 3.0)
    return math.sqrt((0.5 * T) ** 2 * (spec.gyro_bias**2 + turned**2) + walk**2 + axes**2)


def turned_by(task: Task) -> float:
    """The way that the attitude goes in the log, second by second, rad."""
    return float(np.sum(np.linalg.norm(task.motion.rate, axis=1)))


def _wander(task: Task, spec: ImuSpec) -> float:
    """RMS of the attitude about its mean within ten seconds, rad, without what the noise of the gyros makes of it."""
    seen = float(np.max(task.motion.wander, initial=0.0))
    noise = spec.gyro_random_walk * math.sqrt(WANDER * min(WINDOW, task.record.duration))
    return math.sqrt(max(seen**2 - noise**2, 0.0))
