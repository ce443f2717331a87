"""What a pass over the log teaches of its sensors before the next one: how noisy they are, and how late a receiver is.

For noise see :mod:`truenorth.quality.aid_noise`, for stamps :mod:`truenorth.quality.stamps`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from truenorth.estimate.latency import delay_notes
from truenorth.quality.aid_noise import LEAST_FACTOR, noise_notes
from truenorth.quality.stamps import stamp_notes
from truenorth.quality.swing import VELOCITIES
from truenorth.state.evidence import Evidence, note

Array = NDArray[np.float64]


def differs(before: float, after: float) -> bool:
    """Whether a scatter of stamps has changed by what matters."""
    both = min(before, after), max(before, after)
    return both[1] > 0.0 and (both[0] == 0.0 or math.log(both[1] / both[0]) > math.log(LEAST_FACTOR))


def learnt_evidence(
    factors: Mapping[str, Array], delays: Mapping[str, tuple[float, float]], scatter: float, swings: float
) -> list[Evidence]:
    """What was learnt, for the reader: it is in sigma already.

    Parameters
    ----------
    factors : mapping of source to (3,) array
        Of its noise.
    delays : mapping of sensor to (delay, sigma), s
    scatter : float, s
        One sigma of the receiver's stamps.
    swings : float, m/s
        RMS of the antenna's swing that the receiver does not show.
    """
    found = noise_notes(factors) + stamp_notes(scatter)
    if swings > 0.0:
        found.append(note("noise.swing", name=VELOCITIES, size=swings))
    return found + delay_notes(delays)
