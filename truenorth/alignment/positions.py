"""`align_positions`: from the log of a turntable that takes an IMU from position to position to attitude, biases and a verdict.

One filter goes through the whole log, turns included (:mod:`truenorth.errors.matrices`), re-linearised until it stands still.
The table's angles are not asked for: the gyros measure each turn, and their scale factors and misalignments are states.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.answer import at_epoch, of_level_alone
from truenorth.alignment.check import LogCheck, check_means, is_blind
from truenorth.alignment.fine import FineAlignment, attitude_history
from truenorth.alignment.inference import infer_spec
from truenorth.alignment.result import Alignment, History
from truenorth.alignment.table import TablePosition, TurntableErrors
from truenorth.alignment.task import Task, bridged, level_of, make_task, noise_in
from truenorth.alignment.touched import Touch, find_touch
from truenorth.alignment.verdict import base_evidence, judged, leaves
from truenorth.coarse import Means, means, oba
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.earth import EARTH_RATE, normal_gravity
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.position import Position
from truenorth.errors.matrices import matrices_of
from truenorth.errors.staying import BA, BG, BIASES, PHI, StaticModel, mean_velocity
from truenorth.estimate.base_motion import VelocityNoise, white_variance
from truenorth.estimate.batch import in_sigmas, settle
from truenorth.estimate.staying import Prior, StayingLog, prior_of
from truenorth.quality.noise import noise_coefficients
from truenorth.quality.regimes import MotionSummary
from truenorth.records import ImuRecord
from truenorth.records.calibration import Calibration
from truenorth.records.specified import corrected
from truenorth.records.specs import PRESETS, ImuSpec, imu_spec
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, gravity_velocity

Array = NDArray[np.float64]

HEADING_LIMIT = math.radians(5.0)
SLEW_RATE = math.radians(0.2)  # rad/s: a table that turns faster is between positions
SHORTEST_POSITION = 5.0  # s
MAX_PASSES = 25  # a heading that gyros hardly see may go round half the circle first, from 3 deg a pass on (17 passes)
NOISE_PASSES = 4
FEWEST = 5  # intervals that a variance is fitted to
ARM_SIGMA = 0.05  # m: of the IMU from the table's axes
WIDER = 4.0  # steps in which an inferred accelerometer bias is tried wider, ...
WORTH = 4.0  # ... as long as the log-likelihood grows by more than this


def align_positions(
    record: ImuRecord,
    position: Position,
    imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None,
    *,
    calibration: Calibration | None = None,
    arm_sigma: float = ARM_SIGMA,
    heading_limit: float = HEADING_LIMIT,
    progress: Callable[[str], None] | None = None,
) -> Alignment:
    """Find pitch, roll and true heading, and the sensors' errors, from a log with several positions of a turntable.

    Any sequence of positions: turns are found in the gyros. The more the positions differ, the more of the biases is known
    apart from tilt and heading; two that differ by 180 deg about the vertical are enough for the level sensors.

    Parameters
    ----------
    record : ImuRecord
        Body axes RFU.
    imu : ImuSpec, str, path or mapping, optional
        Specification; its scale factors and misalignments are the prior of the matrices. Inferred from the log without one.
    arm_sigma : float, m
        How far the IMU may sit from where the table's axes meet. At a constant rate its centripetal force is an accelerometer
        bias as far as anyone can see: ``rate^2 arm``.
    calibration, heading_limit, progress
        As of :func:`truenorth.align`.

    Returns
    -------
    Alignment
        At the last sample; its `table` holds positions, matrices and whether the table was touched.

    Raises
    ------
    UsageError
        A limit that is not positive.
    DataError
        A gap in the log that cannot be bridged.
    AlignmentError
        No position of 5 s is found.
    """
    tell = progress or (lambda stage: None)
    if not heading_limit > 0.0:
        raise UsageError(f"heading limit {np.degrees(heading_limit):g} deg; expected a positive angle")
    if not arm_sigma >= 0.0:
        raise UsageError(f"arm_sigma {arm_sigma:g} m; expected zero or more")
    spec = None if imu is None else noise_in(record, imu_spec(imu))
    task = make_task(bridged(corrected(record, spec, calibration)), position, None)
    tell("looking for positions")
    stretches = find_positions(task.motion)
    if not stretches:
        raise AlignmentError(
            f"{record.source}: no position of {SHORTEST_POSITION:g} s and more was found in {record.duration:.0f} s: the table "
            f"never turns slower than {np.degrees(SLEW_RATE):g} deg/s for so long; record longer positions"
        )
    longest = max(stretches, key=lambda s: s[1] - s[0])
    part = task.record.between(longest[0] + 1e-6, longest[1] - 1e-6)
    still = means(part)
    check = check_means(still, position.lat, task.gravity)
    used, where = (spec, f"specification {spec.name!r}") if spec else (_inferred(check, part), "inferred from the log")
    blind = is_blind(replace(task.motion, kind=np.zeros(1, np.int8)), check)

    tell(f"aligning over {len(stretches)} positions")
    rest = still if blind else None
    fine, x, prior = _fine(task, stretches, used, rest, arm_sigma)
    while spec is None:  # level biases show in no single position: only turns say how large they are
        wider = replace(used, accel_bias=WIDER * used.accel_bias)
        again, x_again, _ = _fine(task, stretches, wider, rest, arm_sigma)
        if not again.estimates.log_likelihood > fine.estimates.log_likelihood + WORTH:
            break
        used, fine, x = wider, again, x_again
    C_n0_b, covariance, floor = fine.misalignment_at(fine.integrals.C_ib_at[0], task.epoch.elapsed)
    answer = at_epoch(task, used, where, C_n0_b, covariance, floor)
    touch = _touched(task, fine, stretches, used)
    found = _positions(fine, stretches, position.lat)
    sigma = np.sqrt(np.diag(fine.P))
    answer = replace(
        answer,
        method="positions",
        method_reason=f"{len(found)} position{'s' if len(found) > 1 else ''} in the log, turns between them by the gyros",
        gyro_bias=x[BG],
        gyro_bias_sigma=sigma[BG],
        accel_bias=x[BA],
        accel_bias_sigma=sigma[BA],
        disturbance=fine.disturbance,
        history=_history(task, fine),
        table=_errors(found, touch, prior, x, fine.P),
    )
    answer = of_level_alone(answer) if blind else answer
    evidence = [] if touch is None else [touch.evidence(task.gravity)]
    evidence += leaves(_leaves(task.motion, stretches)) + base_evidence(answer, check, None, settled=fine.settled)
    return judged(answer, evidence, heading_limit)


def find_positions(motion: MotionSummary) -> list[tuple[float, float]]:
    """Start and stop (s, on the record's clock) of each stretch of 5 s and more in which the table does not turn."""
    if motion.time.size < SHORTEST_POSITION:
        return []
    noise = 5.0 * float(np.max(motion.angle_noise))  # of a rate over one second
    rests = np.linalg.norm(motion.rate, axis=1) < SLEW_RATE + noise
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rests, [False]]).astype(np.int8)))
    step = float(motion.time[1] - motion.time[0])
    stretches = [(float(motion.time[a]) - step, float(motion.time[b - 1])) for a, b in edges.reshape(-1, 2)]
    return [s for s in stretches if s[1] - s[0] >= SHORTEST_POSITION]


