"""IMU specifications: what a datasheet promises, one-sigma, in SI inside and in datasheet units in files.

A file holds groups of keys, each value with its unit:

    name: my IMU
    gyro: {bias: 0.01 deg/h, random_walk: 0.001 deg/sqrt(h), scale_factor: 5 ppm, bandwidth: 100 Hz}
    accel: {bias: 50 ug, random_walk: 10 ug/sqrt(Hz), positions: [[3 cm, 0 m, 0 m], [0 m, 3 cm, 0 m], [0 m, 0 m, 3 cm]]}
    temperature: {start: -10 K, rate: 1 K/min, time_constant: 20 min}
    correlation_time: 5 min

A term that a file does not name is not zero: alignment and navigation take for possible what is usual
(:mod:`truenorth.alignment.unsaid`), unless the file says ``unnamed: zero``. A simulation makes no error that is not named.

What each term does to a measurement is written in :mod:`truenorth.simulation.imu_errors`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cache, cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.paths import as_path
from truenorth.core.units import format as format_quantity
from truenorth.core.yaml_file import quantity, read_mapping, unknown_key
from truenorth.records.presets import PRESETS
from truenorth.records.spec_keys import (
    BEYOND,
    CORRELATION_TIME,
    ENTRIES,
    FARTHEST,
    KEYS,
    PLAIN,
    WANTED,
    Entry,
    field_of,
    unnamed,
)
from truenorth.records.vibration import coning_left

if TYPE_CHECKING:
    from truenorth.records.imu import ImuRecord

CONING = 0.1  # of the bias of the gyros, that the drift of coning is negligible below: half a percent of its sigma
LEAST_DRIFT = math.radians(1e-4) / 3600.0  # rad/s; less than that of the best gyros

Places = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class ImuSpec:
    """Errors of one IMU, one-sigma for each axis.

    Attributes
    ----------
    gyro_bias : float, rad/s
        Constant: what calibration has left.
    gyro_turn_on_bias : float, rad/s
        Another from each switch-on to the next.
    gyro_random_walk : float, rad/sqrt(s)
    gyro_sample_noise : float, rad/s
        White noise of each sample, whatever the rate: at an interval T like a random walk of ``gyro_sample_noise sqrt(T)``.
    gyro_bias_instability : float, rad/s
        Slow change of the bias in operation, a Gauss-Markov process.
    gyro_rate_random_walk : float, rad/s/sqrt(s)
        Slow change of the bias without bound, from zero at switch-on.
    gyro_scale_factor, gyro_misalignment : float, 1 and rad
    gyro_scale_factor_asymmetry : float, 1
        Half the difference of the scale factors for positive and negative rates.
    gyro_g_sensitivity : float, rad/s/(m/s^2)
        Of each gyro to the specific force along each axis.
    gyro_bias_temperature, gyro_scale_factor_temperature : float, rad/s/K and 1/K
    gyro_bandwidth : float, Hz
        At which the response falls by 3 dB; infinite where not given.
    gyro_filter_order : {1, 2}
        Of the low pass: one pole, or Butterworth's two.
    gyro_latency : float, s
        By which the output is late.
    gyro_quantisation : float, rad
        Size of one step of the output increment.
    gyro_range : float, rad/s
        Beyond it the output saturates; infinite where not given.
    accel_...
        The same of the accelerometers, m/s^2 for rad/s; they have no g-sensitivity.
    accel_positions : three (3,) tuples or None, m
        Where each accelerometer sits from the centre of the IMU (size effect).
    temperature_start : float, K
        At switch-on, above the temperature of calibration.
    temperature_rate : float, K/s
        To begin with.
    temperature_time_constant : float, s
        In which the rate dies away; infinite: it stays.
    correlation_time : float, s
        Of the bias instabilities.
    name : str
    unsaid : tuple of str
        Fields that a file or a mapping does not name; empty where the specification is made of numbers. Those that have been put
        in since are not in `still_unsaid`.
    """

    gyro_bias: float = 0.0
    gyro_turn_on_bias: float = 0.0
    gyro_random_walk: float = 0.0
    gyro_sample_noise: float = 0.0
    gyro_bias_instability: float = 0.0
    gyro_rate_random_walk: float = 0.0
    gyro_scale_factor: float = 0.0
    gyro_scale_factor_asymmetry: float = 0.0
    gyro_misalignment: float = 0.0
    gyro_g_sensitivity: float = 0.0
    gyro_bias_temperature: float = 0.0
    gyro_scale_factor_temperature: float = 0.0
    gyro_bandwidth: float = math.inf
    gyro_filter_order: int = 1
    gyro_latency: float = 0.0
    gyro_quantisation: float = 0.0
    gyro_range: float = math.inf
    accel_bias: float = 0.0
    accel_turn_on_bias: float = 0.0
    accel_random_walk: float = 0.0
    accel_sample_noise: float = 0.0
    accel_bias_instability: float = 0.0
    accel_rate_random_walk: float = 0.0
    accel_scale_factor: float = 0.0
    accel_scale_factor_asymmetry: float = 0.0
    accel_misalignment: float = 0.0
    accel_bias_temperature: float = 0.0
    accel_scale_factor_temperature: float = 0.0
    accel_bandwidth: float = math.inf
    accel_filter_order: int = 1
    accel_latency: float = 0.0
    accel_quantisation: float = 0.0
    accel_range: float = math.inf
    accel_positions: Places | None = None
    temperature_start: float = 0.0
    temperature_rate: float = 0.0
    temperature_time_constant: float = math.inf
    correlation_time: float = 300.0
    name: str = "custom"
    unsaid: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        where = f"IMU specification {self.name!r}"
        for (group, key), entry in ENTRIES.items():
            name = field_of(group, key)
            value = getattr(self, name)
            if not entry.allows(value):
                raise UsageError(f"{where}: {name} is {value}; expected {WANTED[entry.least]}")
            if not entry.holds(value, BEYOND):
                raise UsageError(f"{where}: {name} is {value:g} in SI; expected {entry.range}: check its unit")
        for name in ("gyro_filter_order", "accel_filter_order"):
            if getattr(self, name) not in (1, 2):
                raise UsageError(f"{where}: {name} is {getattr(self, name)}; expected 1 or 2")
        if self.accel_positions is not None:
            places = [tuple(place) for place in self.accel_positions]
            if [len(place) for place in places] != [3, 3, 3] or not all(abs(x) <= FARTHEST for p in places for x in p):
                raise UsageError(
                    f"{where}: accel_positions is {self.accel_positions}; expected three places of three lengths up to "
                    f"{FARTHEST:g} m"
                )
            object.__setattr__(self, "accel_positions", tuple(places))

    @cached_property
    def bias_variance(self) -> NDArray[np.float64]:
        """(6,) variance of the biases proper, gyro and accelerometer, (rad/s)^2 and (m/s^2)^2; nobody writes to it."""
        wanders = np.repeat([self.gyro_bias_instability**2, self.accel_bias_instability**2], 3)
        found = self.constant_variance + wanders
        found.flags.writeable = False
        return np.asarray(found)

    @property
    def still_unsaid(self) -> tuple[str, ...]:
        """Of `unsaid` what has not been put in since, by itself or by what stands for it."""
        silent = self._silent()
        return tuple(name for name in self.unsaid if name in silent)

    def _silent(self) -> tuple[str, ...]:
        """Terms that no IMU is without, and that are zero here."""
        return unnamed(name for key in ENTRIES if getattr(self, name := field_of(*key)))

    @property
    def constant_variance(self) -> NDArray[np.float64]:
        """(6,) of it what does not change within a log: all but the bias instabilities."""
        gyro = self.gyro_bias**2 + self.gyro_turn_on_bias**2
        accel = self.accel_bias**2 + self.accel_turn_on_bias**2
        return np.repeat([gyro, accel], 3)

    def acting_variance(self, f: NDArray[np.float64]) -> NDArray[np.float64]:
        """(3,) variance of what acts as an accelerometer bias under a constant force, beyond the bias, (m/s^2)^2.

        ``measured = (I + S + M) f``: the i-th scale factor acts on f_i, the misalignments on the two others.

        Parameters
        ----------
        f : (3,) array, m/s^2
            Specific force, body axes.
        """
        f2 = np.square(f)
        return np.asarray(self.accel_scale_factor**2 * f2 + self.accel_misalignment**2 * (f2.sum() - f2))

    def with_random_walks(self, interval: float) -> ImuSpec:
        """What a filter sees of the noise of samples: random walks that hold it, at a sampling interval (s)."""
        if self.gyro_sample_noise == self.accel_sample_noise == 0.0:
            return self
        root = math.sqrt(interval)
        whole = self.with_more_noise(self.gyro_sample_noise * root, self.accel_sample_noise * root)
        return replace(whole, gyro_sample_noise=0.0, accel_sample_noise=0.0)

    def with_more_noise(self, gyro: float, accel: float) -> ImuSpec:
        """With further random walks of gyros (rad/sqrt(s)) and accelerometers (m/s/sqrt(s)), independent of its own."""
        if gyro == accel == 0.0:
            return self
        return replace(
            self,
            gyro_random_walk=math.hypot(self.gyro_random_walk, gyro),
            accel_random_walk=math.hypot(self.accel_random_walk, accel),
        )

    def with_coning_of(self, record: ImuRecord) -> ImuSpec:
        """With the drift that the coning of a base leaves between rows, as a bias: what integrates these rows has it."""
        drift = coning_left(record)
        if drift <= max(CONING * math.sqrt(self.bias_variance[0]), LEAST_DRIFT):
            return self
        return replace(self, gyro_turn_on_bias=math.hypot(self.gyro_turn_on_bias, drift))

    def to_mapping(self) -> dict[str, Any]:
        """The specification as it stands in a file; only what differs from a perfect IMU."""
        result: dict[str, Any] = {"name": self.name}
        silent = self._silent()  # in a file without zeros
        if silent and not self.unsaid:
            result["unnamed"] = "zero"
        for (group, key), entry in ENTRIES.items():
            name = field_of(group, key)
            value = getattr(self, name)
            none = bool(self.unsaid) and name in silent and name not in self.unsaid
            if value in (0.0, math.inf) and not none:
                continue
            text = format_quantity(value, entry.unit, digits=None)
            if group:
                result.setdefault(group, {})[key] = text
            else:
                result[key] = text
        for group in ("gyro", "accel"):
            if getattr(self, f"{group}_filter_order") != 1:
                result.setdefault(group, {})["filter_order"] = getattr(self, f"{group}_filter_order")
        if self.accel_positions is not None:
            places = [[format_quantity(x, "m", digits=None) for x in place] for place in self.accel_positions]
            result.setdefault("accel", {})["positions"] = places
        return result

    def to_yaml(self, path: str | PathLike[str]) -> None:
        """Write the specification as a file that `imu_spec` reads back.

        Raises
        ------
        UsageError
            The file cannot be written.
        """
        import yaml

        from truenorth.core.atomic import atomic_path, write_text

        with atomic_path(path) as temporary:
            write_text(temporary, yaml.safe_dump(self.to_mapping(), sort_keys=False, allow_unicode=True))


def imu_spec(source: ImuSpec | str | PathLike[str] | Mapping[str, Any]) -> ImuSpec:
    """A specification from a preset's name, a YAML file, a mapping, or as it is.

    Raises
    ------
    UsageError
        A name that is neither a preset nor a file.
    DataError
        A file with an unknown key, a wrong unit or a negative value; the message names the file and the key.
    """
    if isinstance(source, ImuSpec):
        return source
    if isinstance(source, Mapping):
        return _from_mapping(source, "IMU specification", "custom")
    if isinstance(source, str) and source in PRESETS:
        return _preset(source)
    path = as_path(source, "IMU specification")
    if not path.is_file():
        near = get_close_matches(str(source), PRESETS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        presets = ", ".join(PRESETS)
        raise UsageError(
            f"IMU specification {str(source)!r} is neither a preset ({presets}) nor a file that can be read{hint}"
        )
    return _from_mapping(read_mapping(path), str(path), path.stem)


@cache
def _preset(name: str) -> ImuSpec:
    return _from_mapping(PRESETS[name], name, name)


# Kalibr's imu.yaml: continuous-time densities in SI, as bare numbers.
KALIBR = {
    "gyroscope_noise_density": "gyro_random_walk",
    "gyroscope_random_walk": "gyro_rate_random_walk",
    "accelerometer_noise_density": "accel_random_walk",
    "accelerometer_random_walk": "accel_rate_random_walk",
}


def _from_kalibr(content: Mapping[Any, Any], where: str, name: str) -> ImuSpec:
    """The specification of a Kalibr file; its other keys (topic, rate, model) are none of the sensor's errors."""
    values: dict[str, Any] = {"name": name}
    for theirs, ours in KALIBR.items():
        value = content[theirs]
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < math.inf:
            raise DataError(f"{where}: {theirs}: {value!r}; expected a number in SI, zero or more")
        values[ours] = float(value)
    return ImuSpec(**values, unsaid=unnamed(values))


