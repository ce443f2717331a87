"""Level of an IMU that turns about in its own log, and whose gyros do not see the earth turn: a cheap one on a turntable or a ship.

What a turn shows as motion is the gyros' scale factor and misalignment, the accelerometers', and the arm from the axis of the
turns to the IMU: one per cent of a turn of 20 deg/s is a rate of .2 deg/s. So they are states, as an indexer's are. Gyros like
these carry no attitude through the log before their errors are known: the log is linearised over its first seconds, and then
over twice as many each time, about what the shorter part has shown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.check import BLIND_RATE, LogCheck
from truenorth.alignment.fine import ARM_PRIOR, MAX_NOISE_PASSES, TURN_ARM, FineAlignment
from truenorth.alignment.inference import GYRO_WIDTH, infer_spec
from truenorth.alignment.swaying import farthest
from truenorth.alignment.task import Task, filter_interval, level_of
from truenorth.alignment.usual import usual
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import EARTH_RATE, gravity_of_place
from truenorth.core.position import Position
from truenorth.errors.staying import PHI, StaticModel, mean_velocity
from truenorth.estimate.base_motion import VelocityNoise, white_variance
from truenorth.estimate.batch import Filtered, in_sigmas, settle
from truenorth.estimate.staying import StayingLog, prior_of
from truenorth.filters import LinearSystem
from truenorth.quality.density import noise_densities
from truenorth.quality.floor import white_floor
from truenorth.quality.regimes import KINDS, Kind, MotionSummary
from truenorth.quality.signals import white_noise
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.limits import limit
from truenorth.strapdown.inertial import earth_rotation

Array = NDArray[np.float64]

FIRST = 8.0  # s, the shortest part; gyros that are off by .3 deg/s have turned by 2.4 deg in it
LEVELLED = 1.0  # s, whose mean specific force levels to begin with
MOSTLY = 0.95  # of the seconds
ROCKING: tuple[Kind, ...] = ("disturbed", "swaying", "moving")  # what a ship does that goes nowhere
ROCKED = math.radians(0.2)  # RMS about a steady turn, over 10 s
STEADY = 3.0  # times its noise, by which a steady rate changes at most from second to second
VERTICAL = 10.0  # m/s, what is taken to disturb it
LEVEL = slice(0, 2)
TURNING = ("still", "disturbed", "rotating")  # bases on which an IMU may be turned
AT_ENDS = 0.0031  # of g N T^2.5: a thrice integrated white noise less its cubic, at the ends
ROUND, LAST = 10, 200  # passes over a part, and over the whole: swings of tens of degrees take 40 to 150


@dataclass(frozen=True)
class TurningAlignment(FineAlignment):
    """What the last pass left.

    Passes that take long to come to rest may have more than one place for it: level is known no better then than they agree. Those
    that do not come to rest at all are refused, though the last may move little: of 217 swaying logs one was 4.5 sigmas off.
    """

    scatter: float  # rad^2; of each axis of level, over such passes; zero of others


def turns_blindly(task: Task, spec: ImuSpec | None) -> bool:
    """Whether the IMU turns or sways in its log, and its gyros are too poor to see the earth turn."""
    overall, rocks = task.motion.overall, rocks_all_along(task.motion)
    turns = overall in TURNING and task.motion.fraction("rotating") > 0.0  # for a while, of a base that stays
    if not (turns or overall == "swaying" or (overall in ("moving", "disturbed") and rocks)):
        return False
    if spec is not None:
        return spec.gyro_bias > BLIND_RATE
    if turns and not rocks:
        walk: float | None = float(np.max(task.motion.angle_noise))
    else:  # a sway has no quiet seconds: only what is faster than it is noise
        walks = sway_walks(task.record)
        walk = None if walks is None else walks.gyro_random_walk
    return walk is not None and usual("gyro", "bias", walk) > BLIND_RATE


def was_blind(task: Task, inferred: ImuSpec) -> bool:
    """The same, with the specification that an alignment has inferred: by its noise, too, since a base that leaves seems a bias."""
    return turns_blindly(task, inferred) and usual("gyro", "bias", inferred.gyro_random_walk) > BLIND_RATE


def rocks_all_along(motion: MotionSummary) -> bool:
    """Whether the base moves in one way from the first second to the last: a ship whose IMU sits far from its centre does.

    Its arm accelerates it now less and now more, and the waves that she meets come in groups: sway, acceleration and what is less
    than a sway may take turns. A buoy that swings on its chain turns by tens of degrees, but rocks as it turns: no table does. Nor
    does a base that rocks pause: the rate of an IMU that was turned for a while is steady before and after, and where the log
    is too short for ten seconds of rest its wander is that of the turn.
    """
    if not motion.kind.size:
        return False
    rocks = np.array([kind in ROCKING for kind in KINDS])[motion.kind]
    turns = motion.kind == KINDS.index("rotating")
    rocks |= turns & (motion.wander > ROCKED)
    if turns.any():
        steps = np.linalg.norm(np.diff(motion.rate, axis=0), axis=1)
        steady = steps < STEADY * math.sqrt(2.0) * float(np.linalg.norm(motion.angle_noise))
        rocks[1:] &= ~steady
    return float(np.mean(rocks)) > MOSTLY


def infer_turning(task: Task) -> ImuSpec:
    """Specification of an IMU that turns: by its noise, and by gravity, whose size the accelerometers show at any attitude."""
    noise = turning_noise(task.record)
    size = np.linalg.norm(task.motion.specific_force, axis=1)
    none = np.zeros(0)
    check = LogCheck(none, none, float(size.mean()) - task.gravity, float(size.std()) / math.sqrt(len(size)))
    inferred = infer_spec(check, noise)
    # With no rate to check, one sigma above the usual: the mean over all that a bias might be has the longest of tails.
    return with_usual(replace(inferred, gyro_bias=math.exp(GYRO_WIDTH) * usual("gyro", "bias", noise.gyro_random_walk)))


def sway_walks(record: ImuRecord) -> StaticModel | None:
    """Random walks of the worst axes under a smooth motion, or between the lines of what shakes; None where neither shows them."""
    density, floor = noise_densities(record)[1], white_floor(record)
    white = np.isfinite(density).sum(axis=0) > 0.5 * len(density)
    walks = floor.copy()
    if white.any():
        walks[white] = np.nanmedian(density[:, white], axis=0)
        walks = np.where(walks > limit("one noise") * floor, floor, walks)  # no white noise is louder than the floor
    if not np.isfinite(walks).all():
        return None
    return StaticModel(float(walks[:3].max()), float(walks[3:].max()))


def turning_noise(record: ImuRecord) -> StaticModel:
    """Random walks of the worst axes, from row to row: a filter that knows no scale factors takes turns for noise."""
    smooth = sway_walks(record)
    if smooth is not None:
        return smooth
    walks = white_noise(record)
    return StaticModel(float(walks[:3].max()), float(walks[3:].max()))


def with_usual(spec: ImuSpec) -> ImuSpec:
    """A specification with the errors that no log of a few turns shows, as they are usual of sensors with such random walks."""
    found: dict[str, Any] = {
        f"{sensor}_{name}": usual(sensor, name, walk)
        for sensor, walk in (("gyro", spec.gyro_random_walk), ("accel", spec.accel_random_walk))
        for name in ("bias_instability", "scale_factor", "misalignment")
    }
    return replace(spec, **found)


def turning_align(task: Task, spec: ImuSpec, rows_at: Array) -> TurningAlignment:
    """Attitude (heading by convention), biases, scale factors, misalignments and arm from a whole log.

    Parameters
    ----------
    rows_at : (M,) int array
        Rows after which the integrated attitude is wanted.
    """
    record, lat, alt = task.record, task.position.lat, task.position.alt
    rate = EARTH_RATE * math.cos(lat)  # one sigma of (0, 1) - (sin h, cos h) is about as large
    sways = task.motion.overall == "swaying" or rocks_all_along(task.motion)
    arm = ARM_PRIOR if sways else TURN_ARM
    prior = prior_of(np.diag(spec.bias_variance), spec=spec, arm=np.zeros(3), arm_sigma=arm, level_rate=rate)
    begin = record.time[0] - record.interval
    C, taken = level_of(record.between(None, begin + LEVELLED).accel.mean(axis=0)), prior.mean
    length = FIRST
    while True:
        whole = length >= record.duration
        part = record if whole else record.between(None, begin + length)
        log = StayingLog(
            part,
            C,
            task.position,
            StaticModel.of(spec),
            prior,
            task.interval if whole else filter_interval(part),
            rows_at if whole else None,
            sways=sways,
            taken=taken,
        )
        R = white_variance(mean_velocity(log.integrals, C, lat, alt))
        everywhere = np.ones(len(log.integrals.intervals), dtype=np.bool_)
        noise = VelocityNoise(np.tile(R, (len(everywhere), 1)), [everywhere], MAX_NOISE_PASSES, grows_after=ROUND)
        ups: list[Array] = []
        last = settle(log, partial(_by_level, noise), partial(_moved, log, ups), most=LAST if whole else ROUND)
        if whole:
            scatter = _scatter(np.array(ups)) if last.passes > ROUND else 0.0
            found = TurningAlignment.of(log, last, prior.sensors, np.sqrt(noise.R[0]), scatter=scatter)
            return replace(found, settled=last.passes < LAST)  # of so many one may move little by chance
        log.correct(last.found.end)
        C, taken, length = log.C_n0_i, log.taken, 2.0 * length


def _moved(log: StayingLog, ups: list[Array], found: Filtered) -> float:
    """By how many sigmas a pass has moved level; where it puts the vertical at the end, in the body, goes to `ups`."""
    end = log.integrals
    C = earth_rotation(end.time[-1], log.position.lat).T @ log.C_n0_i @ end.C_ib[-1]
    ups.append((dcm_from_rotation_vector(found.end[PHI]) @ C)[2])
    return in_sigmas(LEVEL)(found)


def _scatter(ups: Array) -> float:
    """Variance of the level of passes (P, 3) about the last, of each axis, rad^2."""
    return 0.5 * float(np.mean(np.sum((ups - ups[-1]) ** 2, axis=1)))


def strays(fine: FineAlignment, position: Position, walk: float) -> float:
    """How much farther the IMU is from its mean place, at most, than tilts make it seem that its gyros walk, m.

    Gyros with a random walk ``N`` (rad/sqrt(s)) tilt by ``N W(t)``, and gravity carries the computed place away: less the cubic
    that :func:`farthest` takes off, by .0031 g N T^2.5 (one sigma) at the ends, 14 m of a consumer IMU after 300 s. What goes no
    farther than three of these may be as far as that in level, and no more: the filter knows that walk.
    """
    T = float(fine.integrals.time[-1])
    seems = AT_ENDS * gravity_of_place(position.lat, position.alt) * walk * T**2.5
    return farthest(fine, position) - 3.0 * seems


def _by_level(noise: VelocityNoise, system: LinearSystem) -> Filtered:
    """Filtered without the vertical: it carries no attitude, and what tilts of degrees do to it is of second order."""
    return noise(system.with_arrays(R=system.R + np.diag([0.0, 0.0, VERTICAL**2])))
