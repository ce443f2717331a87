"""How fast a speed log's drift changes, where nobody has said so: what the data make most likely.

Of white innovations ``nu`` with covariance ``S`` the likelihood is ``-1/2 sum(nu' S^-1 nu + ln |S|)``. The augmented filter is run
for each correlation time in question. Under a drift that is taken for too slow the innovations are correlated and too large;
under one too fast S is larger than they are.

The walk of the drift, ``sigma^2/tau``, shows within hours, its size ``sigma`` only over several ``tau``: the time is searched
with the size as it is given, then both along the same walk, where a size twice the given one costs half a unit of
log-likelihood. A drift that is taken for a constant while it wanders is believed far beyond its sigma, one that is taken for
too fast costs a little of it: of walks within one sigma of the most likely one the fastest is taken.

Source: F. Schweppe, "Evaluation of likelihood functions for Gaussian signals", IEEE Trans. Inf. Theory 11 (1965).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.filters import Filter, run_filters
from truenorth.damping.loop import LONGEST_STEP
from truenorth.errors.log import DRIFT, LogErrors
from truenorth.state.track import Track

Array = NDArray[np.float64]

HOUR = 3600.0
TIMES = (math.inf, *(HOUR * x for x in (768.0, 384.0, 192.0, 96.0, 48.0, 24.0, 12.0, 6.0, 3.0, 1.5, 0.75, 0.375)))  # s
SIZES = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8)  # times the given one
DOUBT = math.log(2.0)  # one sigma of the logarithm of the size
# Of log-likelihood, by which a faster walk may be less likely than a slower one and is taken all the same
AS_LIKELY = 0.5


def likely_drift(course: Track, reference: Array, start: int, kind: Filter, given: LogErrors) -> LogErrors:
    """The log's errors with the most likely size and correlation time of its drift; an infinite time: a constant.

    Parameters
    ----------
    reference : (K+1, 2) array, m/s
        NaN where absent.
    start : int
        Epoch of the switch.
    kind : Filter
        The augmented filter; size and time of its drift are set in turn.
    given : LogErrors
    """
    stride = max(1, int(LONGEST_STEP / course.interval + 1e-9))
    coarse, seen = course[start::stride], reference[start::stride]

    def best(pairs: list[tuple[float, float]], slack: float = 0.0) -> tuple[float, float]:
        kinds = {str(pair): _with(kind, *pair) for pair in pairs}
        found = run_filters(coarse, seen, start=0, kinds=kinds)

        def weighed(pair: tuple[float, float]) -> float:
            doubt = math.log(pair[0] / given.drift) / DOUBT
            return found[str(pair)].likelihood - 0.5 * doubt**2

        most = max(map(weighed, pairs))
        return max(
            (pair for pair in pairs if weighed(pair) >= most - slack), key=lambda p: (p[0] ** 2 / p[1], weighed(p))
        )

    size, time = best([(given.drift, time) for time in TIMES], AS_LIKELY)
    if math.isfinite(time):
        size, time = best([(size * f, time * f**2) for f in SIZES])
    return replace(given, drift=size, drift_time=time)


def _with(kind: Filter, size: float, time: float) -> Filter:
    """The filter with this drift."""
    groups = tuple(
        replace(group, sigma=np.full_like(group.sigma, size), correlation_time=time) if group.name == DRIFT else group
        for group in kind.model.groups
    )
    model, P0 = replace(kind.model, groups=groups), kind.P0.copy()
    own = model.slice_of(DRIFT)
    assert own is not None  # it has a drift
    P0[own, own] = size**2 * np.eye(2)
    return replace(kind, model=model, P0=P0)
