"""IMU specifications: what a datasheet promises, one-sigma, in SI inside and in datasheet units in files.

A file holds two groups, each value with its unit:

    name: my IMU
    gyro: {bias: 0.01 deg/h, random_walk: 0.001 deg/sqrt(h), scale_factor: 5 ppm}
    accel: {bias: 50 ug, random_walk: 10 ug/sqrt(Hz)}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any

from truenorth.errors import DataError, UsageError
from truenorth.units import format as format_quantity
from truenorth.yaml_file import quantity, read_mapping, unknown_key


@dataclass(frozen=True)
class ImuSpec:
    """Errors of one IMU, one-sigma for each axis; zero where a datasheet is silent.

    Attributes
    ----------
    gyro_bias : float, rad/s
        What is left after calibration, from switch-on to switch-on.
    gyro_random_walk : float, rad/sqrt(s)
    gyro_bias_instability : float, rad/s
        Slow change of the bias in operation, a Gauss-Markov process.
    gyro_scale_factor, gyro_misalignment : float, 1 and rad
    gyro_quantisation : float, rad
        Size of one step of the output increment.
    gyro_range : float, rad/s
        Beyond it the output saturates; infinite where not given.
    accel_bias, accel_random_walk, accel_bias_instability : float, m/s^2, m/s/sqrt(s), m/s^2
    accel_scale_factor, accel_misalignment : float, 1 and rad
    accel_quantisation : float, m/s
    accel_range : float, m/s^2
    correlation_time : float, s
        Of the bias instabilities.
    name : str
    """

    gyro_bias: float = 0.0
    gyro_random_walk: float = 0.0
    gyro_bias_instability: float = 0.0
    gyro_scale_factor: float = 0.0
    gyro_misalignment: float = 0.0
    gyro_quantisation: float = 0.0
    gyro_range: float = float("inf")
    accel_bias: float = 0.0
    accel_random_walk: float = 0.0
    accel_bias_instability: float = 0.0
    accel_scale_factor: float = 0.0
    accel_misalignment: float = 0.0
    accel_quantisation: float = 0.0
    accel_range: float = float("inf")
    correlation_time: float = 300.0
    name: str = "custom"

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name == "name":
                continue
            positive = item.name in ("gyro_range", "accel_range", "correlation_time")
            if not (value > 0.0 if positive else 0.0 <= value < float("inf")):
                wanted = "a positive value" if positive else "zero or more, and finite"
                raise UsageError(f"IMU specification {self.name!r}: {item.name} is {value}; expected {wanted}")

    def to_mapping(self) -> dict[str, Any]:
        """The specification as it stands in a file; only what differs from zero or infinity."""
        result: dict[str, Any] = {"name": self.name}
        for group in ("gyro", "accel"):
            values = {
                key: format_quantity(getattr(self, f"{group}_{key}"), unit, digits=None)
                for key, (_, unit) in KEYS[group].items()
                if getattr(self, f"{group}_{key}") not in (0.0, float("inf"))
            }
            if values:
                result[group] = values
        if self.correlation_time < float("inf"):
            result["correlation_time"] = format_quantity(self.correlation_time, "s", digits=None)
        return result

    def to_yaml(self, path: str | PathLike[str]) -> None:
        """Write the specification as a file that `imu_spec` reads back.

        Raises
        ------
        UsageError
            The file cannot be written.
        """
        import yaml

        from truenorth.atomic import atomic_path

        with atomic_path(path) as temporary:
            temporary.write_text(yaml.safe_dump(self.to_mapping(), sort_keys=False, allow_unicode=True), "utf-8")


# Keys of a file with their dimension and the unit they are written in.
KEYS: dict[str, dict[str, tuple[str, str]]] = {
    "gyro": {
        "bias": ("angular_rate", "deg/h"),
        "random_walk": ("angle_random_walk", "deg/sqrt(h)"),
        "bias_instability": ("angular_rate", "deg/h"),
        "scale_factor": ("ratio", "ppm"),
        "misalignment": ("angle", "arcsec"),
        "quantisation": ("angle", "arcsec"),
        "range": ("angular_rate", "deg/s"),
    },
    "accel": {
        "bias": ("acceleration", "ug"),
        "random_walk": ("velocity_random_walk", "ug/sqrt(Hz)"),
        "bias_instability": ("acceleration", "ug"),
        "scale_factor": ("ratio", "ppm"),
        "misalignment": ("angle", "arcsec"),
        "quantisation": ("speed", "m/s"),
        "range": ("acceleration", "g"),
    },
}

PRESETS: dict[str, dict[str, Any]] = {
    "navigation": {
        "gyro": {
            "bias": "0.01 deg/h",
            "random_walk": "0.001 deg/sqrt(h)",
            "bias_instability": "0.001 deg/h",
            "scale_factor": "5 ppm",
            "misalignment": "2 arcsec",
        },
        "accel": {
            "bias": "50 ug",
            "random_walk": "10 ug/sqrt(Hz)",
            "bias_instability": "5 ug",
            "scale_factor": "50 ppm",
            "misalignment": "5 arcsec",
        },
    },
    "tactical": {
        "gyro": {
            "bias": "1 deg/h",
            "random_walk": "0.05 deg/sqrt(h)",
            "bias_instability": "0.3 deg/h",
            "scale_factor": "150 ppm",
            "misalignment": "60 arcsec",
        },
        "accel": {
            "bias": "1 mg",
            "random_walk": "50 ug/sqrt(Hz)",
            "bias_instability": "50 ug",
            "scale_factor": "300 ppm",
            "misalignment": "60 arcsec",
        },
    },
    "industrial": {
        "gyro": {
            "bias": "100 deg/h",
            "random_walk": "0.3 deg/sqrt(h)",
            "bias_instability": "5 deg/h",
            "scale_factor": "1000 ppm",
            "misalignment": "3 arcmin",
        },
        "accel": {
            "bias": "8 mg",
            "random_walk": "100 ug/sqrt(Hz)",
            "bias_instability": "100 ug",
            "scale_factor": "1000 ppm",
            "misalignment": "3 arcmin",
        },
    },
    "consumer": {
        "gyro": {
            "bias": "1000 deg/h",
            "random_walk": "1 deg/sqrt(h)",
            "bias_instability": "30 deg/h",
            "scale_factor": "1 %",
            "misalignment": "30 arcmin",
        },
        "accel": {
            "bias": "30 mg",
            "random_walk": "300 ug/sqrt(Hz)",
            "bias_instability": "300 ug",
            "scale_factor": "1 %",
            "misalignment": "30 arcmin",
        },
    },
}


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
        return _from_mapping(PRESETS[source], source, source)
    path = Path(source)
    if not path.is_file():
        near = get_close_matches(str(source), PRESETS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        presets = ", ".join(PRESETS)
        raise UsageError(
            f"IMU specification {str(source)!r} is neither a preset ({presets}) nor a file that can be read{hint}"
        )
    return _from_mapping(read_mapping(path), str(path), path.stem)


def _from_mapping(content: Any, where: str, name: str) -> ImuSpec:
    if not isinstance(content, Mapping):
        raise DataError(f"{where}: expected the groups gyro and accel, found {type(content).__name__}")
    values: dict[str, Any] = {"name": str(content.get("name", name))}
    for group, entries in content.items():
        if group == "name":
            continue
        if group == "correlation_time":
            values[group] = _sigma(entries, "time", f"{where}: {group}")
            continue
        if group not in KEYS:
            raise DataError(unknown_key(where, str(group), [*KEYS, "name", "correlation_time"]))
        if not isinstance(entries, Mapping):
            raise DataError(f"{where}: {group}: expected keys such as bias and random_walk, found {entries!r}")
        for key, text in entries.items():
            if key not in KEYS[group]:
                raise DataError(unknown_key(where, f"{group}.{key}", [f"{group}.{k}" for k in KEYS[group]]))
            values[f"{group}_{key}"] = _sigma(text, KEYS[group][key][0], f"{where}: {group}.{key}")
    try:
        return ImuSpec(**values)
    except UsageError as error:
        raise DataError(f"{where}: {error}") from None


def _sigma(text: Any, dimension: str, where: str) -> float:
    value = quantity(text, dimension, where)
    if value < 0.0:
        raise DataError(f"{where}: {text!r} is negative; expected a one-sigma value, zero or more")
    return value
