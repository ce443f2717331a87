"""Angles of an indexer that carries the IMU, as they come."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.aids import Indexer
from truenorth.core.errors import UsageError
from truenorth.live.feed import Feed
from truenorth.records import EncoderRecord

Array = NDArray[np.float64]


class IndexerFeed(Feed):
    """The encoder of an indexer.

    Parameters
    ----------
    axes : sequence of {"x", "y", "z"}
        The outermost first.
    lever_arm : (3,) array, m, optional
        From the IMU to the body's centre of rotation, body axes; estimated when it is left out.
    angle_sigma : float, rad
        Of the indexer's own angles and axes.
    """

    key = "indexer"
    navigates = False
    columns = ("angle_1", "angle_2", "angle_3")

    def __init__(
        self, axes: Sequence[str] = ("z", "x"), *, lever_arm: ArrayLike | None = None, angle_sigma: float = 0.0
    ) -> None:
        super().__init__()
        if not 1 <= len(axes) <= len(self.columns):
            raise UsageError(f"axes {','.join(axes)} of an indexer; expected one to three of x, y and z")
        self.axes, self.angle_sigma = tuple(axes), angle_sigma
        self.lever_arm = None if lever_arm is None else np.asarray(lever_arm, dtype=np.float64)

    def push(self, time: ArrayLike, angles: ArrayLike) -> None:
        """Take angles in, rad, (K, A) or (K,): turns are counted."""
        times = np.atleast_1d(np.asarray(time, dtype=np.float64))
        self.add(self._padded(times, np.asarray(angles, dtype=np.float64).reshape(len(times), -1)))

    def rows_of(self, record: EncoderRecord) -> Array:
        """See :class:`Feed`."""
        return self._padded(record.time, record.angles.reshape(len(record), -1))

    def aid_of(self, rows: Array) -> Any:
        """See :class:`Feed`."""
        angles = np.ascontiguousarray(rows[:, 1 : 1 + len(self.axes)])
        record = EncoderRecord(rows[:, 0], angles[:, 0] if len(self.axes) == 1 else angles, source="live encoder")
        return Indexer(record, self.axes, self.lever_arm, self.angle_sigma)

    def continued(self, rows: Array) -> Array:
        """Rows that were read for themselves, with the turns that were counted before them."""
        before = self.rows
        if not len(before) or not len(rows):
            return rows
        same = int(np.searchsorted(rows[:, 0], before[-1, 0]))
        off = before[-1, 1:] - rows[min(same, len(rows) - 1), 1:]
        turns: Array = np.round(off / (2.0 * np.pi)) * (2.0 * np.pi)
        return np.column_stack([rows[:, 0], rows[:, 1:] + turns])

    def _padded(self, time: Array, angles: Array) -> Array:
        if angles.shape[1] != len(self.axes):
            raise UsageError(
                f"{angles.shape[1]} angles in a row; expected one for each of the axes {','.join(self.axes)}"
            )
        rest = np.full((len(time), len(self.columns) - len(self.axes)), np.nan)
        return np.column_stack([time, angles, rest])