def _from_mapping(content: Any, where: str, name: str) -> ImuSpec:
    if not isinstance(content, Mapping):
        raise DataError(f"{where}: expected the groups gyro and accel, found {type(content).__name__}")
    if not set(content) - {"name"}:
        raise DataError(
            f"{where}: names no error of the IMU; expected the groups gyro and accel (a perfect IMU is ImuSpec())"
        )
    if set(KALIBR) <= set(content):
        return _from_kalibr(content, where, name)
    values: dict[str, Any] = {"name": str(content.get("name", name))}
    rest = content.get("unnamed", "usual")
    if rest not in ("usual", "zero"):
        raise DataError(
            f"{where}: unnamed: {rest!r}; expected usual or zero: what the terms are that the file does not name"
        )
    for group, entries in content.items():
        if group in ("name", "unnamed"):
            continue
        if group == "correlation_time":
            values[group] = _value(entries, CORRELATION_TIME, f"{where}: {group}")
            continue
        if group not in KEYS:
            raise DataError(unknown_key(where, str(group), [*KEYS, "name", "unnamed", "correlation_time"]))
        if not isinstance(entries, Mapping):
            raise DataError(
                f"{where}: {group}: expected keys such as {', '.join([*KEYS[group]][:3])}, found {entries!r}"
            )
        for key, text in entries.items():
            path = f"{group}.{key}"
            if key in KEYS[group]:
                values[f"{group}_{key}"] = _value(text, KEYS[group][key], f"{where}: {path}")
            elif key not in PLAIN[group]:
                raise DataError(unknown_key(where, path, [f"{group}.{k}" for k in (*KEYS[group], *PLAIN[group])]))
            elif key == "positions":
                values["accel_positions"] = _places(text, f"{where}: {path}")
            else:
                values[f"{group}_{key}"] = _order(text, f"{where}: {path}")
    return ImuSpec(**values, unsaid=() if rest == "zero" else unnamed(values))


