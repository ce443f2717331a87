"""Units that fit what is drawn: hours where hours are, kilometres, arcminutes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.units import MICRO_G

Array = NDArray[np.float64]

HOURS_FROM = 7200.0  # s: longer spans are drawn in hours
OF_AN_EPOCH = 1e7  # s: a clock that stands there counts from a date, and is drawn from the log's first second on


@dataclass(frozen=True)
class Clock:
    """The unit in which times of one log are drawn: seconds, or hours from two hours on; and from where on."""

    scale: float
    unit: str
    zero: float = 0.0  # s, of the log's clock

    @classmethod
    def of(cls, time: Array) -> Clock:
        """Choose for these times, s."""
        long = len(time) > 0 and float(time[-1] - time[0]) >= HOURS_FROM
        zero = float(np.floor(time[0])) if len(time) > 0 and abs(time[0]) >= OF_AN_EPOCH else 0.0
        return cls(3600.0, "h", zero) if long else cls(1.0, "s", zero)

    @property
    def label(self) -> str:
        """The unit, and the second of the log's clock from which it counts where that is not zero."""
        return f"{self.unit} since {self.zero:.0f} s" if self.zero else self.unit

    def __call__(self, time: ArrayLike) -> Array:
        """Times of the log, s, in this unit."""
        return (np.asarray(time, dtype=np.float64) - self.zero) / self.scale

    def lasting(self, duration: ArrayLike) -> Array:
        """Durations, s, in this unit."""
        return np.asarray(duration, dtype=np.float64) / self.scale


def length_unit(values: ArrayLike) -> tuple[float, str]:
    """Metres in the unit that fits these lengths, and its name."""
    return _fitting(values, ((1000.0, "km", 5000.0), (1.0, "m", 0.1), (1e-3, "mm", 0.0)))


def speed_unit(values: ArrayLike) -> tuple[float, str]:
    """Metres a second in the unit that fits these speeds, and its name."""
    return _fitting(values, ((1.0, "m/s", 0.1), (1e-3, "mm/s", 0.0)))


def angle_unit(values: ArrayLike) -> tuple[float, str]:
    """Radians in the unit that fits these angles, and its name."""
    degree = np.pi / 180.0
    return _fitting(
        values, ((degree, "deg", degree), (degree / 60, "arcmin", degree / 60), (degree / 3600, "arcsec", 0.0))
    )


def accel_unit(values: ArrayLike) -> tuple[float, str]:
    """Accelerations (m/s^2) in the part of g that fits these values, and its name."""
    return _fitting(values, ((1e3 * MICRO_G, "mg", 1e4 * MICRO_G), (MICRO_G, "µg", 0.0)))


def unit_of(unit: str, values: ArrayLike) -> tuple[float, str]:
    """An SI unit in that of its kind that fits these values, and its name."""
    if unit == "rad/s":
        return float(np.radians(1.0 / 3600.0)), "deg/h"
    fitting = {"m": length_unit, "m/s": speed_unit, "rad": angle_unit}.get(unit)
    return (1.0, unit) if fitting is None else fitting(values)


def _fitting(values: ArrayLike, units: Sequence[tuple[float, str, float]]) -> tuple[float, str]:
    """The first unit whose least value the greatest of these values reaches."""
    finite = np.abs(np.asarray(values, dtype=np.float64))
    finite = finite[np.isfinite(finite)]
    greatest = float(finite.max()) if finite.size else 0.0
    return next((scale, name) for scale, name, least in units if greatest >= least)
