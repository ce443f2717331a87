"""Are a receiver's velocities of the moment of its places? What they are later by is a delay of their own.

A receiver has its velocities from how the phases of carriers change from one epoch to the next, a mean over the interval: they are
half an interval older than the places of the same stamp, .5 s at 1 Hz, or not at all where it takes the Doppler shift of the
epoch. Of the cart of `stim300_cart_chicago` places alone are .84 s late and velocities alone 1.43 s, each to .02 s. One delay for
both lies between the two, is known twice as well as either, and is neither.

So two delays are asked for once the passes have settled. A likelihood ratio says whether there are two: the second has its own
prior, so a sound log exceeds c in less than exp(-c / 2) of cases (Markov's inequality). Where one delay has the gate reject rows
that two do not, the rows that both take say nothing of it, and rejected ones count as much as the gate allows. Then each delay has
its own state in all passes. That holds of an alignment on the move and of a navigation alike.

Source: NovAtel, "OEM6 Family Firmware Reference Manual" (OM-20000129), BESTVEL: latency of the velocity's time tag.
"""

from __future__ import annotations

from dataclasses import replace

from truenorth.aiding.aids import LATENCY_SIGMA
from truenorth.estimate.rivals import likelihood_ratio
from truenorth.estimate.slow_fit import bounded_misfit
from truenorth.records import GnssRecord
from truenorth.state.limits import limit
from truenorth.state.mounting import Clock, Mounting
from truenorth.state.track import Track


def velocities_apart(mounting: Mounting, record: GnssRecord | None) -> Mounting:
    """The mounting of a receiver whose velocities have a delay of their own.

    The prior of that delay is no narrower than that of a receiver of which nothing is said: what is known of the other one, as by
    an alignment before, is of places, if there are two.

    Parameters
    ----------
    mounting : Mounting
    record : GnssRecord or None

    Returns
    -------
    Mounting
        The same object where they have one already, where the latency is given, or where there are no places, or no velocities.
    """
    both = record is not None and bool(record.has_position.any()) and bool(record.has_velocity.any())
    if not both or mounting.latency_sigma == 0.0 or mounting.velocities is not None:
        return mounting
    return replace(mounting, velocities=Clock(mounting.latency, max(mounting.latency_sigma, LATENCY_SIGMA)))


def explained_by_two(two: Track, one: Track, *, delays: bool = False) -> bool:
    """Whether a track with two delays, or with a swing that is shown otherwise, explains the log better than one with one.

    With `delays` it is a second delay. Places of another moment are off along the way, as slowly as the vehicle turns: the colour
    that a second delay takes out of innovations is no reason to believe them less.
    """
    if likelihood_ratio(one.residuals, two.residuals, whitened=delays) > limit("rival"):
        return True
    fewer = sum(r.rejected for r in two.residuals) < sum(r.rejected for r in one.residuals)
    return fewer and bounded_misfit(one.residuals) - bounded_misfit(two.residuals) > limit("rival")
