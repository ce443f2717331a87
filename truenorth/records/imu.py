"""The IMU's record: angular rates and specific forces, or their increments."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.units import STANDARD_GRAVITY
from truenorth.records.base import Guess, Record
from truenorth.records.tables import numbers_of, times_of

Array = NDArray[np.float64]
# rad/s and m/s^2: far beyond any IMU; squares of what is larger overflow in the end
LARGEST = {"gyro": 1e6, "accel": 1e8}
SLOWEST = 1.0  # s between two rows
FASTEST = 1e-9  # s between two rows
# Numbers whose squares BLAS adds up in one thread: for more it wakes others, which go on spinning for longer than the sum takes.
IN_ONE_THREAD = 10_000
Kind = Literal["rates", "increments"]

COLUMNS = {
    "rates": ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"),
    "increments": ("dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z"),
}


@dataclass(frozen=True, repr=False)
class ImuRecord(Record):
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
    taken_for : tuple of Guess
        What the reader took the log for.

    Raises
    ------
    DataError
        Wrong shapes, fewer than two rows, a number that is not finite, or time that does not increase: the
        message names the source, the row (1 is the first sample) and the column.
    """

    time: Array
    gyro: Array
    accel: Array
    kind: Kind = "rates"
    source: str = field(default="IMU record", compare=False)
    taken_for: tuple[Guess, ...] = field(default=(), compare=False, repr=False)

    def groups(self) -> Mapping[str, Sequence[str]]:
        """``gyro`` and ``accel`` with the columns of the kind."""
        return {"gyro": COLUMNS[self.kind][:3], "accel": COLUMNS[self.kind][3:]}

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or self.kind not in COLUMNS:
            raise DataError(f"{self.source}: kind {self.kind!r} is not known; use 'rates' or 'increments'")
        super().__post_init__()
        if self.interval < FASTEST:
            raise DataError(
                f"{self.source}: a row every {self.interval:.4g} s; expected {FASTEST:g} s or more: time is probably in another "
                "unit; convert it to seconds"
            )

    def _check_numbers(self, name: str, columns: Sequence[str]) -> None:
        """Refuse what is not finite, and what no sensor measures."""
        values, limit = getattr(self, name), LARGEST[name] * (self.interval if self.kind == "increments" else 1.0)
        # No number is larger than the root of the sum of all squares, which is one pass over them, and is finite where they are.
        if _sum_of_squares(values) <= limit**2 or max(values.max(), -values.min()) <= limit:
            return
        super()._check_numbers(name, columns)
        row, i = np.argwhere(np.abs(values) > limit)[0]
        raise DataError(
            f"{self.source}: row {row + 1}, column {columns[i]}: {values[row, i]:g}; no such sensor measures more than "
            f"{limit:g}: check the units, or repair the row"
        )

    def check_rate(self) -> None:
        """Refuse a record whose rows are too far apart to be integrated; increments may be, where they add up to gravity.

        Raises
        ------
        DataError
            More than a second between two rows.
        """
        if self.interval > SLOWEST and not (self.kind == "increments" and self._adds_up_to_gravity()):
            raise DataError(
                f"{self.source}: a row every {self.interval:.4g} s; expected {SLOWEST:g} s at most: time is probably in "
                "milliseconds, microseconds or ticks; convert it to seconds, or give the rate"
            )

    def _adds_up_to_gravity(self) -> bool:
        """Whether the increments, over the time that the record says, are a specific force near gravity's."""
        force = np.linalg.norm(self.accel, axis=1).sum() / self.duration
        return bool(0.5 * STANDARD_GRAVITY < force < 2.0 * STANDARD_GRAVITY)

    @property
    def jitter(self) -> float:
        """RMS scatter of the time stamps about an even clock, s; gaps left out."""
        steps = np.delete(self.steps, self.gaps) - self.interval
        return math.sqrt(float(np.mean(steps**2)) / 2.0)

    @property
    def stamp_walks(self) -> tuple[float, float]:
        """Random walks of angle and velocity, rad/sqrt(s) and m/s/sqrt(s), that scattered stamps of rates make.

        Of the sum of ``x_k (d_k - d_(k-1))``, whose ``d`` are errors of stamps, ``d_k (x_k - x_(k+1))`` are left.
        """
        if self.kind == "increments":
            return 0.0, 0.0
        density = self.jitter / math.sqrt(self.interval)
        gyro, accel = (math.sqrt(max(float(np.mean(np.diff(a) ** 2)) for a in x.T)) for x in (self.gyro, self.accel))
        return density * gyro, density * accel

    @classmethod
    def of(cls, table: Any, axes: str = "RFU") -> ImuRecord:
        """A record as it is, or a pandas table or an xarray data set as one.

        Parameters
        ----------
        table : ImuRecord, DataFrame or xarray.Dataset
            Columns ``gyro_x .. accel_z`` of rates (rad/s, m/s^2) or ``dtheta_x .. dvel_z`` of increments (rad, m/s), named as
            `to_frame` names them; ``time`` (s) as a column or the index, which may hold durations, or dates: these become
            seconds since 1970, as in every reader.
        axes : str
            Where x, y and z point, such as ``"FRD"``, see :func:`truenorth.read_imu`.

        Raises
        ------
        UsageError
            Something else, a table without these columns or without time, or axes that do not exist.
        """
        from truenorth.core.attitude import body_axes

        if isinstance(table, cls):
            return table if axes == "RFU" else table.rotated(body_axes(axes))
        if hasattr(table, "to_dataframe"):
            table = table.to_dataframe()
        if not hasattr(table, "columns"):
            raise UsageError(
                f"record is a {type(table).__name__}; expected an ImuRecord (read_imu), a pandas table or an xarray data set"
            )
        kind: Any = next((k for k, names in COLUMNS.items() if set(names) <= set(table.columns)), None)
        if kind is None:
            raise UsageError(
                f"record: a table with columns {', '.join(map(str, table.columns))}; expected {', '.join(COLUMNS['rates'])}, or "
                f"{', '.join(COLUMNS['increments'])}, and time, in rad and m: rename and convert them, or let read_imu read the "
                "file, which finds names and units"
            )
        values = numbers_of(table, COLUMNS[kind])
        record = cls(times_of(table), values[:, :3], values[:, 3:], kind, "table")
        return record if axes == "RFU" else record.rotated(body_axes(axes))

    def rotated(self, C_new_old: ArrayLike) -> ImuRecord:
        """The same measurements in other body axes: ``v_new = C_new_old @ v_old``."""
        C = np.asarray(C_new_old, dtype=np.float64)
        return replace(self, gyro=self.gyro @ C.T, accel=self.accel @ C.T)


def _sum_of_squares(values: Array) -> float:
    """Of all numbers; not finite where one of them is not, or where it is too large."""
    numbers = values.reshape(-1)
    whole = len(numbers) - len(numbers) % IN_ONE_THREAD
    parts, rest = numbers[:whole].reshape(-1, IN_ONE_THREAD), numbers[whole:]
    with np.errstate(over="ignore", invalid="ignore"):  # what is so large is refused in words
        return float(np.vecdot(parts, parts).sum() + np.vdot(rest, rest))
