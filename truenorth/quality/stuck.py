"""A channel that stands still while the others go on, in a log whose values have many digits.

A coarse sensor repeats its counts as long as its noise is less than one; how long is read from the steadiest tenth of a log. A
channel that was stuck for more than that tenth would pass for such a sensor. But the values of a coarse sensor lie on its counts,
and what is measured with many digits is never the same twice, unless nothing moves at all: then a simulation without noise repeats
in all channels.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST_LEVELS = 200  # values that show whether they lie on counts
# Spacings of sorted values: of a hundred the smallest is .015 of the median where they lie anywhere (exponential), and at least one
# count where they lie on counts. What is closer than rounding is one value.
CLOSE, ROUNDING = 0.03, 1e-9
OTHERS_GO_ON = 0.5  # part of the rows of a run in which another channel must change


def stands_alone(data: Sequence[Array], same: NDArray[np.bool_], channel: int, first: int, rows: int) -> bool:
    """Whether a run of one value is neither a coarse sensor's nor a simulation's at rest.

    Parameters
    ----------
    data : six (N,) arrays
        Of gyros and accelerometers.
    same : (6, N-1) array
        Of each row after the first: whether it repeats the one before.
    channel, first, rows : int
        The run.
    """
    if same[:, first : first + rows - 1].mean(axis=1).min() > OTHERS_GO_ON:
        return False
    rest = np.delete(data[channel], slice(first, first + rows))
    if len(rest) < FEWEST_LEVELS:
        return False
    spacings = np.diff(np.unique(rest))
    spacings = spacings[spacings > ROUNDING * np.ptp(rest)]
    if len(spacings) < FEWEST_LEVELS:
        return False
    return float(np.quantile(spacings, 0.01)) < CLOSE * float(np.median(spacings))
