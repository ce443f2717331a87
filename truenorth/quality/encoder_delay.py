"""By how much an indexer's encoder is late, where its axes start, stop or turn back.

An encoder that is late by ``d`` shows angles that are off by ``-d`` times the rate, and the base, as computed, turns by ``u d
rate`` about the axis: a step at each start and stop, which no sway has. It is fitted with all that
:mod:`truenorth.quality.encoder_errors` fits. Play of the encoder's drive is off to the side that the axis comes from: at one rate,
both ways, it is a delay to the log, and is off by as much. An axis that turns at one rate throughout shows no delay.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from truenorth.quality.encoder_errors import CELL, fitted, looks, steady
from truenorth.quality.encoder_patterns import Turns
from truenorth.quality.encoder_slips import Slip

GRID = 0.2  # s from sample to sample: starts and stops take tenths of a second
ORDERS = (40, 20)  # of the autoregressions
UNSURE = 3.0  # times the sigma of the fit: what it is off by (2.2 in RMS, at most 3.6, of 14 made logs)


class Delay(NamedTuple):
    """What an encoder is late by, s; its one-sigma; and by how many sigmas of the fit it is there."""

    size: float = 0.0
    sigma: float = 0.0
    beyond: float = 0.0


def delay_of(turns: Turns, slip: Slip | None = None) -> Delay | None:
    """The delay of an encoder; None where it does not show.

    Parameters
    ----------
    turns : Turns
    slip : Slip, optional
        That was found.
    """
    if steady(turns.thinned(CELL)):
        return None
    thin = turns.thinned(GRID)
    if not looks(thin):
        return None
    fits = [fitted(thin, order, None if slip is None else slip.turns(thin)) for order in ORDERS]
    if "late" not in fits[0].groups:
        return None
    found = [(float(x[0]), math.sqrt(float(P[0, 0]))) for x, P in (fit.group("late") for fit in fits)]
    size, sigma = max(found, key=lambda item: item[1])
    return Delay(size, UNSURE * sigma, min(abs(x) / s for x, s in found))
