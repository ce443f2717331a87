"""Is the place in the other hemisphere? What gravity then does in the inertial frame, matched with the innovations.

At latitude -L gravity goes round the earth's axis on the cone opposite to that at L: with the same level rate, and bent the other
way, by ``g (w t)^2 sin L cos L`` along north. Where the base sways, no mean rate about the vertical shows that; gravity does.

A noise that is inferred from the log is not known. It may be five times too small by chance (one of 56 sound logs), and what bends
by chance then seems to bend by more: a ratio of 19, which was 11. So each hemisphere is asked with the noise of the gyros with
which the log is likeliest there, and what is usual of it counts as in the inference.

Where a base sways, the fit of its motion may take up a part of that bend as a slow oscillator: of one indexer the ratio was 10,
with a size of .7. So a log that is likelier in the other hemisphere, but no more than chance would have it, is aligned anew in
both, the motion fitted in each. That shows more than the bend: a base moves along east and north, which turn in the inertial frame
the other way round (the likelihoods of that indexer differ by 45). But each fit may end some tens short of the likeliest motion:
two sound logs of tactical IMUs on a buoy and a raft, which show nothing of the bend (a third of a sigma), were likelier elsewhere
by 85 and 74. So the bend must be visible, if all of it were there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import Match, Signatures
from truenorth.alignment.noise import PRIOR_WIDTH
from truenorth.core.position import Position
from truenorth.errors.staying import gravity_position, gravity_velocity
from truenorth.filters import kalman
from truenorth.state.evidence import Evidence, contradiction, note
from truenorth.state.limits import limit

Array = NDArray[np.float64]

SEEN = 9.0  # of the bend, in its sigmas, squared: what shows less of it has nothing for a fit to take up
WALKS = np.log(2.0) * np.arange(6)  # logarithms of gyros' random walks in the inferred one


def hemisphere_signature(fine: FineAlignment, position: Position) -> Signatures:
    """What gravity of the other hemisphere would do from the first epoch on."""
    by_velocity = fine.form == "velocity"
    return _signature_over(fine.integrals.time.tobytes(), position.lat, position.alt, fine.system.states, by_velocity)


@lru_cache(maxsize=4)
def _signature_over(times: bytes, lat: float, alt: float, n: int, by_velocity: bool) -> Signatures:
    """The same for so many states over intervals between times (of doubles). Nobody writes to it."""
    time = np.frombuffer(times)
    if by_velocity:
        off = np.diff(gravity_position(time, lat, alt) - gravity_position(time, -lat, alt), axis=0)
        off /= np.diff(time)[:, None]
    else:
        off = np.diff(gravity_velocity(time, lat, alt) - gravity_velocity(time, -lat, alt), axis=0)
    none, one = np.zeros((n, 1)), np.ones((1, 1))
    return Signatures(np.zeros(1, dtype=np.int64), none, off[:1].T, one, none, off[..., None])


def hemisphere_evidence(
    match: Match,
    fine: FineAlignment,
    position: Position,
    elsewhere: Callable[[Position], float] | None = None,
    *,
    given: bool = True,
) -> list[Evidence]:
    """Whether the log fits the other hemisphere better: twice the logarithm of the likelihood ratio of the two.

    Parameters
    ----------
    match : Match
        Of :func:`hemisphere_signature`, by :func:`truenorth.alignment.matched.matched_whole`.
    fine : FineAlignment
    position : Position
    elsewhere : callable, optional
        Minus twice the logarithm of the likelihood of the log aligned anew in a place, where a fitted motion may hide the bend.
    given : bool
        Whether somebody has given the specification; else its noise is open.
    """
    ratio, size = float(match.ratio[0]), float(match.size[0])
    if size <= 0.0:
        return []
    # Of a signature of size one: 2 match - energy.
    better, sure = ratio / size * (2.0 - 1.0 / size), limit("hemisphere")
    if better > sure and not given:
        off = hemisphere_signature(fine, position).measured_course[..., 0]
        better = min(better, _of_any_noise(fine, fine.system.z) - _of_any_noise(fine, fine.system.z - off))
    elif 0.0 < better <= sure and ratio > SEEN * size**2 and given and elsewhere is not None:
        better = elsewhere(position) - elsewhere(replace(position, lat=-position.lat))
        sure = limit("hemisphere refitted")
    if better > sure:
        return [contradiction("place.hemisphere", "latitude", ratio=better)]
    doubtful = better > limit("hemisphere")
    return [note("place.hemisphere_in_doubt", "latitude", urgent=True, ratio=better)] if doubtful else []


def _of_any_noise(fine: FineAlignment, z: Array) -> float:
    """Minus twice the logarithm of the posterior density of the likeliest random walk of the gyros, and of measurements with it."""
    costs = []
    for x in WALKS:  # states begin with phi
        Q = fine.system.Q.copy()
        Q[:, range(3), range(3)] *= np.exp(2.0 * x)
        estimates = kalman(fine.system.with_arrays(z=z, Q=Q))
        costs.append(-2.0 * float(estimates.log_likelihood) + float((x / PRIOR_WIDTH) ** 2))
    return min(costs)