def _value(text: Any, entry: Entry, where: str) -> float:
    value = quantity(text, entry.dimension, where)
    if not entry.allows(value):
        if entry.least == "zero":
            raise DataError(f"{where}: {text!r} is negative; expected a one-sigma value, zero or more")
        raise DataError(f"{where}: {text!r}; expected {WANTED[entry.least]}")
    if not entry.holds(value):
        raise DataError(f"{where}: {text!r}; expected {entry.range}: check its unit")
    return value


def _order(value: Any, where: str) -> int:
    if type(value) is not int or value not in (1, 2):
        raise DataError(f"{where}: {value!r}; expected 1 (one pole) or 2 (Butterworth)")
    return value


def _places(rows: Any, where: str) -> Any:
    """Three places of three lengths; the message names the row and column."""
    wanted = (
        "expected three places, of the x, y and z accelerometer, each [right, forward, up] such as [3 cm, 0 m, 0 m]"
    )
    if not isinstance(rows, list | tuple) or len(rows) != 3:
        raise DataError(f"{where}: {rows!r}; {wanted}")
    for i, row in enumerate(rows, 1):
        if not isinstance(row, list | tuple) or len(row) != 3:
            raise DataError(f"{where}[{i}]: {row!r}; {wanted}")
    return tuple(
        tuple(quantity(x, "length", f"{where}[{i}][{j}]") for j, x in enumerate(row, 1))
        for i, row in enumerate(rows, 1)
    )
