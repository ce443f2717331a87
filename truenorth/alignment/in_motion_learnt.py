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
from truenorth.state.evidence import Evidence, note

Array = NDArray[np.float64]


def differs(before: float, after: float) -> bool:
    """Whether a scatter of stamps has changed by what matters."""
    both = min(before, after), max(before, after)
    return both[1] > 0.0 and (both[0] == 0.0 or math.log(both[1] / both[0]) > math.log(LEAST_FACTOR))


def learnt_evidence(
    factors: Mapping[str, Array], delays: Mapping[str, tuple[float, float]], scatter: float = 0.0
) -> list[Evidence]:
    """What was learnt, for the reader: it is in sigma already."""
    found = noise_notes(factors)
    if scatter > 0.0:
        found.append(note("noise.stamps", name="GNSS", size=scatter))
    return found + delay_notes(delays)