def _leaves(motion: MotionSummary, stretches: list[tuple[float, float]]) -> float | None:
    """When the base first goes somewhere within a position, s on the record's clock; None if it stays."""
    starts = [r.start for r in motion.regimes if r.kind == "moving"]
    return next((t for t in starts if any(a < t + 1.0 < b for a, b in stretches)), None)


def _inferred(check: LogCheck, part: ImuRecord) -> ImuSpec:
    """What a still position shows, and what it hides as in the class of IMU with such biases: scale factors, slow wander."""
    gyro, accel = noise_coefficients(part)
    noise = StaticModel(float(np.max(gyro.random_walk)), float(np.max(accel.random_walk)))
    spec = infer_spec(check, noise)
    classes = [imu_spec(name) for name in PRESETS]
    same = next((c for c in classes if c.gyro_bias >= 0.5 * spec.gyro_bias), classes[-1])
    names = ("gyro_scale_factor", "gyro_misalignment", "accel_scale_factor", "accel_misalignment")
    return replace(
        spec,
        gyro_bias_instability=max(float(np.max(gyro.bias_instability)), same.gyro_bias_instability),
        accel_bias_instability=max(float(np.max(accel.bias_instability)), same.accel_bias_instability),
        **{name: getattr(same, name) for name in names},
    )


