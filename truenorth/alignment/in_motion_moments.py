"""Are a receiver's velocities of the moment of its places? What they are later by is a delay of their own.

A receiver has its velocities from how the phases of carriers change from one epoch to the next, a mean over the interval: they are
half an interval older than the places of the same stamp, .5 s at 1 Hz, or not at all where it takes the Doppler shift of the
epoch. Of the cart of `stim300_cart_chicago` places alone are .84 s late and velocities alone 1.43 s, each to .02 s. One delay for
both lies between the two, is known twice as well as either, and is neither.

So two delays are asked for once the passes have settled. A likelihood ratio says whether there are two: the second has its own
prior, so a sound log exceeds c in less than exp(-c / 2) of cases (Markov's inequality). Where one delay has the gate reject rows
that two do not, the rows that both take say nothing of it, and rejected ones count as much as the gate allows. Then each delay has
its own state in all passes.

Source: NovAtel, "OEM6 Family Firmware Reference Manual" (OM-20000129), BESTVEL: latency of the velocity's time tag.
"""

from __future__ import annotations

from truenorth.alignment.in_motion_passes import Pass, once_more
from truenorth.alignment.in_motion_start import Guess
from truenorth.alignment.in_motion_task import MovingTask
from truenorth.core.errors import DataError
from truenorth.estimate.rivals import likelihood_ratio
from truenorth.estimate.slow_fit import bounded_misfit
from truenorth.state.limits import limit
from truenorth.state.track import Track

MOST = 6  # passes, until both delays have settled


def two_moments(task: MovingTask, found: Pass, first: Guess) -> tuple[MovingTask, Pass]:
    """Task and last pass with a delay of the velocities alone, where the log speaks for it; else the same ones."""
    apart = task.with_velocities_apart()
    if apart is task:
        return task, found
    try:
        track = apart.run(found.guess, gated=True)
        if not _explains(track, found.track):
            return task, found
        other = found
        for _ in range(MOST):
            apart, much = apart.learnt(track)
            if not much and other.settled and other.task is not task:
                break
            other = once_more(apart, other, first)
            track = other.track
    except DataError:  # the filter broke down: they are of one moment
        return task, found
    return apart, other


def _explains(track: Track, one: Track) -> bool:
    """Whether two delays explain the log better than one."""
    if likelihood_ratio(one.residuals, track.residuals) > limit("rival"):
        return True
    fewer = sum(r.rejected for r in track.residuals) < sum(r.rejected for r in one.residuals)
    return fewer and bounded_misfit(one.residuals) - bounded_misfit(track.residuals) > limit("rival")
