"""The epoch for which the attitude is asked: any time within the log, between two samples too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.errors import UsageError
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Epoch:
    """A time, the last row before it, and the turn from there on."""

    time: float  # s; on the record's clock
    elapsed: float  # s; since the beginning of the first row's interval
    row: int  # the last row at or before `time`
    turn: Array  # (3,) rad: rotation vector from that row to `time`

    def attitude(self, C_ib: Array) -> Array:
        """Attitude at the epoch, of the attitude after its row."""
        return C_ib @ dcm_from_rotation_vector(self.turn) if self.turn.any() else C_ib


def find_epoch(record: ImuRecord, at: float | None) -> Epoch:
    """Locate an epoch in a record; the last sample when `at` is None.

    Raises
    ------
    UsageError
        `at` lies outside the record.
    """
    start = float(record.time[0] - record.steps[0])
    last = len(record) - 1
    if at is None:
        return Epoch(float(record.time[-1]), float(record.time[-1]) - start, last, np.zeros(3))
    if not record.time[0] <= at <= record.time[-1]:
        raise UsageError(
            f"`at` {at:.12g} s lies outside the log, which runs from {record.time[0]:.12g} s to {record.time[-1]:.12g} s"
        )
    row = int(np.searchsorted(record.time, at, "right")) - 1
    turn = np.zeros(3)
    if row < last:
        part = (at - record.time[row]) / record.steps[row + 1]
        turn = part * increments(record)[0][row + 1]
    return Epoch(at, at - start, row, turn)
