"""How fast a speed log's drift changes, where nobody has said so: what the data make most likely.

Of white innovations ``nu`` with covariance ``S`` the likelihood is ``-1/2 sum(nu' S^-1 nu + ln |S|)``. The augmented filter is run
for each correlation time in question. Under a drift that is taken for too slow the innovations are correlated and too large;
under one too fast S is larger than they are.

The walk of the drift, ``sigma^2/tau``, shows within hours, its size ``sigma`` only over several ``tau``: the time is searched
with the size as it is given, then both along the same walk, where a size twice the given one costs half a unit of
log-likelihood. A drift that is taken for a constant while it wanders is believed far beyond its sigma, one that is taken for
too fast costs a little of it: of walks within one sigma of the most likely one the fastest is taken. So with the size: a tide is
no Gauss-Markov process, and its turns within hours say little of how large it is; of sizes within two sigmas the largest is taken.

A current that the sea has changes smoothly over minutes, and over hours it wanders. From row to row it is a constant, which the
errors of the INS follow, whatever it is over hours. And what wanders in an hour may be the deflection of the vertical. So the same
is asked of rows that are `SMOOTH` apart, on a sea without deflections: the faster of both walks is taken by a filter that
estimates the drift. A method that does not is off by what the drift sums up to, and of both the slower one sums up to more: with a
log that was off by .3 m/s all the time, taken for a current of an hour, position was seven sigmas off. Its bands hold both, and so
does the sigma of the filter that does.

Source: F. Schweppe, "Evaluation of likelihood functions for Gaussian signals", IEEE Trans. Inf. Theory 11 (1965).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.filters import Filter, run_filters
from truenorth.damping.loop import LONGEST_STEP
from truenorth.errors.deflection import NAME as DEFLECTION
from truenorth.errors.log import DRIFT, LogErrors
from truenorth.errors.marine import MOTION
from truenorth.state.track import Track

Array = NDArray[np.float64]
Pair = tuple[float, float]  # size, m/s, and correlation time, s

HOUR = 3600.0
SMOOTH = 600.0  # s, in which a current may be smooth
NO_DEFLECTION = 1e-9  # rad
TIMES = (math.inf, *(HOUR * x for x in (768.0, 384.0, 192.0, 96.0, 48.0, 24.0, 12.0, 6.0, 3.0, 1.5, 0.75, 0.375)))  # s
SIZES = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8)  # times the given one
DOUBT = math.log(2.0)  # one sigma of the logarithm of the size
# Of log-likelihood, by which a faster walk may be less likely than a slower one and is taken all the same:
AS_LIKELY = 0.5  # one sigma
AS_LIKELY_APART = 2.0  # two: few rows say little, and all of them little of the size
DISTINCT = 8.0  # four sigmas, between the slowest walk and the fastest: rows that say less do not count


def likely_drifts(
    course: Track, reference: Array, start: int, kind: Filter, given: LogErrors, means: Track | None = None
) -> tuple[LogErrors, ...]:
    """The log's errors with the most likely size and correlation time of its drift; an infinite time: a constant.

    Two where the readings of it disagree (see above), the faster walk first.

    Parameters
    ----------
    reference : (K+1, 2) array, m/s
        NaN where absent.
    start : int
        Epoch of the switch.
    kind : Filter
        The augmented filter; size and time of its drift are set in turn.
    given : LogErrors
    means : Track, optional
        By which the log shows its errors, as for :func:`run_filters`.
    """
    stride = _stride(course, reference[start:])
    coarse, seen = course[start::stride], reference[start::stride]
    shown = None if means is None else means[start::stride]
    sparse = np.full_like(seen, np.nan)
    every = max(1, round(SMOOTH / coarse.interval))
    sparse[::every] = seen[::every]

    # About what one of them finds: all are compared on the same dynamics, which are worked out once.
    first = run_filters(coarse, seen, start=0, kinds={"first": kind}, seen=shown)["first"]

    def as_likely(rows: Array, base: Filter, pairs: list[Pair], slack: float) -> tuple[list[Pair], float]:
        """Those that are as likely as the likeliest but for `slack`, and how much less likely the least likely one is."""
        kinds = {str(pair): _with(base, *pair) for pair in pairs}
        found = run_filters(coarse, rows, start=0, kinds=kinds, seen=shown, about=first.x[:, MOTION])

        def weighed(pair: Pair) -> float:
            doubt = math.log(pair[0] / given.drift) / DOUBT
            return found[str(pair)].likelihood - 0.5 * doubt**2

        most = max(map(weighed, pairs))
        return [pair for pair in pairs if weighed(pair) >= most - slack], most - min(map(weighed, pairs))

    def sized(rows: Array, base: Filter, pair: Pair) -> Pair:
        size, time = pair
        if math.isinf(time):
            return pair
        return max(as_likely(rows, base, [(size * f, time * f**2) for f in SIZES], AS_LIKELY_APART)[0])

    times = [(given.drift, time) for time in TIMES]
    walk = sized(seen, kind, max(as_likely(seen, kind, times, AS_LIKELY)[0], key=_walk))
    still = _with_sigma(kind, DEFLECTION, NO_DEFLECTION)
    likely, spread = as_likely(sparse, still, times, AS_LIKELY_APART)
    walks = [walk]
    if spread >= DISTINCT and _walk(apart := max(likely, key=_walk)) > _walk(walk):
        walks = [sized(sparse, still, apart), walk]
    return tuple(replace(given, drift=size, drift_time=time) for size, time in walks)


def _stride(course: Track, reference: Array) -> int:
    """Epochs from one that is taken to the next: as far apart as the filter allows, with each row of a log that has few."""
    most = max(1, int(LONGEST_STEP / course.interval + 1e-9))
    rows = np.flatnonzero(np.isfinite(reference).all(axis=1))
    apart = math.gcd(*(int(k) for k in rows)) if len(rows) else 0
    return max(k for k in range(1, most + 1) if apart % k == 0) if apart > 1 else most


def _walk(pair: Pair) -> float:
    """Of a drift's size and correlation time: half the rate at which its variance grows."""
    return pair[0] ** 2 / pair[1]


def _with(kind: Filter, size: float, time: float) -> Filter:
    """The filter with this drift."""
    return _with_sigma(kind, DRIFT, size, time)


def _with_sigma(kind: Filter, name: str, size: float, time: float | None = None) -> Filter:
    """The filter with one group of this size, and correlation time where that is given; as it is where there is no such group."""
    own = kind.model.slice_of(name)
    if own is None:
        return kind
    groups = tuple(
        replace(group, sigma=np.full_like(group.sigma, size), correlation_time=time or group.correlation_time)
        if group.name == name
        else group
        for group in kind.model.groups
    )
    P0 = kind.P0.copy()
    P0[own, :] = P0[:, own] = 0.0
    P0[own, own] = size**2 * np.eye(own.stop - own.start)
    return replace(kind, model=replace(kind.model, groups=groups), P0=P0)
