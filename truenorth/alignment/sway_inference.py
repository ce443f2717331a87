"""The random walks of an IMU on a base that sways, where nobody gives them: apart from what began within the log.

Noise that is inferred from a log explains what wanders in it: also a bias that changes, or a base that leaves. Each is asked
whether it explains the log better, by the likelihood of the whole log with the base's motion fitted anew.
"""

from __future__ import annotations

from collections.abc import Callable

from truenorth.alignment.fine import CoarseStart
from truenorth.alignment.sway_noise import is_louder, louder_walks
from truenorth.alignment.swaying import SwayAlignment, begun, sway_align
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
        Of sensors that are quiet.
    """
    fine = sway_align(start_of(noise))
    if fine.noisier:  # what the inference took for the usual noise of sensors is not theirs
        noise = louder_walks(noise, fine.noisier)
        fine = sway_align(start_of(noise))
    if not is_louder(noise, usual):
        return fine, noise
    quiet = sway_align(start_of(usual))
    gained = 2.0 * float(quiet.estimates.log_likelihood - fine.estimates.log_likelihood) + begun(quiet)
    return (quiet, usual) if gained > limit("drift") else (fine, noise)