def prior_covariance(spec: ImuSpec, position: Position) -> Array:
    """(6, 6) covariance of the biases before the log, with what an error of height makes of gravity."""
    slope = float(normal_gravity(position.lat, position.alt + 1.0) - normal_gravity(position.lat, position.alt))
    return np.diag(spec.bias_variance + (np.arange(6) >= 3) * (slope * position.vertical_sigma) ** 2)


def _fine(
    task: Task, stretches: list[tuple[float, float]], spec: ImuSpec, rest: Means | None, arm_sigma: float
) -> tuple[FineAlignment, Array, Prior]:
    """Gauss-Newton over the whole log; the last pass, the errors of sensors and arm in all (n,), and their prior.

    `rest` are the means of a position of an IMU whose gyros do not see the earth turn: they show the gyros' biases at once.
    """
    lat, alt = task.position.lat, task.position.alt
    P_bias, bias = prior_covariance(spec, task.position), np.zeros(6)
    if rest is not None:
        bias[:3], P_bias[:3, :3] = _bias_at_rest(rest, lat)
    prior = prior_of(P_bias, bias=bias, spec=spec, arm=np.zeros(3), arm_sigma=arm_sigma)
    rows = np.array([task.epoch.row])
    log = StayingLog(task.record, np.eye(3), task.position, StaticModel.of(spec), prior, task.interval, rows)
    rests = _resting(log.integrals, stretches)
    if rest is not None:  # no north to be found: i is the body at the first sample
        log.C_n0_i = level_of(log.integrals.mean_force[np.flatnonzero(rests)[0]])
    else:
        log.C_n0_i = oba(log.integrals, lat, alt, history=False).C_n0_i
    parts = [part for part in (rests, ~rests) if np.count_nonzero(part) >= FEWEST]
    velocity = mean_velocity(log.integrals, log.C_n0_i, lat, alt)
    noise = VelocityNoise(np.tile(white_variance(velocity[rests]), (len(velocity), 1)), parts, NOISE_PASSES)
    last = settle(log, noise, in_sigmas(PHI), most=MAX_PASSES)
    parameters = slice(BIASES.start, len(log.taken))
    fine = FineAlignment.of(log, last, parameters, np.sqrt(noise.R[rests][0]))
    return fine, log.taken + fine.end, prior


def _bias_at_rest(rest: Means, lat: float) -> tuple[Array, Array]:
    """Gyro biases of a base that does not turn, and their covariance: the mean rate but for the earth's about the level."""
    up = rest.f_b / np.linalg.norm(rest.f_b)
    level = 0.5 * (EARTH_RATE * math.cos(lat)) ** 2 * (np.eye(3) - np.outer(up, up))
    return rest.w_ib_b - EARTH_RATE * math.sin(lat) * up, rest.w_covariance + level


def _resting(integrals: InertialIntegrals, stretches: list[tuple[float, float]]) -> NDArray[np.bool_]:
    """(K,) whether an interval lies in a position."""
    begin, end = integrals.start + integrals.time[:-1], integrals.start + integrals.time[1:]
    inside = [(begin >= a - 1e-6) & (end <= b + 1e-6) for a, b in stretches]
    return np.asarray(np.any(inside, axis=0))


