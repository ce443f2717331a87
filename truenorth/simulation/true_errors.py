"""The errors that one IMU really has: drawn from its specification, or given.

A study that wants certain errors (a paper's biases with their signs, the worst case) gives them by name in place of their
draws; all that is not given is drawn as ever. In files they stand in datasheet units:

    gyro: {bias: [0.01 deg/h, -0.01 deg/h, 0.03 deg/h]}
    accel: {bias: 100 ug, misalignment: [[0 arcsec, 5 arcsec, 0 arcsec], ...]}

where one value means all three axes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.yaml_file import quantity, unknown_key
from truenorth.records.spec_keys import KEYS
from truenorth.records.specs import ImuSpec
from truenorth.simulation.drift import Wander
from truenorth.simulation.normals import first_normals
from truenorth.simulation.streams import STREAMS

Array = NDArray[np.float64]
GROUPS = ("gyro", "accel")
SHAPES: dict[str, tuple[int, ...]] = {
    "bias": (3,),
    "turn_on_bias": (3,),
    "scale_factor": (3,),
    "scale_factor_asymmetry": (3,),
    "misalignment": (3, 3),
    "g_sensitivity": (3, 3),
    "bias_temperature": (3,),
    "scale_factor_temperature": (3,),
}
MOST = max(math.prod(shape) for shape in SHAPES.values())  # numbers of a term


@dataclass(frozen=True, eq=False)
class SensorErrors:
    """Errors of the three gyros, or of the three accelerometers; measured minus true, SI.

    Attributes
    ----------
    bias, turn_on_bias : (3,) arrays
    scale_factor, scale_factor_asymmetry : (3,) arrays
    misalignment : (3, 3) array, rad
        Its diagonal is zero.
    g_sensitivity : (3, 3) array
        Gyros to specific force; zero for accelerometers.
    bias_temperature, scale_factor_temperature : (3,) arrays
        Per kelvin.
    wander : Wander or None
        What wanders on top of the constant bias: instability, rate random walk, temperature.
    """

    bias: Array
    turn_on_bias: Array
    scale_factor: Array
    scale_factor_asymmetry: Array
    misalignment: Array
    g_sensitivity: Array
    bias_temperature: Array
    scale_factor_temperature: Array
    wander: Wander | None = field(default=None, repr=False)

    @cached_property
    def drift(self) -> Array | None:
        """(N, 3) mean of what wanders over each interval, drawn again where it is asked for; None where nothing does."""
        return self.wander.integrals() / self.wander.interval if self.wander else None

    @property
    def constant_bias(self) -> Array:
        """(3,) all of the bias that does not change in a run."""
        return self.bias + self.turn_on_bias

    @property
    def is_linear(self) -> bool:
        """Whether a sensor is a matrix and a bias: neither temperature nor sign nor, of a gyro, force changes what it gives."""
        return not (
            self.scale_factor_temperature.any() or self.scale_factor_asymmetry.any() or self.g_sensitivity.any()
        )

    @property
    def matrix(self) -> Array:
        """(3, 3) scale factors and misalignments, ``measured = (I + matrix) true``."""
        return self.misalignment + np.diag(self.scale_factor)


@dataclass(frozen=True, eq=False)
class TrueErrors:
    """The errors of one run.

    Attributes
    ----------
    gyro, accel : SensorErrors
    """

    gyro: SensorErrors
    accel: SensorErrors

    @property
    def gyro_bias(self) -> Array:
        """(3,) rad/s, constant in the run."""
        return self.gyro.constant_bias

    @property
    def accel_bias(self) -> Array:
        """(3,) m/s^2, constant in the run."""
        return self.accel.constant_bias

    @property
    def gyro_matrix(self) -> Array:
        """(3, 3) scale factors and misalignments of the gyros."""
        return self.gyro.matrix

    @property
    def accel_matrix(self) -> Array:
        """(3, 3) scale factors and misalignments of the accelerometers."""
        return self.accel.matrix

    def constants(self) -> dict[str, Array]:
        """By name (``gyro_bias`` ..), those that are not zero: what :func:`drawn_errors` takes as given."""
        return {
            f"{group}_{term}": value
            for group in ("gyro", "accel")
            for term in SHAPES
            if np.any(value := getattr(getattr(self, group), term))
        }


def drawn_errors(
    spec: ImuSpec, *, seed: int, run: int = 0, scenario: int = 0, given: Mapping[str, ArrayLike] | None = None
) -> TrueErrors:
    """The constant errors of one run.

    Parameters
    ----------
    given : mapping, optional
        Values in SI that stand in place of their draws, by name: ``{"gyro_bias": (1e-7, -1e-7, 2e-7)}``; one number
        means all three axes.

    Raises
    ------
    UsageError
        A name that is not known, or a value of another shape.
    """
    values: dict[str, Array] = {}
    if given:
        known = [f"{group}_{term}" for group in GROUPS for term in SHAPES if term in KEYS[group]]
        values = {name: _given(name, value, known) for name, value in given.items()}
    terms: dict[str, dict[str, Any]] = {group: {} for group in GROUPS}
    drawn = [name for _, _, name, sigma in _sigmas_of(spec) if name not in values and sigma != 0.0]
    numbers = first_normals(MOST, [STREAMS[name] for name in drawn], seed, scenario, run) if drawn else np.empty((0, 0))
    normals = dict(zip(drawn, numbers, strict=True))
    for group, term, name, sigma in _sigmas_of(spec):
        shape = SHAPES[term]
        if name in values:
            terms[group][term] = values[name]
        elif sigma == 0.0:
            terms[group][term] = np.zeros(shape)
        else:
            terms[group][term] = draw = sigma * normals[name][: math.prod(shape)].reshape(shape)
            if term == "misalignment":
                draw.reshape(-1)[:: shape[1] + 1] = 0.0
    return TrueErrors(*(SensorErrors(**terms[group]) for group in GROUPS))


@lru_cache(maxsize=16)
def _sigmas_of(spec: ImuSpec) -> tuple[tuple[str, str, str, float], ...]:
    """Group, term, name and one sigma of all that is constant in a run."""
    return tuple(
        (group, term, name, getattr(spec, name, 0.0))
        for group in GROUPS
        for term in SHAPES
        for name in (f"{group}_{term}",)
    )


def _given(name: str, value: ArrayLike, known: list[str]) -> Array:
    if name not in known:
        near = get_close_matches(name, known, n=1)
        raise UsageError(f"errors: {name!r} is not known; {f'did you mean {near[0]!r}?' if near else ', '.join(known)}")
    group, _, term = name.partition("_")
    shape = SHAPES[term]
    array = np.asarray(value, dtype=np.float64)
    if array.shape == () and len(shape) == 1:
        array = np.full(shape, float(array))
    if array.shape != shape or not np.all(np.isfinite(array)):
        raise UsageError(f"errors: {name} is {value!r}; expected {' x '.join(map(str, shape))} finite numbers in SI")
    if term == "misalignment" and np.any(np.diag(array)):
        raise UsageError(
            f"errors: {name} has a diagonal; expected zeros there, and what it holds in {group}_scale_factor"
        )
    return array


def given_errors(content: Any, where: str = "errors") -> dict[str, Array]:
    """Given values in SI from what a file holds in datasheet units.

    Parameters
    ----------
    content : mapping
        The groups ``gyro`` and ``accel`` of a specification; each value one quantity, three, or three rows of three.
    where : str
        Leads the messages.

    Returns
    -------
    dict
        For the argument `given` of :func:`drawn_errors`, `errors` of :func:`truenorth.simulate`.

    Raises
    ------
    DataError
        An unknown key, a wrong unit or a wrong number of values; the message names the key's path.
    """
    wanted = "expected the groups gyro and accel, such as gyro: {bias: [0.01 deg/h, -0.01 deg/h, 0.01 deg/h]}"
    if not isinstance(content, Mapping):
        raise DataError(f"{where}: {content!r}; {wanted}")
    result = {}
    for group, entries in content.items():
        if group not in ("gyro", "accel"):
            raise DataError(unknown_key(where, group, ["gyro", "accel"]))
        if not isinstance(entries, Mapping):
            raise DataError(f"{where}.{group}: {entries!r}; {wanted}")
        known = [term for term in SHAPES if term in KEYS[group]]
        for term, value in entries.items():
            if term not in known:
                raise DataError(unknown_key(where, f"{group}.{term}", [f"{group}.{x}" for x in known]))
            path, dimension = f"{where}: {group}.{term}", KEYS[group][term].dimension
            array = np.array(_quantities(value, SHAPES[term], dimension, path))
            try:
                result[f"{group}_{term}"] = _given(f"{group}_{term}", array, [f"{group}_{term}"])
            except UsageError as error:
                raise DataError(f"{where}: {str(error).removeprefix('errors: ')}") from None
    return result


def _quantities(value: Any, shape: tuple[int, ...], dimension: str, path: str) -> Any:
    if not shape:
        return quantity(value, dimension, path)
    if not isinstance(value, list | tuple):
        if len(shape) == 1:
            return [quantity(value, dimension, path)] * shape[0]
        raise DataError(f"{path}: {value!r}; expected {shape[0]} rows of {shape[1]}")
    if len(value) != shape[0]:
        raise DataError(f"{path}: {len(value)} values; expected {shape[0]}")
    return [_quantities(item, shape[1:], dimension, f"{path}[{i}]") for i, item in enumerate(value, 1)]
