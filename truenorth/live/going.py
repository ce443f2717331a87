"""The filter of an alignment at rest, going on with the rows that come: sigma comes down as it would in a batch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.result import Alignment
from truenorth.alignment.task import bridged
from truenorth.core.errors import DataError
from truenorth.estimate.ongoing import BLOCK, CONTEXT, Ongoing
from truenorth.live.log import INTERVAL_ROWS, Kind, record_of
from truenorth.records import ImuRecord

Array = NDArray[np.float64]


class Going:
    """A filter, and the rows after its last epoch.

    Parameters
    ----------
    alignment : Alignment
        With its filter's end.
    kind : {"rates", "increments"}
        Of the rows.
    """

    def __init__(self, alignment: Alignment, kind: Kind) -> None:
        assert alignment.ongoing is not None
        self.filter: Ongoing = alignment.ongoing
        self._kind = kind
        self._waiting: list[Array] = []
        self.behind = 0  # rows that came since the filter last went on
        # Of the answer, not of the filter: deflection of the vertical, creep of the base, what the checks have added.
        w, V = np.linalg.eigh(alignment.phi_covariance - self.filter.attitude(None, 0)[2])
        self._more = (V * np.maximum(w, 0.0)) @ V.T

    def add(self, rows: Array) -> None:
        """Take rows ``time, gyro (3), accel (3)`` in."""
        self._waiting.append(rows)
        self.behind += len(rows)

    def advance(self, until: float, *, measured: bool = True) -> None:
        """Filter the rows up to a time, in whole blocks.

        Parameters
        ----------
        until : float, s
        measured : bool
            Whether the base is where it was.
        """
        self.behind = 0
        if until - self.filter.time < BLOCK * self.filter.interval:
            return
        rows = self._rows()
        part = rows[: int(np.searchsorted(rows[:, 0], until, side="right"))]
        record, context = self._record(part)
        if record is None:
            return
        self.filter = self.filter.after(record, context, measured=measured)
        self._waiting.append(np.empty((0, 7)))  # what is behind goes

    def now(self) -> tuple[float, Array, Array]:
        """Time, attitude (3, 3) and covariance of its misalignment (E, N, U), at the newest row."""
        time, C_nb, P = self.filter.attitude(*self._record(self._rows()))
        return time, C_nb, P + self._more

    def _rows(self) -> Array:
        if len(self._waiting) != 1:
            rows = np.vstack(self._waiting) if self._waiting else np.empty((0, 7))
            rows = rows[np.argsort(rows[:, 0], kind="stable")]
            first = int(np.searchsorted(rows[:, 0], self.filter.time)) - CONTEXT
            self._waiting = [rows[max(0, first) :]]
        return self._waiting[0]

    def _record(self, rows: Array) -> tuple[ImuRecord | None, int]:
        """Rows as a record, and how many of them are not after the last epoch; None where no row is."""
        if len(rows) < 2:
            return None, 0
        half = 0.5 * float(np.median(np.diff(rows[:INTERVAL_ROWS, 0])))
        first = int(np.searchsorted(rows[:, 0], self.filter.time + half))
        context = min(first, CONTEXT)
        record = record_of(rows[first - context :], self._kind)
        if len(record) < context + 1 or len(record) < 2:
            return None, 0
        try:
            return bridged(record), context
        except DataError:  # a gap that later rows may fill; where they do not, all begins anew
            return record, context