def _touched(task: Task, fine: FineAlignment, stretches: list[tuple[float, float]], spec: ImuSpec) -> Touch | None:
    """The largest step of level specific force within a position."""
    time = fine.integrals.time
    gravity = np.diff(gravity_velocity(time, task.position.lat, task.position.alt), axis=0)
    force = fine.integrals.mean_force @ fine.C_n0_i.T + gravity / fine.integrals.intervals[:, None]
    found = []
    for stretch in stretches:
        here = _resting(fine.integrals, [stretch])
        at, level = (fine.integrals.start + time[1:])[here], force[here, :2]
        of_gyros = spec.gyro_random_walk, spec.gyro_bias_instability, spec.correlation_time
        touch = find_touch(at, level, task.gravity, *of_gyros)
        if touch is not None:
            found.append(touch)
    return max(found, key=lambda touch: touch.size, default=None)


def _positions(fine: FineAlignment, stretches: list[tuple[float, float]], lat: float) -> tuple[TablePosition, ...]:
    """Where each position stands, and how the body came there from the one before."""
    found: list[TablePosition] = []
    C_n0_b = dcm_from_rotation_vector(fine.end[PHI]) @ fine.C_n0_i @ fine.integrals.C_ib[1:]
    C_nb = np.swapaxes(earth_rotation(fine.integrals.time[1:], lat), 1, 2) @ C_n0_b
    for start, stop in stretches:
        here = np.flatnonzero(_resting(fine.integrals, [(start, stop)]))
        if here.size == 0:
            continue
        C = C_nb[here[here.size // 2]]
        turn = rotation_vector_from_dcm(found[-1].C_nb.T @ C) if found else np.zeros(3)
        found.append(TablePosition(start, stop, C, turn))
    return tuple(found)


def _errors(found: tuple[TablePosition, ...], touch: Touch | None, prior: Prior, x: Array, P: Array) -> TurntableErrors:
    matrices, arm = prior.groups["matrices"], prior.groups["arm"]
    sigma = np.sqrt(np.diag(P))
    (gyro, accel), (gyro_sigma, accel_sigma) = matrices_of(x[matrices]), matrices_of(sigma[matrices])
    return TurntableErrors(found, touch, gyro, gyro_sigma, accel, accel_sigma, x[arm], sigma[arm])


def _history(task: Task, fine: FineAlignment) -> History:
    """How the filter came to its answer, in navigation axes."""
    C_nb, covariance, floor = attitude_history(fine, task.position.lat)
    e = fine.estimates
    sigma = np.sqrt(np.einsum("kii->ki", e.P))
    # The final answer carried back: phi(t) = phi_end - int_t^end (what the sensors' errors turn).
    parameters = slice(BIASES.start, None)
    turns = np.einsum("kij,j->ki", fine.system.Phi[:, PHI, parameters], fine.end[parameters])
    after = np.concatenate([np.cumsum(turns[:0:-1], axis=0)[::-1], np.zeros((1, 3))])
    C_n_n0 = np.swapaxes(earth_rotation(fine.integrals.time[1:], task.position.lat), 1, 2)
    departure = np.einsum("kij,kj->ki", C_n_n0, fine.end[PHI] - after - e.x[:, PHI])
    return History(
        time=fine.integrals.start + fine.integrals.time[1:],
        C_nb=C_nb,
        phi_covariance=covariance + task.deflection,
        phi_floor=floor + task.deflection,
        departure=departure,
        gyro_bias=fine.taken[BG] + e.x[:, BG],
        gyro_bias_sigma=sigma[:, BG],
        accel_bias=fine.taken[BA] + e.x[:, BA],
        accel_bias_sigma=sigma[:, BA],
        innovation=e.innovation,
        innovation_sigma=np.sqrt(np.einsum("kii->ki", e.innovation_covariance)),
        nis=e.nis,
    )
