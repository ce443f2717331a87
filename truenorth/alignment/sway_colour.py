"""The colour of a sway that a short log cannot model: harmonics of the base's velocity that any such log may have.

The filter of a short log takes the base's velocity for white. That of a sway is not: it goes with the periods of the base, and a
handful of them match a departure at some time within the log better than chance lets white noise do. Of 80 sound logs of 20 to
60 s, 14 seemed to leave.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment

Array = NDArray[np.float64]

LONGEST_PERIOD = 20.0  # s, of a base that sways; what is slower is one that leaves


def sway_harmonics(fine: FineAlignment) -> Array:
    """Mean velocities (K, 3, M) of the intervals, m/s: harmonics of the log within the band of a sway, as large as it along each axis.

    Parameters
    ----------
    fine : FineAlignment
        In the velocity form.
    """
    t, T = fine.integrals.time, float(fine.integrals.time[-1])
    fastest = 0.5 / float(np.median(fine.integrals.intervals))
    numbers = np.arange(max(1, int(np.ceil(T / LONGEST_PERIOD))), int(fastest * T) + 1)
    w = 2.0 * np.pi / T * numbers
    # Means over the intervals, of amplitude one.
    of_sine, of_cosine = -np.cos(np.outer(t, w)) / w, np.sin(np.outer(t, w)) / w
    courses = np.diff(np.concatenate([of_sine, of_cosine], axis=1), axis=0) / fine.integrals.intervals[:, None]
    found = np.zeros((len(courses), 3, 3 * courses.shape[1]))
    for axis, size in enumerate(fine.disturbance):
        found[:, axis, axis * courses.shape[1] : (axis + 1) * courses.shape[1]] = size * courses
    return found
