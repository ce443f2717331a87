"""The random walks of an IMU on a base that sways, where nobody gives them: apart from what began within the log.

The fit of the noise to velocities (:func:`truenorth.alignment.check.fit_task_noise`) knows no motion of the base, which hides the
gyros' noise or passes for it: on a raft it was a third of what it was, and the changes of the accelerometers' biases that this
left had likelihood ratios of 40. What the rows show above the sway has no such motion in it, but a vibration. And biases wander as
datasheets of sensors with such noise promise, by tens of micro-g in minutes of a tactical IMU: a filter that holds them constant
takes that for steps, and on a gondola, whose own place stays to a millimetre, for a slow sway of 7 cm/s.

So each is tried, with the base's motion fitted anew, and the likeliest is taken. Noise that is inferred from a log explains what
wanders in it: also a bias that changes, or a base that leaves. So each is compared together with the best of all that may have
begun, and noise louder than that of the rows has to be likelier than they by more than chance gives.
"""

from __future__ import annotations

from collections.abc import Callable

from truenorth.alignment.fine import CoarseStart
from truenorth.alignment.sway_noise import is_louder, louder_walks
from truenorth.alignment.swaying import SwayAlignment, best_bias, sway_align
from truenorth.alignment.usual import wandering_as_usual
from truenorth.errors.staying import StaticModel
from truenorth.state.limits import limit


def sway_inferred(
    start_of: Callable[[StaticModel], CoarseStart], noise: StaticModel, usual: StaticModel
) -> tuple[SwayAlignment, StaticModel]:
    """A fine alignment on a swaying base, and the random walks that it is made with.

    Parameters
    ----------
    start_of : callable
        What to begin from, by the random walks.
    noise : StaticModel
        As fitted to the log.
    usual : StaticModel
        As its rows show, of sensors that are quiet.
    """
    fine = sway_align(start_of(noise))
    if fine.noisier:  # what the inference took for the usual noise of sensors is not theirs
        noise = louder_walks(noise, fine.noisier)
        fine = sway_align(start_of(noise))
    if is_louder(noise, usual):
        quiet = sway_align(start_of(usual))
        gained = 2.0 * float(quiet.estimates.log_likelihood - fine.estimates.log_likelihood) + best_bias(quiet)
        if gained <= limit("drift"):
            return fine, noise
        fine, noise = quiet, usual
    tried = [(fine, noise)]
    for other in dict.fromkeys(wandering_as_usual(item, promised=True) for item in (noise, usual)):
        tried.append((sway_align(start_of(other)), other))
    return max(tried, key=lambda pair: _explained(pair[0]))


def _explained(fine: SwayAlignment) -> float:
    """Twice the logarithm of the likelihood of a log, with the best of all that may have begun in it, where that is found.

    What is no more than a hint is no part of the answer, and must not make it the likeliest: people who stepped aboard a boat moved
    her as a bias that changes does (23 of 25), and with constant biases, that were so preferred to those of datasheets by 1, level
    was 4.8 sigmas off.
    """
    begun = best_bias(fine)
    return 2.0 * float(fine.estimates.log_likelihood) + (begun if begun > limit("drift") else 0.0)
