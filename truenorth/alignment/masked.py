"""What begins within a log, hidden by the noise that it makes.

The filter reads the noise of the base's velocity from its innovations. What a change makes of them is in that noise as well,
and no signature stands out of it any more; but then the innovations follow each other, and are smaller than they should be. So
the best signatures are taken off the measurements, and the noise read anew: by how much the likelihood grows then, twice its
logarithm, is the ratio of both hypotheses, each with its own noise.

Source: S. M. Kay, *Fundamentals of Statistical Signal Processing*, vol. 2, 1998, sec. 6.4.2 (unknown parameters at their likeliest
under either hypothesis); that it is asked after coloured innovations is ours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import MAX_NOISE_PASSES, FineAlignment
from truenorth.alignment.slow_sway import causes
from truenorth.alignment.swaying import SwayAlignment
from truenorth.errors.staying import PHI, QUIETEST_BASE
from truenorth.estimate.base_motion import VelocityNoise
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

FOLLOWS = 0.5  # correlation of innovations with the next, from which the base's motion is no white noise
FEWEST = 20  # intervals


def masked_evidence(fine: FineAlignment) -> list[Evidence]:
    """A drift, or a change of a bias, that the noise of the base hides, with the error that it leaves."""
    count = len(fine.estimates.innovation)
    if fine.form != "velocity" or isinstance(fine, SwayAlignment) or count < FEWEST or not _follow_each_other(fine):
        return []
    nothing, end = _refitted(fine, np.zeros((count, 3)))
    found = []
    for cause in causes(fine):
        cost, phi = _refitted(fine, cause.seen)
        found.append((nothing - cost, cause, np.abs(phi - end)))
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
    power = np.sum(e**2, axis=0)
    return bool(np.any(np.sum(e[1:] * e[:-1], axis=0) > FOLLOWS * power))


def _refitted(fine: FineAlignment, seen: Array) -> tuple[float, Array]:
    """With so much (K, 3) off the measurements, the base's noise read anew: -2 log-likelihood, and phi (3,) at the end."""
    count, R = len(seen), fine.disturbance**2
    quiet = fine.system.R.copy()
    quiet.reshape(len(quiet), -1)[:, ::4] -= R - QUIETEST_BASE**2  # its diagonal
    system = fine.system.with_made(R=quiet).with_arrays(z=fine.system.z - seen)
    noise = VelocityNoise(np.tile(R, (count, 1)), [np.ones(count, dtype=np.bool_)], MAX_NOISE_PASSES)
    estimates = noise(system).estimates
    return -2.0 * float(estimates.log_likelihood), np.asarray(estimates.x[-1][PHI])
