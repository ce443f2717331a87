"""Level of an IMU that turns about in its own log, and whose gyros do not see the earth turn: a cheap one on a turntable or a ship.

What a turn shows as motion is the gyros' scale factor and misalignment, the accelerometers', and the arm from the axis of the
turns to the IMU: one per cent of a turn of 20 deg/s is a rate of .2 deg/s. So they are states, as an indexer's are. Gyros like
these carry no attitude through the log before their errors are known: the log is linearised over its first seconds, and then
over twice as many each time, about what the shorter part has shown.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.check import BLIND_RATE, LogCheck, force_size
from truenorth.alignment.fine import ARM_PRIOR, MAX_NOISE_PASSES, TURN_ARM, FineAlignment
from truenorth.alignment.inference import infer_spec
from truenorth.alignment.matched import innovations_of
from truenorth.alignment.setting_off import UNKNOWN, Away, fits_a_table, goes_away, stays_in
from truenorth.alignment.swaying import farthest
from truenorth.alignment.task import Task, filter_interval, level_of
from truenorth.alignment.usual import usual
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import EARTH_RATE, gravity_of_place
from truenorth.core.position import Position
from truenorth.errors.staying import PHI, StaticModel, mean_velocity
from truenorth.estimate.base_motion import COLOUR_ALARM, COLOUR_BLOCK, COLOUR_RUNS, VelocityNoise, white_variance
from truenorth.estimate.batch import CONVERGED, Filtered, Settled, in_sigmas, settle
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
HELD = 0.3  # rad, one sigma: farther a small-angle model is off by more than 1.5 %
ROUND, LAST = 10, 40  # passes over a part, and over the whole


@dataclass(frozen=True)
class TurningAlignment(FineAlignment):
    """What the last pass left.

    Passes may have more than one place for it: level is known no better than the likely ones agree, and no better than what the
    likeliest would still move it by. A log is refused where that is more than a sigma.
    """

    scatter: float  # rad^2; of each axis of level, over the passes
    held: Array  # (n,): see :class:`_Held`
    away: tuple[Away, ...] = ()  # parts in which the base goes away, and only the gyros are used

    @property
    def end(self) -> Array:
        """(n,) errors at the last epoch, with the course of the heading held."""
        return self.held


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
    if sum(motion.fraction(kind) for kind in (*ROCKING, "rotating")) < 0.9 * MOSTLY:
        return False
    rocks = np.array([kind in ROCKING for kind in KINDS])[motion.kind]
    turns = motion.kind == KINDS.index("rotating")
    rocks |= turns & (motion.wander > ROCKED)
    if turns.any():
        steps = np.linalg.norm(np.diff(motion.rate, axis=0), axis=1)
        steady = steps < STEADY * math.sqrt(2.0) * float(np.linalg.norm(motion.angle_noise))
        rocks[1:] &= ~steady
    return float(np.mean(rocks)) > MOSTLY


def infer_turning(task: Task, biases: Callable[[StaticModel], tuple[Array, Array]] | None = None) -> ImuSpec:
    """Specification of an IMU that turns: by its noise, by gravity, whose size shows at any attitude, and by its level rates.

    Where it turns on an indexer, `biases` gives what the encoder shows of the gyros' in place of those rates, by the noise:
    estimates and their sigmas (3,), rad/s. It is not asked of poor gyros: they begin with what it shows, from a wide prior.
    """
    noise = turning_noise(task.record)
    poor = usual("gyro", "bias", noise.gyro_random_walk) >= EARTH_RATE
    rates = _level_rates(task, noise) if poor or biases is None else biases(noise)
    return with_usual(infer_spec(LogCheck(*rates, *force_size(task)), noise))


def _level_rates(task: Task, noise: StaticModel) -> tuple[Array, Array]:
    """(2,) mean rates about two level axes, rad/s, and their noise: what a base that ends as level as it began leaves of biases.

    The earth's level rate goes into the noise, and how far the rate about the vertical leans to level: with the axes of the
    gyros, and with the vertical of biased accelerometers. Tilts, and turns of a tilted base, are in the scatter of the means.
    """
    means = task.means
    up = means.f_b / np.linalg.norm(means.f_b)
    level = np.linalg.svd(up[None])[2][1:]
    biased = usual("accel", "bias", noise.accel_random_walk) / task.gravity
    askew = math.hypot(biased, usual("gyro", "misalignment", noise.gyro_random_walk))
    others = 0.5 * (EARTH_RATE * math.cos(task.position.lat)) ** 2 + (askew * float(means.w_ib_b @ up)) ** 2
    return level @ means.w_ib_b, np.sqrt(np.diag(level @ means.w_covariance @ level.T) + others)


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
    sways = task.motion.overall == "swaying" or rocks_all_along(task.motion)
    away = () if sways else goes_away(task.record)
    fine = _fitted(task, spec, rows_at, sways, away)
    left = tuple(part for part in away if not fits_a_table(fine, part))
    return fine if left == away else _fitted(task, spec, rows_at, sways, left)


def _fitted(task: Task, spec: ImuSpec, rows_at: Array, sways: bool, away: tuple[Away, ...]) -> TurningAlignment:
    """:func:`turning_align`, of a base that goes away in parts of its log."""
    record, lat, alt = task.record, task.position.lat, task.position.alt
    rate = EARTH_RATE * math.cos(lat)
    arm = ARM_PRIOR if sways else TURN_ARM
    # A boat at anchor swings about another point than the one about which waves roll her.
    slow_arm = ARM_PRIOR if sways else 0.0
    prior = prior_of(
        np.diag(spec.bias_variance),
        spec=spec,
        arm=np.zeros(3),
        arm_sigma=arm,
        slow_arm_sigma=slow_arm,
        level_rate=rate * math.sqrt(0.5),
    )
    # Of any heading h: it is (sin h, cos h) less the (0, 1) of the convention.
    prior.mean[prior.groups["rate"]] = 0.0, -rate
    begin = record.time[0] - record.interval
    rests = max([part.end for part in away if math.isfinite(part.end)], default=begin)
    C, taken = level_of(record.between(rests, rests + LEVELLED).accel.mean(axis=0)), np.zeros(len(prior.mean))
    length = FIRST + rests - begin
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
        stays = stays_in(log.integrals.start + log.integrals.time, away)
        R = white_variance(mean_velocity(log.integrals, C, lat, alt)[stays])
        noise = VelocityNoise(np.where(stays[:, None], R, UNKNOWN**2), [stays], MAX_NOISE_PASSES)
        passes = _Passes(log, noise)
        last = settle(log, partial(_by_level, log, noise), passes.moved, most=LAST if whole else ROUND)
        best = passes.best(at_rest=last.moved < CONVERGED)
        log, end = best.log, best.found.end
        if whole:
            last = Settled(best.found, last.passes, best.moved)
            scatter, disturbance = passes.scatter(best), np.sqrt(best.R)
            found = TurningAlignment.of(log, last, prior.sensors, disturbance, scatter=scatter, held=end, away=away)
            return replace(found, settled=best.moved < limit("bound"))
        log.correct(end)
        C, taken, length = log.C_n0_i, log.taken, 2.0 * length


@dataclass(frozen=True)
class _Held(Filtered):
    """A pass that hardly moves what it does not see.

    The heading is a convention here, and its course is not known to the bias of the vertical gyro: hundreds of degrees in two
    minutes. A step of that size is chance, and takes the log out of what is linear. So a pass takes it that the heading at
    either end turns by nothing, give or take `HELD` (Levenberg's damping, of two directions). Sigmas are without it.
    """

    held: Array  # (n,)

    @property
    def end(self) -> Array:
        """(n,) errors to take off."""
        return self.held


class _Pass(NamedTuple):
    """What a pass found, about which log, and with which variance (3,) of the base's velocity."""

    log: StayingLog
    found: Filtered
    R: Array
    moved: float

    @property
    def log_likelihood(self) -> float:
        return float(self.found.estimates.log_likelihood)

    @property
    def up(self) -> Array:
        """(3,) the vertical at the end, in the body."""
        end = self.log.integrals
        C = earth_rotation(end.time[-1], self.log.position.lat).T @ self.log.C_n0_i @ end.C_ib[-1]
        return np.asarray((dcm_from_rotation_vector(self.found.end[PHI]) @ C)[2])


def _likelier(one: _Pass | None, other: _Pass | None) -> bool:
    """Whether a pass is likelier than another by more than chance; any is likelier than none."""
    if one is None or other is None:
        return one is not None
    return one.log_likelihood - other.log_likelihood > 0.5 * limit("rival")


class _Passes:
    """The passes over a log: the likeliest of them, and how far they agree on the vertical.

    Biases act by a mean attitude here, which is not how they do act where a base swings by tens of degrees: Gauss and Newton's
    steps go by a slope that is about right, and passes may go round, or walk away from a good place to a worse one where they
    rest. A log's likelihood is the same about any nominal solution, as far as the system is linear: the place about which it is
    larger is the better one.
    """

    def __init__(self, log: StayingLog, noise: VelocityNoise) -> None:
        self.log, self.noise = log, noise
        self.near: _Pass | None = None  # the likeliest of those that moved level by little
        self.any: _Pass | None = None
        self.likelihoods: list[float] = []
        self.ups: list[Array] = []

    def moved(self, found: Filtered) -> float:
        """By how many sigmas a pass has moved level."""
        by = in_sigmas(LEVEL)(Filtered(found.system, found.estimates))
        self.last = _Pass(copy.copy(self.log), found, self.noise.of_base, by)
        self.likelihoods.append(self.last.log_likelihood)
        self.ups.append(self.last.up)
        if by < limit("bound") and (self.near is None or self.last.log_likelihood > self.near.log_likelihood):
            self.near = self.last
        if self.any is None or self.last.log_likelihood > self.any.log_likelihood:
            self.any = self.last
        return by

    def best(self, *, at_rest: bool) -> _Pass:
        """The last pass, or one that is likelier than by chance; one that moves level little, unless passes went round elsewhere.

        Of two that are as likely but for chance, the one that moves level little is nearer to a place of rest.
        """
        likeliest = self.near if at_rest or not _likelier(self.any, self.near) else self.any
        return likeliest if likeliest is not None and _likelier(likeliest, self.last) else self.last

    def scatter(self, best: _Pass) -> float:
        """Variance of the level of passes about the best, each as likely as it is, and of what that moves: an axis, rad^2."""
        weight = np.exp(np.minimum(np.array(self.likelihoods) - best.log_likelihood, 0.0))
        away = np.sum((np.array(self.ups) - best.up) ** 2, axis=1)
        left = best.found.end[LEVEL]
        return 0.5 * float(weight @ away / weight.sum() + left @ left)


def coloured_level(fine: TurningAlignment, spec: ImuSpec, gravity: float) -> float:
    """Variance by which slow motion of a base that swings makes level worse than its filter says, of an axis, rad^2.

    A boat that sails to and fro on her anchor goes metres in some ten seconds, in step with her heading: no white noise of velocity
    is like that, and the biases that turn with heading come out too well, by as much as innovations that follow each other add up
    to more than they should over `COLOUR_BLOCK`. Waves are faster than that. The biases of accelerometers in full are the most: so
    much is level worse where heading is not used at all.
    """
    white = innovations_of(fine).white[:, LEVEL, 0]
    alike = np.mean(white[1:] * white[:-1], axis=0) / np.maximum(np.mean(white**2, axis=0), 1e-300)
    blocks = len(white) // COLOUR_BLOCK
    if blocks < COLOUR_RUNS or np.max(alike) < COLOUR_ALARM / math.sqrt(len(white)):
        return 0.0
    sums = np.sum(white[: blocks * COLOUR_BLOCK].reshape(blocks, COLOUR_BLOCK, -1), axis=1)
    more = max(float(np.max(np.mean(sums**2, axis=0))) / COLOUR_BLOCK - 1.0, 0.0)
    known = float(np.max(np.diag(fine.P)[LEVEL]))
    return min(more * known, float(np.max(spec.bias_variance[3:5])) / gravity**2)


def strays(fine: FineAlignment, position: Position, walk: float) -> float:
    """How much farther the IMU is from its mean place, at most, than tilts make it seem that its gyros walk, m.

    Gyros with a random walk ``N`` (rad/sqrt(s)) tilt by ``N W(t)``, and gravity carries the computed place away: less the cubic
    that :func:`farthest` takes off, by .0031 g N T^2.5 (one sigma) at the ends, 14 m of a consumer IMU after 300 s. What goes no
    farther than three of these may be as far as that in level, and no more: the filter knows that walk.
    """
    T = float(fine.integrals.time[-1])
    seems = AT_ENDS * gravity_of_place(position.lat, position.alt) * walk * T**2.5
    return farthest(fine, position) - 3.0 * seems


def _by_level(log: StayingLog, noise: VelocityNoise, system: LinearSystem) -> Filtered:
    """Filtered without the vertical: it carries no attitude, and what tilts of degrees do to it is of second order."""
    found = noise(system.with_arrays(R=system.R + np.diag([0.0, 0.0, VERTICAL**2])))
    x, P = found.end, found.P
    H = np.stack([np.eye(len(x))[PHI.stop - 1], log.at_start()[PHI.stop - 1]])
    held = x - P @ H.T @ np.linalg.solve(H @ P @ H.T + HELD**2 * np.eye(2), H @ x)
    return _Held(found.system, found.estimates, held)
