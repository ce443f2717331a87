"""Records: measurements in SI units and our axes, checked when they are made."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.errors import DataError

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
GAP_FACTOR = 1.5  # a step of more than 1.5 nominal intervals has lost at least one sample

COLUMNS = {
    "rates": ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"),
    "increments": ("dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z"),
}


@dataclass(frozen=True)
class ImuRecord:
    """Angular rates and specific forces of one IMU, or their increments.

    Parameters
    ----------
    time : (N,) array, s
        Strictly increasing. A rate row is the instantaneous rate at its time; an increment row is the integral
        over the interval that *ends* at its time.
    gyro : (N, 3) array
        ``w_ib_b`` in rad/s, or its increment in rad; body axes RFU (x right, y forward, z up).
    accel : (N, 3) array
        Specific force ``f_b`` in m/s^2, or its increment in m/s.
    kind : {"rates", "increments"}
        What a row is.
    source : str
        Where the record came from (a file name); messages begin with it.

    Raises
    ------
    DataError
        Wrong shapes, fewer than two rows, a number that is not finite, or time that does not increase: the
        message names the source, the row (1 is the first sample) and the column.
    """

    time: Array
    gyro: Array
    accel: Array
    kind: Literal["rates", "increments"] = "rates"
    source: str = field(default="IMU record", compare=False)

    def __post_init__(self) -> None:
        if self.kind not in COLUMNS:
            raise DataError(f"{self.source}: kind {self.kind!r} is not known; use 'rates' or 'increments'")
        for name in ("time", "gyro", "accel"):
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if array.flags.writeable:
                array = array.view()
                array.flags.writeable = False
            object.__setattr__(self, name, array)
        _check_shapes(self)
        _check_time(self.time, self.source)
        _check_finite(self)

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def interval(self) -> float:
        """Nominal sampling interval, s: the median step."""
        return float(np.median(np.diff(self.time)))

    @property
    def rate(self) -> float:
        """Nominal sampling rate, Hz."""
        return 1.0 / self.interval

    @property
    def duration(self) -> float:
        """Length of the record, s, the interval of the first row included."""
        return float(self.time[-1] - self.time[0]) + self.interval

    @cached_property
    def steps(self) -> Array:
        """(N,) length of the interval that ends at each row, s; the first row's is the nominal one."""
        steps = np.empty(len(self.time))
        steps[0] = self.interval
        np.subtract(self.time[1:], self.time[:-1], out=steps[1:])
        return steps

    @cached_property
    def gaps(self) -> NDArray[np.intp]:
        """Rows that follow a gap: their step is longer than 1.5 nominal intervals."""
        return np.flatnonzero(self.steps > GAP_FACTOR * self.interval)

    def between(self, start: float | None = None, stop: float | None = None) -> ImuRecord:
        """Rows with ``start <= time <= stop``, as a record of its own.

        Raises
        ------
        DataError
            The window holds fewer than two rows.
        """
        first = 0 if start is None else int(np.searchsorted(self.time, start, "left"))
        last = len(self) if stop is None else int(np.searchsorted(self.time, stop, "right"))
        if last - first < 2:
            raise DataError(
                f"{self.source}: no samples between {start} s and {stop} s; the record runs from "
                f"{self.time[0]:g} s to {self.time[-1]:g} s, choose a window inside it"
            )
        return self[first:last]

    def __getitem__(self, rows: slice) -> ImuRecord:
        return ImuRecord(self.time[rows], self.gyro[rows], self.accel[rows], self.kind, self.source)

    def rotated(self, C_new_old: ArrayLike) -> ImuRecord:
        """The same measurements in other body axes: ``v_new = C_new_old @ v_old``."""
        C = np.asarray(C_new_old, dtype=np.float64)
        return ImuRecord(self.time, self.gyro @ C.T, self.accel @ C.T, self.kind, self.source)

    def to_frame(self) -> pd.DataFrame:
        """A pandas table with index ``time`` and the documented columns."""
        import pandas as pd

        table = np.hstack([self.gyro, self.accel])
        return pd.DataFrame(table, pd.Index(self.time, name="time"), columns=list(COLUMNS[self.kind]))


def _check_shapes(record: ImuRecord) -> None:
    rows = record.time.shape[0] if record.time.ndim == 1 else -1
    if rows < 0 or record.gyro.shape != (rows, 3) or record.accel.shape != (rows, 3):
        raise DataError(
            f"{record.source}: time, gyro and accel have the shapes {record.time.shape}, {record.gyro.shape} and "
            f"{record.accel.shape}; expected (N,), (N, 3) and (N, 3)"
        )
    if rows < 2:
        raise DataError(f"{record.source}: {rows} sample(s); at least 2 are needed")


def _check_time(time: Array, source: str) -> None:
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise DataError(f"{source}: row {bad[0] + 1}, column time: {time[bad[0]]}; expected a finite number")
    bad = np.flatnonzero(np.diff(time) <= 0)
    if bad.size:
        k = int(bad[0]) + 1
        what = "repeats" if time[k] == time[k - 1] else "goes back"
        raise DataError(
            f"{source}: row {k + 1}, column time: time {what} ({time[k - 1]:.6f} s, then {time[k]:.6f} s); expected "
            "strictly increasing seconds: sort the log or drop the repeated rows"
        )


def _check_finite(record: ImuRecord) -> None:
    columns = COLUMNS[record.kind]
    for group, offset in ((record.gyro, 0), (record.accel, 3)):
        if np.isfinite(group.sum()):  # one pass; a NaN or inf anywhere survives the sum
            continue
        bad = np.argwhere(~np.isfinite(group))
        if bad.size:
            row, axis = bad[0]
            raise DataError(
                f"{record.source}: row {row + 1}, column {columns[offset + axis]}: {group[row, axis]}; expected a "
                "finite number: remove the row or repair the log"
            )
