"""Rows that come one by one, as an IMU without the known errors of its specification would have made them.

The same corrections as of a whole log, :mod:`truenorth.records.specified`, from rows that have come: the sensor that is less late
is read between its last rows, and how fast the turn rate changes is the slope to the row before, which is half an interval old.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.live.log import Kind
from truenorth.records.interpolation import held_at_ends
from truenorth.records.specified import lag
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]

KEPT = 1.0  # s of rows before the newest, beyond what the lags of the sensors differ by: rows out of order find their neighbours
GYRO, ACCEL = slice(1, 4), slice(4, 7)


class Felt:
    """Takes the known errors off rows ``time, gyro (3), accel (3)``.

    Parameters
    ----------
    spec : ImuSpec, optional
        Lags of its sensors and places of its accelerometers; left out: nothing is known of them.
    kind : {"rates", "increments"}
        What a row is.
    """

    def __init__(self, spec: ImuSpec | None = None, kind: Kind = "rates") -> None:
        lags = (0.0, 0.0) if spec is None else (lag(spec, "gyro"), lag(spec, "accel"))
        self.late = max(lags)  # s, by which stamps become earlier
        self._earlier = [self.late - own for own in lags]  # s before a row's stamp that a sensor is read at
        self._places = None if spec is None or spec.accel_positions is None else np.array(spec.accel_positions)
        self._kind: Kind = kind
        self._recent: deque[Array] = deque()  # rows as they came

    @property
    def known(self) -> bool:
        """Whether there is anything to take off."""
        return self._places is not None or self.late > 0.0

    def corrected(self, rows: Array) -> Array:
        """(K, 7) of (K, 7) sound rows of ascending time, which go on from the rows before or are sorted in among them."""
        if not self.known:
            return rows
        out = rows.copy()
        if self._places is not None or any(self._earlier):
            near = self._with_neighbours(rows)
            for columns, earlier in zip((GYRO, ACCEL), self._earlier, strict=True):
                if earlier:
                    out[:, columns] = held_at_ends(near[:, 0], near[:, columns], rows[:, 0] - earlier)
            if self._places is not None:
                out[:, ACCEL] -= self._size_effect(near, rows[:, 0])
        out[:, 0] -= self.late
        return out

    def _with_neighbours(self, rows: Array) -> Array:
        """These rows and those of a while before, by their times."""
        self._recent.append(rows)
        newest = max(float(block[-1, 0]) for block in self._recent)
        oldest = newest - KEPT - max(self._earlier)
        while len(self._recent) > 1 and self._recent[1][-1, 0] < oldest:
            self._recent.popleft()
        near = np.vstack(list(self._recent))
        return near[np.argsort(near[:, 0], kind="stable")]

    def _size_effect(self, near: Array, time: Array) -> Array:
        """(K, 3) that the places of the accelerometers add at some of the rows."""
        assert self._places is not None
        at = np.searchsorted(near[:, 0], time)
        before = np.maximum(at - 1, 0)
        T = np.diff(near[:, 0], prepend=2.0 * near[0, 0] - near[min(1, len(near) - 1), 0])[:, None]
        rate = near[:, GYRO] / T if self._kind == "increments" else near[:, GYRO]
        earlier = self._earlier[0]
        w, w_before = (held_at_ends(near[:, 0], rate, near[row, 0] - earlier) for row in (at, before))
        step = np.where(at > before, near[at, 0] - near[before, 0], math.inf)[:, None]
        turning = (w - w_before) / step
        felt = np.stack(
            [(np.cross(w, np.cross(w, r)) + np.cross(turning, r))[:, i] for i, r in enumerate(self._places)], axis=1
        )
        return np.asarray(felt * T[at] if self._kind == "increments" else felt)


def without_known(spec: ImuSpec) -> ImuSpec:
    """The specification of rows from which :class:`Felt` has taken the known errors."""
    return replace(
        spec,
        gyro_latency=0.0,
        gyro_bandwidth=math.inf,
        accel_latency=0.0,
        accel_bandwidth=math.inf,
        accel_positions=None,
    )
