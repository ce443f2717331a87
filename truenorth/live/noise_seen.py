"""What the rows of a run show of noise that its specification leaves out: rounding, and scattered time stamps.

:func:`truenorth.navigate` reads both from the whole log before its loop begins. A live loop cannot; it looks at the rows of the
last minutes from time to time, and adds to the covariance what they have made of attitude and velocity since it looked last.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.live.log import Kind, record_of
from truenorth.live.recent import Recent
from truenorth.quality.rounding import FEWEST, rounding_walks
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]

SPELL = 20.0  # s between two looks: an alignment's sigma hardly grows in that
LENGTH = 300.0  # s of rows that a look goes over: a sensor that stays between two steps shows it


class NoiseSeen:
    """Looks at rows as the loop takes them; the same whatever the chunks.

    Parameters
    ----------
    spec : ImuSpec
        Sensors that it says to be counters lose nothing by rounding.
    kind : {"rates", "increments"}
        Of the rows.
    """

    def __init__(self, spec: ImuSpec, kind: Kind) -> None:
        self._counts = spec.gyro_quantisation > 0.0, spec.accel_quantisation > 0.0
        self._kind: Kind = kind
        self._recent = Recent()
        self._begun = np.inf  # s: the row of the last look

    def growth(self, rows: Array) -> Aiding:
        """Take rows in, and say what noise has added up to since the last look, at the rows that end a spell.

        What the rounding of one mean leaves is the same in all its rows: the growth is that of the whole, not that of a spell.

        Parameters
        ----------
        rows : (K, 7) array
            ``time, gyro (3), accel (3)``, ascending.
        """
        found, first = [], 0
        self._begun = min(self._begun, float(rows[0, 0]))
        while (last := int(np.searchsorted(rows[:, 0], self._begun + SPELL))) < len(rows):
            self._recent.add(rows[first : last + 1])
            now, first = float(rows[last, 0]), last + 1
            grown = np.maximum(self._variances(now, now) - self._variances(now, self._begun), 0.0)
            if grown.any():
                found.append((now, *np.sqrt(grown)))
            self._begun = now
            self._recent.forget(now - LENGTH)
        if first < len(rows):
            self._recent.add(rows[first:])
        time, push, turn = np.array(found).reshape(-1, 3).T
        return Aiding.disturbance("noise", time, push[:, None], turn[:, None])

    def _variances(self, newest: float, until: float) -> Array:
        """(2,) of velocity and attitude, of rows up to a time, the first `LENGTH` before the newest."""
        rows = np.vstack(list(self._recent))
        begun = max(float(rows[0, 0]), newest - LENGTH)
        rows = rows[(rows[:, 0] > begun) & (rows[:, 0] <= until)]
        if len(rows) < FEWEST:
            return np.zeros(2)
        record = record_of(rows, self._kind)
        rounding, stamps = rounding_walks(record), record.stamp_walks
        walks = [math.hypot(0.0 if c else r, s) for c, r, s in zip(self._counts, rounding, stamps, strict=True)]
        return (until - begun) * np.square(walks[::-1])
