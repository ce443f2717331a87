"""What begins within a log, hidden by the noise that it makes.

The filter reads the noise of the base's velocity from its innovations. What a change makes of them is in that noise as well,
and no signature stands out of it any more; but then the innovations follow each other, and are smaller than they should be. So
the best signatures are taken off the measurements, and the noise read anew: by how much the likelihood grows then, twice its
logarithm, is the ratio of both hypotheses, each with its own noise.

The noise is what makes a log likeliest: white motion of the base, and biases that wander by more than the specification says. The
variance by which the filter covers a slow wander of the base is no such noise. It is cautious, and far from the likeliest: what
makes it a little smaller seems likelier by hundreds. A sensor with the flat Allan deviation of its datasheet (1/f noise) wanders
within seconds by more than the Gauss-Markov process that stands for it; half of such still bases were said to drift away, with
ratios of 300 to 1500.

Source: S. M. Kay, *Fundamentals of Statistical Signal Processing*, vol. 2, 1998, sec. 6.4.2 (unknown parameters at their likeliest
under either hypothesis); that it is asked after coloured innovations, and the grid of walks, are ours.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import MAX_NOISE_PASSES, FineAlignment
from truenorth.alignment.matched import whitened
from truenorth.alignment.slow_sway import Cause, causes
from truenorth.alignment.swaying import SwayAlignment
from truenorth.alignment.usual import wandering_as_usual
from truenorth.errors.staying import BA, BG, PHI, QUIETEST_BASE, StaticModel
from truenorth.estimate.base_motion import VelocityNoise
from truenorth.filters import LinearSystem, kalman
from truenorth.filters.gains import filter_gains, through
from truenorth.quality.colour import colour_of
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

FEWEST = 20  # intervals
# Walks of the biases, gyros and accelerometers, in those of the specification, or of usual sensors where they are larger.
WALKS = tuple(product((0.0, 4.0, 16.0), (0.0, 2.0, 4.0, 8.0, 16.0, 64.0)))


def masked_evidence(fine: FineAlignment, spec: ImuSpec) -> list[Evidence]:
    """A drift, or a change of a bias, that the noise of the base hides, with the error that it leaves."""
    count = len(fine.estimates.innovation)
    if fine.form != "velocity" or isinstance(fine, SwayAlignment) or count < FEWEST or not _follow_each_other(fine):
        return []
    begun = list(causes(fine))
    without = [
        fine.system.with_arrays(z=fine.system.z - seen) for seen in (np.zeros((count, 3)), *(c.seen for c in begun))
    ]
    # A noise that one of them finds is open to all: none is likelier because its search ended better.
    noises = [_likeliest(fine, spec, system) for system in without]
    (nothing, end, _), *others = (
        min((_filtered(system, *noise) for noise in noises), key=lambda e: e[0]) for system in without
    )
    found = [
        (_weighed(nothing - cost, filtered, cause), cause, np.abs(phi - end))
        for (cost, phi, filtered), cause in zip(others, begun)
    ]
    ratio, best, _ = max(found, key=lambda item: item[0])
    if ratio <= limit("hint"):
        return []
    # Which of them it was the log does not say: what any does that chance does not explain.
    moved = np.max([size for own, _, size in found if own > limit("hint")], axis=0)
    effect = Effect(heading=float(moved[2]), level=float(np.hypot(moved[0], moved[1])))
    figures: dict[str, Figure] = {
        "axis": best.axis,
        "onset": best.onset,
        "ratio": ratio,
        "chance": limit("hint"),
        "heading": effect.heading,
        "level": effect.level,
        ("velocity" if best.key.startswith("drift") else "size"): abs(best.size),
    }
    kind: Kind = "hint" if may_be_chance(ratio) else "bounded"
    return [Evidence(best.key, figures, kind, effect, ("still_part",))]


def _follow_each_other(fine: FineAlignment) -> bool:
    """Whether innovations of the level axes are correlated with the next."""
    e = fine.estimates.innovation[:, :2]
    power = (e**2).sum(axis=0)
    return bool(((e[1:] * e[:-1]).sum(axis=0) > limit("motion follows") * power).any())


def _likeliest(fine: FineAlignment, spec: ImuSpec, system: LinearSystem) -> tuple[Array, Array]:
    """The measurement and the process noise, as arrays of a system, with which its measurements are likeliest."""
    count, R = len(system.z), fine.disturbance**2
    quiet = system.R.copy()
    quiet.reshape(len(quiet), -1)[:, ::4] -= R - QUIETEST_BASE**2  # its diagonal
    noise = VelocityNoise(np.tile(R, (count, 1)), [np.ones(count, dtype=np.bool_)], MAX_NOISE_PASSES, coloured=False)
    own = StaticModel.of(spec)
    usual = wandering_as_usual(own)
    gyro, accel = max(own.gyro_rate_walk, usual.gyro_rate_walk), max(own.accel_rate_walk, usual.accel_rate_walk)
    tried = []
    for gyros, accels in WALKS:
        Q = system.Q.copy()
        for part, walk in ((BG, gyros * gyro), (BA, accels * accel)):
            diagonal = range(part.start, part.stop)
            Q[:, diagonal, diagonal] += walk**2 * fine.integrals.intervals[0]
        found = noise(system.with_made(R=quiet).with_arrays(Q=Q))
        tried.append((-2.0 * float(found.estimates.log_likelihood), found.system.R, Q))
    return min(tried, key=lambda item: item[0])[1:]


def _filtered(system: LinearSystem, R: Array, Q: Array) -> tuple[float, Array, LinearSystem]:
    """With such noise: minus twice the logarithm of the likelihood, and the misalignment (3,) at the end; and that system."""
    noisy = system.with_made(R=R).with_arrays(Q=Q)
    estimates = kalman(noisy, history="last")
    return -2.0 * float(estimates.log_likelihood), np.asarray(estimates.x[-1][PHI]), noisy


def _weighed(ratio: float, without: LinearSystem, cause: Cause) -> float:
    """A ratio by the colour of what is left of the innovations, of a system without its cause."""
    if ratio <= limit("hint"):
        return ratio
    estimates = kalman(without, history="full")
    L: Array = np.asarray(np.linalg.cholesky(estimates.innovation_covariance), dtype=np.float64)
    signature = through(filter_gains(without, estimates), cause.seen[..., None])[0]
    white = whitened(L, np.concatenate([estimates.innovation[..., None], signature], axis=2))
    return colour_of(white[:, :, 0], white[:, :, 1]).ratio(ratio)
