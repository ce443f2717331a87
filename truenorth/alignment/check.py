"""What a log itself can check: the earth's rate along north and up, gravity along up.

On a base that stays where it is, the earth's rate and gravity are known. Three components can be held against them: the
rate along north and along the vertical (their length, and their angle to gravity against the latitude), and the specific
force along the vertical. The rate along *east*, which turns heading, and the level components of force, which tilt,
cannot be checked by anyone.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import CoarseStart, settle_fine
from truenorth.alignment.noise import fit_noise
from truenorth.alignment.task import Task
from truenorth.alignment.usual import wandering_as_usual
from truenorth.analysis.student import as_normal
from truenorth.coarse.analytic import BLOCKS, Means
from truenorth.core.attitude import length_of
from truenorth.core.earth import EARTH_RATE, gravity_of_place
from truenorth.errors.staying import BA, BG, BIASES, STATES, StaticModel, mean_velocity
from truenorth.errors.walks import Walks
from truenorth.estimate.base_motion import white_variance
from truenorth.filters import LinearSystem
from truenorth.quality.regimes import MotionSummary
from truenorth.records.specs import ImuSpec
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, integrate

Array = NDArray[np.float64]

LOST_HEADING = math.radians(20.0)  # that the scatter of a still base's mean rates leaves
BLIND_RATE = math.radians(5.0) / 3600.0  # rad/s: a mean rate this far from the earth's holds no heading
LOOSE_GYRO, LOOSE_ACCEL = math.radians(10.0) / 3600.0, 0.5  # rad/s, m/s^2: priors that let the log speak
HELD_GYRO, HELD_ACCEL = 1e-3 * LOOSE_GYRO, 1e-3 * LOOSE_ACCEL
# Along east, north and up: loose where the log can answer, held where tilt or heading would take the blame.
SWINGS, STRETCHES = 20.0, 20  # s at the most, in which the force of a base that swings averages out; of a log, at least
FREE_GYRO = np.diag([HELD_GYRO**2, LOOSE_GYRO**2, LOOSE_GYRO**2])
FREE_ACCEL = np.diag([HELD_ACCEL**2, HELD_ACCEL**2, LOOSE_ACCEL**2])


@dataclass(frozen=True)
class LogCheck:
    """Components of rate and specific force that the log lets us check, measured minus expected, with their noise.

    The scatter of a few block means is itself not well known: `dof` of them show it.
    """

    rate_residual: Array  # (2,) rad/s: along north and up
    rate_noise: Array  # (2,) rad/s
    force_residual: float  # m/s^2; along up
    force_noise: float  # m/s^2
    rate_dof: Array = field(default_factory=lambda: np.full(2, math.inf))
    force_dof: float = math.inf

    def rate_misses(self, bias: float) -> Array:
        """(2,) by how many sigmas the rates miss the earth's, where a bias has this sigma."""
        pairs = zip(self.rate_residual, self.rate_noise, self.rate_dof, strict=True)
        return np.array([_sigmas(*pair, bias) for pair in pairs])

    def force_misses(self, bias: float) -> float:
        """By how many sigmas the force misses gravity, where a bias has this sigma."""
        return _sigmas(self.force_residual, self.force_noise, self.force_dof, bias)


def _sigmas(residual: float, noise: float, dof: float, bias: float) -> float:
    """Of a known and an estimated sigma together, with the degrees of freedom of the sum (Welch, Satterthwaite)."""
    both = math.hypot(bias, noise)
    if both == 0.0:
        return math.inf if residual else 0.0
    return as_normal(residual / both, dof * (both / noise) ** 4 if 0.0 < noise < math.inf else math.inf)


def check_means(m: Means, lat: float, g: float) -> LogCheck:
    """What the means of a still base tell of the biases."""
    f = length_of(m.f_b)
    up = m.f_b / f
    w_up = float(m.w_ib_b @ up)
    level = m.w_ib_b - w_up * up
    w_level = length_of(level)
    north = level / w_level if w_level > 0 else np.zeros(3)
    return LogCheck(
        rate_residual=np.array([w_level - EARTH_RATE * math.cos(lat), w_up - EARTH_RATE * math.sin(lat)]),
        rate_noise=np.sqrt([north @ m.w_covariance @ north, up @ m.w_covariance @ up]),
        force_residual=f - g,
        force_noise=float(np.sqrt(up @ m.f_covariance @ up)),
        rate_dof=np.full(2, BLOCKS - 1.0),
        force_dof=BLOCKS - 1.0,
    )


