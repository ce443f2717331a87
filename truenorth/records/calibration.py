"""A known calibration, taken off a log before anything else.

``measured = (I + S + M) true + bias`` for gyros and accelerometers alike: `S` diagonal (scale factors), `M` off-diagonal
(small angles by which the sensitive axes miss the body's). In a file:

    gyro: {bias: [1.2 deg/h, -0.4 deg/h, 0 deg/h], scale_factor: [100 ppm, 0 ppm, -50 ppm]}
    accel: {bias: [1 mg, 0 mg, 2 mg], misalignment: [[0 arcsec, 20 arcsec, 0 arcsec], ...]}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.yaml_file import quantity, read_mapping, unknown_key
from truenorth.records import ImuRecord

Array = NDArray[np.float64]

SHAPES = {"bias": (3,), "scale_factor": (3,), "misalignment": (3, 3)}
DIMENSIONS = {
    "gyro": {"bias": "angular_rate", "scale_factor": "ratio", "misalignment": "angle"},
    "accel": {"bias": "acceleration", "scale_factor": "ratio", "misalignment": "angle"},
}


@dataclass(frozen=True)
class Calibration:
    """Known errors of an IMU, body axes of the record they are applied to.

    Attributes
    ----------
    gyro_bias, accel_bias : (3,) arrays, rad/s and m/s^2
    gyro_scale_factor, accel_scale_factor : (3,) arrays
    gyro_misalignment, accel_misalignment : (3, 3) arrays, rad
        Row i, column j: how much of axis j sensor i sees; the diagonal is zero.
    """

    gyro_bias: Array = field(default_factory=lambda: np.zeros(3))
    gyro_scale_factor: Array = field(default_factory=lambda: np.zeros(3))
    gyro_misalignment: Array = field(default_factory=lambda: np.zeros((3, 3)))
    accel_bias: Array = field(default_factory=lambda: np.zeros(3))
    accel_scale_factor: Array = field(default_factory=lambda: np.zeros(3))
    accel_misalignment: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        for group in DIMENSIONS:
            for key, shape in SHAPES.items():
                name = f"{group}_{key}"
                value = np.asarray(getattr(self, name), dtype=np.float64)
                if value.shape != shape or not np.all(np.isfinite(value)):
                    raise UsageError(f"calibration: {name} has shape {value.shape}; expected finite numbers, {shape}")
                if key == "misalignment" and np.any(np.diag(value) != 0.0):
                    raise UsageError(f"calibration: {name} has a diagonal; what belongs there is scale_factor")
                object.__setattr__(self, name, value)
        for group in DIMENSIONS:
            matrix = getattr(self, f"{group}_matrix")
            if not np.linalg.det(matrix) > 0.5:  # 1 for an ideal IMU; at zero nothing could be undone
                raise UsageError(f"calibration: the {group} errors are as large as what is measured: {matrix.tolist()}")

    @property
    def gyro_matrix(self) -> Array:
        """(3, 3) ``I + S + M`` of the gyros."""
        return np.eye(3) + np.diag(self.gyro_scale_factor) + self.gyro_misalignment

    @property
    def accel_matrix(self) -> Array:
        """(3, 3) ``I + S + M`` of the accelerometers."""
        return np.eye(3) + np.diag(self.accel_scale_factor) + self.accel_misalignment

    @classmethod
    def from_file(cls, path: str | PathLike[str]) -> Calibration:
        """Read a YAML file of datasheet quantities.

        Raises
        ------
        UsageError
            No such file.
        DataError
            An unknown key, a wrong unit or shape; the message names file and key.
        """
        file = Path(path)
        values: dict[str, Array] = {}
        for group, entries in read_mapping(file).items():
            if group not in DIMENSIONS:
                raise DataError(unknown_key(str(file), group, DIMENSIONS))
            if not isinstance(entries, Mapping):
                raise DataError(f"{file}: {group}: expected keys such as bias and scale_factor, found {entries!r}")
            for key, value in entries.items():
                if key not in SHAPES:
                    raise DataError(unknown_key(str(file), f"{group}.{key}", [f"{group}.{k}" for k in SHAPES]))
                values[f"{group}_{key}"] = _array(value, SHAPES[key], DIMENSIONS[group][key], f"{file}: {group}.{key}")
        try:
            return cls(**values)
        except UsageError as error:
            raise DataError(f"{file}: {error}") from None

    def apply(self, record: ImuRecord) -> ImuRecord:
        """The record as an IMU without these errors would have made it."""
        T = record.steps[:, None] if record.kind == "increments" else 1.0
        gyro = _corrected(record.gyro, T * self.gyro_bias, self.gyro_matrix)
        accel = _corrected(record.accel, T * self.accel_bias, self.accel_matrix)
        return ImuRecord(record.time, gyro, accel, record.kind, record.source)


def _corrected(measured: Array, bias: Array, matrix: Array) -> Array:
    return np.asarray(np.linalg.solve(matrix, (measured - bias).T).T, dtype=np.float64)


def _array(value: Any, shape: tuple[int, ...], dimension: str, where: str) -> Array:
    def parsed(item: Any) -> Any:
        if isinstance(item, list):
            return [parsed(part) for part in item]
        return quantity(item, dimension, where)

    quantities = parsed(value)
    try:
        result = np.array(quantities, dtype=np.float64)
    except ValueError:
        raise DataError(f"{where}: the rows differ in length; expected shape {shape}") from None
    if result.shape != shape:
        raise DataError(f"{where}: shape {result.shape}; expected {shape}, such as one quantity an axis in brackets")
    return result
