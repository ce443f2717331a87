"""The latitude of a vehicle under way, from its own log: how gravity turns with the earth depends on it.

A wrong latitude gives the earth's rate other components in the local frame, 4 arcmin an hour for each arcmin of latitude;
gyros that see the earth turn tell it apart within minutes. The likelihood of the measurements, each latitude with its own
coarse alignment and filter, has its largest value near the true one, and lesser ones near its mirror in the other hemisphere.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from truenorth.core.position import METRES_PER_RADIAN, Position

GRID = np.radians(np.arange(-80.0, 81.0, 10.0))
CLOSE = math.radians(5e-4)  # two metres in five kilometres: far below what gyros tell
PRIOR = math.radians(1.0)  # about what was found, wide compared with what the filter then says: the log is used once
NARROWED = 0.5  # of that prior: a filter that does not narrow it has not separated one hemisphere from the other


def find_latitude(cost: Callable[[float], float]) -> Position:
    """The most likely latitude.

    Parameters
    ----------
    cost : callable
        Minus twice the log-likelihood of the log for a latitude in rad.

    Returns
    -------
    Position
        With a prior about it for the filter to narrow; longitude and height zero.
    """
    from scipy.optimize import minimize_scalar

    best = float(GRID[int(np.argmin([cost(float(lat)) for lat in GRID]))])
    step = float(GRID[1] - GRID[0])
    found = minimize_scalar(cost, bounds=(best - step, best + step), method="bounded", options={"xatol": CLOSE})
    return Position(float(found.x), horizontal_sigma=PRIOR * METRES_PER_RADIAN)