def check_filter(
    task: Task,
    integrals: InertialIntegrals,
    C_n0_i: Array,
    usual: StaticModel,
    known: StaticModel | None = None,
    cell: Array | None = None,
) -> tuple[LogCheck, StaticModel]:
    """What the inertial frame shows of the biases and random walks: a filter that believes in no specified bias.

    The random walks are fitted about the usual ones, unless they are known. Biases act by the attitude of the cell, where there
    is one (:mod:`truenorth.estimate.cells`).
    """
    C_n_b = C_n0_i.T if cell is None else cell.T
    P = np.zeros((6, 6))
    P[:3, :3] = C_n_b @ FREE_GYRO @ C_n_b.T
    P[3:, 3:] = C_n_b @ FREE_ACCEL @ C_n_b.T
    noise = usual if known is None else known
    start = CoarseStart(task.record, C_n0_i, task.position, noise, P, task.interval, shares=cell is not None)
    sways = task.motion.overall != "still"
    log, last, _ = settle_fine(start, integrals, sways=sways, history=False)
    if known is None:
        noise = fit_task_noise(task, log.integrals, log.C_n0_i, log.prior.P[:STATES, :STATES], usual)
        log, last, _ = settle_fine(start._replace(C_n0_i=log.C_n0_i, model=noise), sways=sways, history=False)

    lat = task.position.lat
    C = earth_rotation(log.integrals.time[-1], lat).T @ log.C_n0_i @ log.integrals.C_ib[-1]
    bias, P_last = log.bias + last.found.end[BIASES], last.found.P
    rate, rate_P = C @ bias[:3], C @ P_last[BG, BG] @ C.T
    force, force_P = C @ bias[3:], C @ P_last[BA, BA] @ C.T
    slope = gravity_of_place(lat, task.position.alt + 1.0) - task.gravity
    check = LogCheck(
        rate_residual=rate[1:],
        rate_noise=np.sqrt(rate_P.diagonal()[1:]),
        force_residual=float(force[2]),
        force_noise=float(np.hypot(np.sqrt(force_P[2, 2]), slope * task.position.vertical_sigma)),
    )
    return check, noise


def fit_task_noise(
    task: Task, integrals: InertialIntegrals, C_n0_i: Array, P0: Array, usual: StaticModel
) -> StaticModel:
    """Random walks of a log, linearised about an attitude; biases as already taken off the integrals."""
    lat, alt = task.position.lat, task.position.alt

    # Q, R and S are linear in the squares of the random walks: linearise once for each, then add up.
    one = np.ones(3)
    silent = StaticModel(0.0, 0.0).linearise(integrals, C_n0_i, lat, alt, P0, one)
    terms = [StaticModel(*unit).linearise(integrals, C_n0_i, lat, alt, P0, one) for unit in np.eye(4).tolist()]

    def build(model: StaticModel, R: Array) -> LinearSystem:
        weights = [walk**2 for walk in astuple(model)]
        used = [(w, term) for w, term in zip(weights, terms, strict=True) if w > 0.0]
        return replace(
            silent,
            Q=sum((w * term.Q for w, term in used), silent.Q),
            R=sum((w * (term.R - np.eye(3)) for w, term in used), np.diag(R)),
            S=sum((w * term.S for w, term in used if term.S is not None), np.zeros_like(silent.H.swapaxes(1, 2))),
        )

    R = white_variance(mean_velocity(integrals, C_n0_i, lat, alt))
    if task.motion.overall != "still":
        return fit_noise(build, R, usual)
    return fit_noise(build, R, wandering_as_usual(fit_noise(build, R, usual)), climb=True)


def force_size(task: Task) -> tuple[float, float]:
    """By how much the specific force is larger than gravity in the mean, whatever the attitude, and its noise, m/s^2.

    By stretches, in the inertial frame: turns are taken off, and what pushes a base to and fro averages out. Of a load on a rope of
    length l that swings by an angle A it is ``g cos + v^2 / l`` along the rope, ``g A^2 / 4`` more than gravity in the mean: .25 mg
    of 2 deg. An attitude that gyros carry through 20 s at the most does not need their scale factors.
    """
    stretch = max(task.interval, min(SWINGS, task.record.duration / STRETCHES))
    size = np.linalg.norm(integrate(task.record, stretch).mean_force, axis=1)
    return float(size.mean()) - task.gravity, float(size.std()) / math.sqrt(len(size))


