"""From rows of an IMU record to increments, a whole record at once or chunk by chunk."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.blocks import row_blocks
from truenorth.core.errors import DataError
from truenorth.records import GAP_FACTOR, ImuRecord

Array = NDArray[np.float64]


class ImuRows(NamedTuple):
    """Rows of an IMU record as they come, one at least; unlike a record they are not checked.

    `time` (N,), `gyro` and `accel` (N, 3), `kind` "rates" or "increments", `source` for messages.
    """

    time: Array
    gyro: Array
    accel: Array
    kind: str
    source: str = ""

    @property
    def interval(self) -> float:
        """Median step, s."""
        return float(np.median(np.diff(self.time)))


def increments(
    record: ImuRecord | ImuRows, before: ImuRecord | ImuRows | None = None, interval: float | None = None
) -> tuple[Array, Array]:
    """Angle and velocity increments over the interval that ends at each row.

    Increment rows are given back as they are. Rates are instantaneous, and are integrated by the causal rule of third
    order ``T (5 w_k + 8 w_{k-1} - w_{k-2})/12`` (Adams-Moulton: exact for a rate that is quadratic in time; a sinusoid
    that turns by x rad an interval comes out late by x^3/24 rad, and smaller by 11 x^4/720). Next to a gap, and at the
    second row, the trapezoid; the first row's interval by its own rate.

    Parameters
    ----------
    record : ImuRecord or ImuRows
    before : ImuRecord or ImuRows, optional
        The rows just before, at least two (see :func:`last_rows`), so that a chunk goes on where another ended.
    interval : float, s, optional
        Nominal sampling interval; the record's own when left out.

    Returns
    -------
    dtheta : (N, 3) array, rad
    dvel : (N, 3) array, m/s
    """
    if record.kind == "increments":
        return record.gyro, record.accel
    nominal = record.interval if interval is None else interval
    rows = np.hstack([record.gyro, record.accel])
    steps = interval_lengths(record, before, nominal)
    earlier = 0 if before is None else 2
    if before is not None:
        rows = np.vstack([np.hstack([before.gyro, before.accel])[-2:], rows])
        steps = np.concatenate([[nominal, before.time[-1] - before.time[-2]], steps])
    T = steps[:, None]
    result = T * rows
    result[1:] = 0.5 * T[1:] * (rows[1:] + rows[:-1])
    regular = steps < GAP_FACTOR * nominal
    third = np.flatnonzero(regular[2:] & regular[1:-1]) + 2
    result[third] = T[third] / 12.0 * (5.0 * rows[third] + 8.0 * rows[third - 1] - rows[third - 2])
    return np.ascontiguousarray(result[earlier:, :3]), np.ascontiguousarray(result[earlier:, 3:])


def in_blocks(record: ImuRecord) -> Iterator[tuple[slice, Array, Array]]:
    """Increments as :func:`increments` gives them, to the bit, but of few rows at once: slice of the rows, dtheta, dvel."""
    if record.kind == "increments":
        yield slice(0, len(record)), record.gyro, record.accel
        return
    for rows in row_blocks(len(record)):
        yield rows, *increments(_rows(record, rows), _before(record, rows.start), record.interval)


def _rows(record: ImuRecord, rows: slice) -> ImuRows:
    return ImuRows(record.time[rows], record.gyro[rows], record.accel[rows], record.kind, record.source)


def _before(record: ImuRecord, row: int) -> ImuRows | None:
    return None if row == 0 else _rows(record, slice(row - 2, row))


def across_gaps(record: ImuRecord) -> ImuRecord:
    """The record, whose increments after a gap hold the whole of it: between the rows next to a gap rates change evenly.

    Rates are integrated so anyway. A rate that would stand still leaves ``w' T^2 / 2`` of a row that is lost, this one
    ``w'' T^3 / 12``.
    """
    gaps = record.gaps[record.gaps > 0]
    if record.kind == "rates" or not gaps.size:
        return record
    lost = record.steps[gaps] / record.interval - 1.0
    gyro, accel = record.gyro.copy(), record.accel.copy()
    for out, x in ((gyro, record.gyro), (accel, record.accel)):
        out[gaps] += lost_between(x[gaps - 1], x[gaps], lost)
    return replace(record, gyro=gyro, accel=accel)


def lost_between(before: Array, after: Array, lost: Array) -> Array:
    """Increments (m, n) of `lost` (m,) rows, between the rows next to a gap: rates change evenly there."""
    return 0.5 * lost[:, None] * (after + before)


def without_gaps(record: ImuRecord) -> ImuRecord:
    """The increments of each row's own interval again, of a record from :func:`across_gaps`, with the clock closed over gaps."""
    gaps = record.gaps[record.gaps > 0]
    missing = np.zeros(len(record))
    missing[gaps] = record.steps[gaps] - record.interval
    gyro, accel = of_own_intervals(record)
    return replace(record, time=record.time - np.cumsum(missing), gyro=gyro, accel=accel)


def of_own_intervals(record: ImuRecord) -> tuple[Array, Array]:
    """Gyros and accelerometers (N, 3) of a record from :func:`across_gaps`, each row without what the gap before it holds."""
    gaps = record.gaps[record.gaps > 0]
    if record.kind == "rates" or not gaps.size:
        return record.gyro, record.accel
    gyro, accel = record.gyro.copy(), record.accel.copy()
    for k, half in zip(gaps, 0.5 * (record.steps[gaps] / record.interval - 1.0), strict=True):
        gyro[k] = (gyro[k] - half * gyro[k - 1]) / (1.0 + half)
        accel[k] = (accel[k] - half * accel[k - 1]) / (1.0 + half)
    return gyro, accel


def interval_lengths(
    record: ImuRecord | ImuRows, before: ImuRecord | ImuRows | None = None, interval: float | None = None
) -> Array:
    """(N,) length of the interval that ends at each row, s; with nothing before it, the first row's is the nominal one.

    Raises
    ------
    DataError
        The record does not go on where `before` ended: another kind of rows, or time going back.
    """
    first = record.interval if interval is None else interval
    if before is not None:
        if before.kind != record.kind:
            raise DataError(
                f"{record.source}: this chunk holds {record.kind}, the one before it {before.kind}; expected one kind"
            )
        first = record.time[0] - before.time[-1]
        if first <= 0:
            raise DataError(
                f"{record.source}: row 1, column time: the chunk begins at {record.time[0]:.6f} s, but the one before "
                f"it ended at {before.time[-1]:.6f} s; expected chunks in order, each row in one chunk only"
            )
    return np.concatenate([[first], np.diff(record.time)])


def last_rows(record: ImuRecord) -> ImuRecord:
    """What the next chunk needs of this one: its last two rows, copied so that the rest can be let go."""
    return ImuRecord(
        record.time[-2:].copy(), record.gyro[-2:].copy(), record.accel[-2:].copy(), record.kind, record.source
    )


def read_only(array: ArrayLike) -> Array:
    """A read-only contiguous view: Numba compiles a kernel anew for a writable array, so all of ours look alike."""
    view = np.ascontiguousarray(array, dtype=np.float64).view()
    view.flags.writeable = False
    return view
