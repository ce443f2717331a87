"""How fast a speed log's drift changes, where nobody has said so: what the data make most likely.

Of white innovations ``nu`` with covariance ``S`` the likelihood is ``-1/2 sum(nu' S^-1 nu + ln |S|)``. The augmented filter is run
for each correlation time in question. Under a drift that is taken for too slow the innovations hang together and are too large;
under one too fast S is larger than they are.

Source: F. Schweppe, "Evaluation of likelihood functions for Gaussian signals", IEEE Trans. Inf. Theory 11 (1965).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.course import Course
from truenorth.damping.filters import Filter, run_filters
from truenorth.damping.loop import LONGEST_STEP
from truenorth.errors.log import DRIFT

Array = NDArray[np.float64]

HOUR = 3600.0
TIMES = (math.inf, *(HOUR * x for x in (96.0, 48.0, 24.0, 12.0, 6.0, 3.0, 1.5, 0.75, 0.375)))  # s


def likely_time(course: Course, reference: Array, start: int, kind: Filter) -> float:
    """The most likely correlation time of a log's drift, s; infinite: a constant.

    Parameters
    ----------
    reference : (K+1, 2) array, m/s
        NaN where absent.
    start : int
        Epoch of the switch.
    kind : Filter
        The augmented filter; the time of its drift is set in turn.
    """
    stride = max(1, int(LONGEST_STEP / course.interval + 1e-9))
    coarse, seen = course.between(start, course.epochs).every(stride), reference[start::stride]
    kinds = {}
    for time in TIMES:
        groups = tuple(
            replace(group, correlation_time=time) if group.name == DRIFT else group for group in kind.model.groups
        )
        kinds[str(time)] = replace(kind, model=replace(kind.model, groups=groups))
    found = run_filters(coarse, seen, start=0, kinds=kinds)
    return max(TIMES, key=lambda time: found[str(time)].likelihood)