def sharper(filtered: LogCheck, mean: LogCheck, task: Task) -> LogCheck:
    """The filter's check, with those rates taken from the means that tell them better.

    A filter that knows only that the base goes nowhere sees the vertical gyro bias badly; on a base that does not turn
    either, the mean rate shows it at once. (On a swaying base coning gives the mean rate an offset, and it is not asked.)

    A filter that knows no scale factors carries no attitude through an IMU that turns on and on: what is up for it is not. There
    the size of the force is asked.
    """
    if task.motion.fraction("rotating") > 0.0:
        residual, noise = force_size(task)
        return replace(filtered, force_residual=residual, force_noise=noise, force_dof=math.inf)
    if task.motion.overall not in ("still", "disturbed"):
        return filtered
    better = mean.rate_noise < filtered.rate_noise
    return replace(
        filtered,
        rate_residual=np.where(better, mean.rate_residual, filtered.rate_residual),
        rate_noise=np.where(better, mean.rate_noise, filtered.rate_noise),
        rate_dof=np.where(better, mean.rate_dof, filtered.rate_dof),
    )


def implied(check: LogCheck, bias: Array, P: Array, P0: Array) -> LogCheck:
    """The check, with those rates that a filter with a prior implies better: what it saw before the prior drew it to zero.

    Of a bias b, known before to P0 and after to P, the data alone say ``b P0 / (P0 - P)``, to ``P P0 / (P0 - P)``. Where the
    data say less than the prior that is a small difference of large numbers, in which what the model leaves out weighs as
    much more: on a ship with an arm of 12 m the vertical rate missed by 2.7 of its sigmas (RMS). It is not asked there.

    Parameters
    ----------
    check : LogCheck
    bias : (3,) array, rad/s
        As estimated, along east, north and up.
    P, P0 : (3, 3) arrays, (rad/s)^2
        Its covariance, after and before.
    """
    after, before = P.diagonal()[1:], P0.diagonal()[1:]
    if not before.all():  # a filter that takes gyros for free of bias implies none
        return check
    seen = np.maximum(before - after, 1e-9 * before)
    noise = np.sqrt(after * before / seen)
    better = noise < np.minimum(check.rate_noise, np.sqrt(before))
    return replace(
        check,
        rate_residual=np.where(better, bias[1:] * before / seen, check.rate_residual),
        rate_noise=np.where(better, noise, check.rate_noise),
        rate_dof=np.where(better, math.inf, check.rate_dof),
    )


def is_blind(motion: MotionSummary, check: LogCheck) -> bool:
    """Whether the mean rate of a base that does not turn is so far from the earth's that it holds no heading.

    Of an IMU that is turned for a second the mean rate is that of the turn.
    """
    if motion.overall not in ("still", "disturbed") or motion.fraction("rotating") > 0.0:
        return False
    noise = 5.0 * float(check.rate_noise.max())
    return float(np.hypot(*check.rate_residual)) > max(BLIND_RATE, noise)


def is_lost(task: Task, check: LogCheck, spec: ImuSpec | None, heading_limit: float, *, inferred: bool = False) -> bool:
    """Whether the gyros of a still base hold no heading, and wander by more than a linear filter of the whole log can follow.

    By the scatter of their means; or by a specification whose biases leave heading less known than is wanted, where the tilt that
    they walk, squared, is more of gravity than the noise of the accelerometers. These level such a base by themselves. `inferred`:
    whether the specification is that of the log: gyros that warm up pass for noise there, and how far they walk is not known.
    """
    if task.motion.overall != "still" or task.motion.fraction("rotating") > 0.0:
        return False
    north = EARTH_RATE * math.cos(task.position.lat)
    lost = north * math.sin(LOST_HEADING)
    if float(check.rate_noise.max()) > lost:
        return True
    if inferred and spec is not None and math.sqrt(float(spec.bias_variance[0])) > lost:
        return True
    if spec is None or math.sqrt(float(spec.bias_variance[0])) < north * math.sin(min(heading_limit, 0.5 * math.pi)):
        return False
    walks, T = Walks.of(spec), task.record.duration
    tilt = walks.gyro_rate_walk * math.sqrt(T**3 / 3.0)
    return task.gravity * 0.5 * tilt**2 > walks.accel_random_walk / math.sqrt(T)
