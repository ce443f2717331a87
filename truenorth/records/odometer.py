"""The odometer's record: distance, pulses or speed along the vehicle's forward axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.records.base import Record

Array = NDArray[np.float64]
KINDS = ("distance", "pulses", "speed")
FASTEST = 400.0  # m/s: no wheel has turned as fast
SPIKES = 0.01  # share of rows that may be faster, by faults of the counter


@dataclass(frozen=True, repr=False)
class OdometerRecord(Record):
    """What a wheel or transmission sensor counts.

    Parameters
    ----------
    time : (N,) array, s
    values : (N,) array
        Of the kind.
    kind : {"distance", "pulses", "speed"}
        Distance (m) or number of pulses of the interval that *ends* at each time, or instantaneous speed (m/s).
    pulse_size : float or None, m
        Distance of one pulse; needed by pulses, and by them alone.
    signed : bool
        Whether reverse driving is negative; where not, all values are magnitudes.
    source : str

    Raises
    ------
    DataError
        As for :class:`ImuRecord`; pulses without a size, a negative value where reverse has no sign, or counts from the start in
        the place of those of each interval.
    """

    time: Array
    values: Array
    kind: Literal["distance", "pulses", "speed"] = "distance"
    pulse_size: float | None = None
    signed: bool = True
    source: str = field(default="odometer record", compare=False)

    def groups(self) -> Mapping[str, Sequence[str]]:
        """``values`` under the name of the kind; without a sign for reverse, under one that says so."""
        return {"values": (self.kind if self.signed else f"{self.kind}_unsigned",)}

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise DataError(f"{self.source}: kind {self.kind!r} is not known; use {', '.join(map(repr, KINDS))}")
        if self.kind == "pulses" and not (self.pulse_size is not None and 0.0 < self.pulse_size < np.inf):
            raise DataError(
                f"{self.source}: pulses with a pulse size of {self.pulse_size}; expected metres a pulse: give pulse_size"
            )
        if self.kind != "pulses" and self.pulse_size is not None:
            raise DataError(
                f"{self.source}: a pulse size, but the values are {self.kind}; expected kind 'pulses', or no pulse_size"
            )
        super().__post_init__()
        bad = np.flatnonzero(self.values < 0) if not self.signed else np.empty(0, dtype=int)
        if bad.size:
            raise DataError(
                f"{self.source}: row {bad[0] + 1}, column {self.groups()['values'][0]}: {self.values[bad[0]]:g}; expected no "
                "negative value where reverse driving has no sign: leave signed True"
            )
        if self.kind != "speed" and len(self) > 1:
            self._check_intervals()

    def _check_intervals(self) -> None:
        """Refuse a running total: no wheel is as fast as its values say, and their differences are those of a wheel."""
        fast = np.abs(self.speed) > FASTEST
        jumps = np.abs(np.diff(self.distance)) > FASTEST * self.steps[1:]
        if np.mean(fast) > max(SPIKES, 10.0 * float(np.mean(jumps))):
            row, column = int(np.argmax(fast)), self.groups()["values"][0]
            raise DataError(
                f"{self.source}: row {row + 1}, column {column}: {self.values[row]:g} within {self.steps[row]:.3g} s would be "
                f"{abs(self.speed[row]):.4g} m/s; expected what is counted in the interval that ends at each row: these values are "
                f"counted from the start: call the column {self.kind}_total, or hand in their differences"
            )

    @cached_property
    def distance(self) -> Array:
        """(N,) distance of the interval that ends at each row, m; of speeds by the trapezoidal rule.

        The first row's interval is the nominal one; its distance from a speed is speed times interval.
        """
        if self.kind == "speed":
            mean = self.values.copy()
            mean[1:] = 0.5 * (self.values[1:] + self.values[:-1])
            return mean * self.steps
        return self.values * (1.0 if self.pulse_size is None else self.pulse_size)

    @cached_property
    def speed(self) -> Array:
        """(N,) speed, m/s: instantaneous where it is measured, else the mean of the interval that ends at each row."""
        return self.values if self.kind == "speed" else self.distance / self.steps

    def velocity_b(self, C_mb: Array) -> Array:
        """(N, 3) velocity in body axes, m/s, of a wheel along the vehicle's forward axis."""
        return np.asarray(self.speed[:, None] * C_mb[1])

    def way_b(self, C_mb: Array) -> Array:
        """(N, 3) way of the interval that ends at each row, body axes, m."""
        return np.asarray(self.distance[:, None] * C_mb[1])

    def columns(self) -> dict[str, Array]:
        """The values; of pulses also the size of one, m."""
        size = {} if self.pulse_size is None else {"pulse_size": np.full(len(self), self.pulse_size)}
        return super().columns() | size
