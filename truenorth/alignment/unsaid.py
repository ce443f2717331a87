"""A specification that does not name noise, a bias, its instability, a scale factor or a misalignment: they are not zero.

Allan's deviation and Kalibr give the noise of an IMU, a datasheet often bias and noise. What they leave out is taken for as large
as is usual of sensors with such noise, noise as of sensors with such a bias. Biases differ more from IMU to IMU than other errors:
they are as wide as sensors differ, and those of the gyros no wider than the log's mean rate about level axes lets them be. Of a
base that stays the log itself says how large its biases are (:mod:`truenorth.alignment.inference`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.inference import (
    ACCEL_WIDTH,
    GYRO_WIDTH,
    LEAST,
    WORST_ACCEL,
    WORST_GYRO,
    predictive_sigma,
)
from truenorth.alignment.usual import usual
from truenorth.core.earth import EARTH_RATE
from truenorth.records import ImuRecord
from truenorth.records.specified import lag
from truenorth.records.specs import PRESETS, ImuSpec, imu_spec
from truenorth.state.evidence import Evidence, note

Array = NDArray[np.float64]

TILTED = 1.0  # rad: by which a vehicle has turned about a level axis at the end of a log, at the most
LEANING = (
    0.1  # of the rate about the vertical, that a vehicle which leans or climbs sees about its level axes in the mean
)
USUAL_INTERVAL = 0.01  # s between samples, where their noise is given and no log
NOTHING = np.empty(0)


def completed(spec: ImuSpec, record: ImuRecord, *, stays: bool) -> tuple[ImuSpec | None, tuple[Evidence, ...]]:
    """What an alignment takes for a specification that does not name all, and what it says of that.

    Parameters
    ----------
    spec : ImuSpec
    record : ImuRecord
    stays : bool
        Whether of a base that stays: where no bias of the gyros is named the log says more than such a specification, and none is
        taken, but for one that knows lags or places.
    """
    known = lag(spec, "gyro") > 0.0 or lag(spec, "accel") > 0.0 or spec.accel_positions is not None
    if stays and "gyro_bias" in spec.still_unsaid and not known:
        return None, (note("specification.noise_alone", "specification", imu=spec.name),)
    found = as_usual(spec, record)
    return found, unsaid_evidence(found)


def as_usual(spec: ImuSpec, record: ImuRecord | None = None) -> ImuSpec:
    """The specification with what it does not name as large as it may be; its `unsaid` is what was put in so.

    Parameters
    ----------
    spec : ImuSpec
    record : ImuRecord, optional
        Whose mean rate about level axes bounds the gyros' biases.
    """
    if not spec.unsaid:
        return spec
    seen = spec.with_random_walks(USUAL_INTERVAL if record is None else record.interval)
    found: dict[str, Any] = {}
    for name in spec.still_unsaid:
        sensor, _, what = name.partition("_")
        found[name] = _usual(seen, sensor, what, record)
    return replace(spec, **found, unsaid=tuple(found))


def _usual(spec: ImuSpec, sensor: str, what: str, record: ImuRecord | None) -> float:
    if what == "random_walk":
        return _walk(spec, sensor)
    return _bias(spec, sensor, record) if what == "bias" else usual(sensor, what, _walk(spec, sensor))


def unsaid_evidence(spec: ImuSpec) -> tuple[Evidence, ...]:
    """What is taken for possible of each sensor of which not all is named; none where all is."""
    keys = {"gyro": "specification.gyro_unsaid", "accel": "specification.accel_unsaid"}
    return tuple(
        note(
            keys[sensor],
            "specification",
            imu=spec.name,
            bias=math.sqrt(spec.constant_variance[first]),
            scale=float(getattr(spec, f"{sensor}_scale_factor")),
            misalignment=float(getattr(spec, f"{sensor}_misalignment")),
        )
        for sensor, first in (("gyro", 0), ("accel", 3))
        if any(name.startswith(sensor) for name in spec.unsaid)
    )


def _bias(spec: ImuSpec, sensor: str, record: ImuRecord | None) -> float:
    """One sigma of the biases."""
    typical, least = (
        usual(sensor, "bias", _walk(spec, sensor)),
        LEAST * getattr(imu_spec("navigation"), f"{sensor}_bias"),
    )
    if sensor == "accel":
        return predictive_sigma(NOTHING, NOTHING, typical, ACCEL_WIDTH, least, WORST_ACCEL)
    rates, turns = (NOTHING, NOTHING) if record is None else _level_rates(record)
    return predictive_sigma(rates, turns, typical, GYRO_WIDTH, least, WORST_GYRO)


def _level_rates(record: ImuRecord) -> tuple[Array, Array]:
    """(2,) mean rates about right and forward, and what the vehicle's own turns may add to them, rad/s."""
    mean = np.mean(record.gyro, axis=0) / (record.interval if record.kind == "increments" else 1.0)
    turns = math.hypot(TILTED / record.duration, LEANING * float(mean[2]), EARTH_RATE)
    return mean[:2], np.full(2, turns)


def _walk(spec: ImuSpec, sensor: str) -> float:
    """The random walk; of a sensor without one that of the preset which is alike in its bias, or in the other sensor."""
    own = float(getattr(spec, f"{sensor}_random_walk"))
    other = "gyro" if sensor == "accel" else "accel"
    presets = [imu_spec(name) for name in PRESETS]
    walks = [getattr(preset, f"{sensor}_random_walk") for preset in presets]
    for alike in (f"{sensor}_bias", f"{other}_random_walk", f"{other}_bias"):
        if own == 0.0 and (value := _said(spec, alike)) > 0.0:
            sizes = np.log([getattr(preset, alike) for preset in presets])
            own = math.exp(float(np.interp(math.log(value), sizes, np.log(walks))))
    return own or walks[-1]  # of an IMU of which nothing is said the poorest


def _said(spec: ImuSpec, name: str) -> float:
    """What a specification says of a term, of a bias the part of each switch-on as well."""
    value = float(getattr(spec, name))
    return math.hypot(value, float(getattr(spec, name.replace("bias", "turn_on_bias")))) if "bias" in name else value
