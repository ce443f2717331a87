"""Keys of a file of an IMU's specification: the dimension, the unit and the range of each."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Entry:
    """A key of a file: its dimension, the unit it is written in, and the least it may be."""

    dimension: str
    unit: str
    least: Literal["zero", "above zero", "finite"] = "zero"

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
