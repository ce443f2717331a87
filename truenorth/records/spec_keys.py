"""Keys of a file of an IMU's specification: the dimension, the unit and the range of each."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from truenorth.core.units import format as format_quantity

# In SI, by dimension: what no sensor that measures anything is beyond. Rates and accelerations are as far as a log's may go
# (truenorth.records.imu); in a second or with one kelvin an error does not grow by more than that.
MOST = {
    "angular_rate": 1e6,
    "angle_random_walk": 1e6,
    "rate_random_walk": 1e6,
    "rate_per_acceleration": 1e6,
    "rate_per_temperature": 1e6,
    "acceleration": 1e8,
    "velocity_random_walk": 1e8,
    "acceleration_random_walk": 1e8,
    "acceleration_per_temperature": 1e8,
    "speed": 1e8,
    "ratio": 100.0,  # where 1 is all that is measured
    "ratio_per_temperature": 100.0,
    "angle": 2.0 * math.pi,
    "time": 3600.0,  # of a latency
    "temperature": 1e4,
    "temperature_rate": 1e4,
}
BEYOND = 1e12  # times that: what several terms and a log together may make of one, and no square overflows
FARTHEST = 100.0  # m, of an accelerometer from the centre of its IMU
# The least of what is above zero: a sensor that takes eleven days for a turn (Hz), what lasts no longer than a row (s).
LEAST = {"frequency": 1e-6, "time": 1e-4}


@dataclass(frozen=True)
class Entry:
    """A key of a file: its dimension, the unit it is written in, and the least it may be."""

    dimension: str
    unit: str
    least: Literal["zero", "above zero", "finite"] = "zero"

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the largest value that a sensor can have, in SI."""
        if self.least == "above zero":
            return LEAST.get(self.dimension, 0.0), math.inf
        most = MOST[self.dimension]
        return -most if self.least == "finite" else 0.0, most

    @property
    def range(self) -> str:
        """The bounds in the unit of a file."""
        low, high = self.bounds
        if math.isinf(high):
            return f">= {format_quantity(low, self.unit)}"
        return f"{format_quantity(low, self.unit) if low else 0} to {format_quantity(high, self.unit)}"

    def holds(self, value: float, times: float = 1.0) -> bool:
        """Whether a sensor can have a value, or one so many times as large."""
        low, high = self.bounds
        # A least above zero is so many times less; one below zero, as of a temperature, stays.
        return min(low, low / times) <= value and value / times <= high

    def allows(self, value: float) -> bool:
        """Whether a value in SI makes sense."""
        if self.least == "above zero":
            return value > 0.0
        return math.isfinite(value) and (value >= 0.0 or self.least == "finite")


WANTED = {"zero": "zero or more, and finite", "above zero": "a positive value", "finite": "a finite number"}

# Keys of a file by group.
KEYS: dict[str, dict[str, Entry]] = {
    "gyro": {
        "bias": Entry("angular_rate", "deg/h"),
        "turn_on_bias": Entry("angular_rate", "deg/h"),
        "random_walk": Entry("angle_random_walk", "deg/sqrt(h)"),
        "sample_noise": Entry("angular_rate", "deg/h"),
        "bias_instability": Entry("angular_rate", "deg/h"),
        "rate_random_walk": Entry("rate_random_walk", "deg/h/sqrt(h)"),
        "scale_factor": Entry("ratio", "ppm"),
        "scale_factor_asymmetry": Entry("ratio", "ppm"),
        "misalignment": Entry("angle", "arcsec"),
        "g_sensitivity": Entry("rate_per_acceleration", "deg/h/g"),
        "bias_temperature": Entry("rate_per_temperature", "deg/h/K"),
        "scale_factor_temperature": Entry("ratio_per_temperature", "ppm/K"),
        "bandwidth": Entry("frequency", "Hz", "above zero"),
        "latency": Entry("time", "ms"),
        "quantisation": Entry("angle", "arcsec"),
        "range": Entry("angular_rate", "deg/s", "above zero"),
    },
    "accel": {
        "bias": Entry("acceleration", "ug"),
        "turn_on_bias": Entry("acceleration", "ug"),
        "random_walk": Entry("velocity_random_walk", "ug/sqrt(Hz)"),
        "sample_noise": Entry("acceleration", "ug"),
        "bias_instability": Entry("acceleration", "ug"),
        "rate_random_walk": Entry("acceleration_random_walk", "ug/sqrt(h)"),
        "scale_factor": Entry("ratio", "ppm"),
        "scale_factor_asymmetry": Entry("ratio", "ppm"),
        "misalignment": Entry("angle", "arcsec"),
        "bias_temperature": Entry("acceleration_per_temperature", "ug/K"),
        "scale_factor_temperature": Entry("ratio_per_temperature", "ppm/K"),
        "bandwidth": Entry("frequency", "Hz", "above zero"),
        "latency": Entry("time", "ms"),
        "quantisation": Entry("speed", "m/s"),
        "range": Entry("acceleration", "g", "above zero"),
    },
    "temperature": {
        "start": Entry("temperature", "K", "finite"),
        "rate": Entry("temperature_rate", "K/min", "finite"),
        "time_constant": Entry("time", "min", "above zero"),
    },
}
PLAIN = {"gyro": ("filter_order",), "accel": ("filter_order", "positions"), "temperature": ()}  # keys of other kinds
CORRELATION_TIME = Entry("time", "s", "above zero")
ENTRIES = {(group, key): entry for group, keys in KEYS.items() for key, entry in keys.items()}
ENTRIES["", "correlation_time"] = CORRELATION_TIME
# Terms that no IMU is without: each of a sensor, by its own name and by others that stand for it.
ALWAYS = (
    ("random_walk", "sample_noise"),
    ("bias", "turn_on_bias"),
    ("bias_instability", "rate_random_walk"),
    ("scale_factor",),
    ("misalignment",),
)


def field_of(group: str, key: str) -> str:
    """The field of a specification that a key stands for."""
    return f"{group}_{key}" if group else key


def unnamed(fields: Iterable[str]) -> tuple[str, ...]:
    """Fields of the terms that no IMU is without, where none of these fields stands for the term."""
    given = set(fields)
    pairs = [(sensor, terms) for sensor in ("gyro", "accel") for terms in ALWAYS]
    return tuple(
        f"{sensor}_{terms[0]}" for sensor, terms in pairs if not given & {f"{sensor}_{term}" for term in terms}
    )
