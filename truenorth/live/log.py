"""The rows so far, in bounded memory: beyond a limit, pairs of rows are added up to increments, and again; then the oldest go.

What is lost by adding up is coning and sculling above the new rate; the sums themselves are exact. No row becomes longer than
a tenth of a second, which the sway of a ship needs: at 100 Hz 125 000 rows are there after 21 min, and from 2.8 h on the oldest
quarter is dropped each time. Gyro biases wander by more in those hours than older rows could tell of them.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.task import LONGEST_BRIDGE
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]
Kind = Literal["rates", "increments"]

MOST_ROWS = 125_000
LONGEST_ROW = 0.101  # s
FIRST_ROWS = 4096
EARLIER = 10.0  # s of rows before the first one that is kept
INTERVAL_ROWS = 200  # from which the nominal interval is taken


def record_of(rows: Array, kind: Kind, source: str = "live") -> ImuRecord:
    """Rows ``time, gyro (3), accel (3)`` as a record."""
    return ImuRecord(rows[:, 0], rows[:, 1:4], rows[:, 4:], kind, source)


class Log:
    """Rows ``time, gyro (3), accel (3)`` in ascending time.

    Parameters
    ----------
    kind : {"rates", "increments"}
        Of the rows that come.
    most : int
        Rows that are kept; at least 1000.
    """

    earlier = np.empty((0, 7))  # rows before the first one that is kept: they say how a vehicle moved before a gap

    def __init__(self, kind: Kind = "rates", most: int = MOST_ROWS) -> None:
        self.source_kind: Kind = kind
        self.merged = 1  # rows of the source in a row of ours
        self.dropped = 0  # rows of ours that were too old
        self._most = max(1000, most)
        self._rows = np.empty((FIRST_ROWS, 7))
        self._size = 0
        self._gap = -np.inf
        self._interval = np.inf
        self._before = np.empty((0, 7))  # the source's last two rows, for the integration rule
        self._sum = np.zeros(6)  # of the source's increments that do not yet fill a row of ours
        self._count = 0  # how many they are
        self.end = -np.inf  # time of the source's last row, s

    def __len__(self) -> int:
        return self._size

    @property
    def kind(self) -> Kind:
        """Of the rows that are kept."""
        return self.source_kind if self.merged == 1 else "increments"

    @property
    def rows(self) -> Array:
        """(N, 7) view of the rows that are kept."""
        return self._rows[: self._size]

    @property
    def rate(self) -> float:
        """Rows of the source a second, of the newest ones; 0 before there are two."""
        if self._size < 2:
            return 0.0
        return self.merged / float(np.median(np.diff(self.rows[-500:, 0])))

    def passed_over(self, rows: Array) -> None:
        """Keep the newest of the sound rows that came before the first one to be kept."""
        found = np.vstack([self.earlier, rows])
        found = found[np.unique(found[:, 0], return_index=True)[1]]
        self.earlier = found[found[:, 0] > found[-1, 0] - EARLIER] if len(found) else found

    def add(self, block: Array) -> bool:
        """Take a block of ascending rows in; False where it lies before rows that are merged already, and was left out."""
        if self.merged > 1:
            if block[0, 0] <= self.end:
                return False
            self._add_up(block)
        else:
            self._insert(block)
        self.end = max(self.end, float(block[-1, 0]))
        if self._size > self._most:
            if 2.0 * self._interval <= LONGEST_ROW:
                self._halve()
            else:
                self._drop(self._most // 4)
        return True

    def record(self, since: float = -np.inf, until: float = np.inf, *, before: Array | None = None) -> ImuRecord:
        """Rows with ``since < time <= until`` as a record, copied; and those of `before`, as long as all are kept."""
        first, last = np.searchsorted(self.rows[:, 0], (since, until), side="right")
        rows = self.rows[first:last].copy()
        if before is not None and self.merged == 1 and not self.dropped:
            rows = np.vstack([before[before[:, 0] > since], rows])
        return record_of(rows, self.kind)

    @property
    def last_gap(self) -> float:
        """Time of the last row before a gap that no alignment bridges, s; minus infinity where there is none."""
        return self._gap

    @property
    def start(self) -> float:
        """Time of the first row after that gap, s; infinity where there is no row."""
        if not self._size:
            return np.inf
        first = 0 if self._gap == -np.inf else np.searchsorted(self.rows[:, 0], self._gap, side="right")
        return float(self._rows[first, 0])

    def _look_for_gaps(self, first: int) -> None:
        """Find the last gap among the steps to row `first` and after it."""
        time = self.rows[:, 0]
        if len(time) > 2 and (first < INTERVAL_ROWS or not np.isfinite(self._interval)):
            self._interval = float(np.median(np.diff(time[:INTERVAL_ROWS])))
        before = max(0, first - 1)
        steps = time[before + 1 :] - time[before:-1]
        longest = LONGEST_BRIDGE * self._interval
        if steps.size and steps.max() > longest:
            self._gap = float(time[before + np.flatnonzero(steps > longest)[-1]])

    def _insert(self, block: Array) -> None:
        need = self._size + len(block)
        if need > len(self._rows):
            grown = np.empty((max(need, 2 * len(self._rows)), 7))
            grown[: self._size] = self.rows
            self._rows = grown
        at = self._size
        if at and block[0, 0] <= self._rows[at - 1, 0]:
            at = int(np.searchsorted(self.rows[:, 0], block[0, 0]))
        self._rows[self._size : need] = block
        late, self._size = at < self._size, need
        if late:
            tail = self._rows[at:need]
            tail[:] = tail[np.argsort(tail[:, 0], kind="stable")]
            self._gap = -np.inf  # the late row may have filled it
        self._look_for_gaps(0 if late or at < INTERVAL_ROWS else at)

    def _add_up(self, block: Array) -> None:
        """Turn rows of the source into rows of ours; what does not fill one stays in the sum."""
        rows = np.vstack([self._before, block])
        values = np.hstack(increments(record_of(rows, self.source_kind)))[len(self._before) :]
        self._before = rows[-2:].copy()
        fill = self.merged - self._count
        if len(values) < fill:
            self._sum += values.sum(axis=0)
            self._count += len(values)
            return
        whole = (len(values) - fill) // self.merged * self.merged
        sums = np.vstack([self._sum + values[:fill].sum(axis=0), _sums(values[fill : fill + whole], self.merged)])
        times = block[fill - 1 : fill + whole : self.merged, :1]
        self._insert(np.hstack([times, sums]))
        self._sum = values[fill + whole :].sum(axis=0)
        self._count = len(values) - fill - whole

    def _drop(self, count: int) -> None:
        """Forget the oldest rows."""
        self._rows[: self._size - count] = self._rows[count : self._size]
        self._size -= count
        self.dropped += count

    def _halve(self) -> None:
        """Add our rows up in pairs; an odd last row goes to what does not yet fill one."""
        record = self.record()
        values = np.hstack(increments(record))
        if self.merged == 1:
            self._before = self.rows[-2:].copy()
        pairs = self._size // 2
        if self._size % 2:
            self._sum += values[-1]
            self._count += self.merged
        self._rows[:pairs, 0] = record.time[1 : 2 * pairs : 2]
        self._rows[:pairs, 1:] = _sums(values[: 2 * pairs], 2)
        self._size = pairs
        self.merged *= 2
        self._gap = -np.inf
        self._look_for_gaps(0)


def _sums(values: Array, count: int) -> Array:
    """Sums of `count` rows each."""
    return values.reshape(-1, count, values.shape[1]).sum(axis=1)
