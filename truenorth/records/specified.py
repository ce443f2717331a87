"""What a specification says of a log beyond biases and noise: what is known is taken off, what is not counts.

**Known.** An output that is late by its latency and its low pass, and accelerometers that do not sit in one point. With ``w_c`` the
bandwidth in rad/s, a low pass of one pole delays what is slow by ``1/w_c``, Butterworth's two poles by ``sqrt(2)/w_c``. Stamps
become earlier by the larger lag of the two sensors, and the other sensor is read between its rows at those times. Of each
accelerometer what its own place adds is taken off,

    f_i -= [w x (w x r_i) + w' x r_i]_i        (size effect)

**Drawn, of which a log shows nothing by itself.** They have no states; the filters have them as what acts most alike:

| term | counts as |
| --- | --- |
| g-sensitivity G | a gyro bias ``G g``, and a random walk that reaches ``G max abs(integral (f - mean f) dt)`` at the end |
| asymmetry A of a scale factor | a scale factor; of a swing a bias ``A (mean abs(x) - abs(mean x))`` and such a walk, too |
| bias with temperature c | a bias ``c max abs(dT)``, and a walk of the bias that reaches ``c abs(dT_end - dT_begin)`` at the end |
| scale factor with temperature | a scale factor ``c max abs(dT)`` |

``dT = start + rate tau (1 - exp(-t/tau))`` above the temperature of calibration, t from the beginning of the log.

Sources: P. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed. (2013), sec. 4.4.4
(g-dependent errors) and 4.3 (size effect); A. Oppenheim and A. Willsky, *Signals and Systems*, 2nd ed. (1997), sec. 6.2 (group
delay). How the drawn terms count is ours.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.core.units import STANDARD_GRAVITY
from truenorth.records.calibration import Calibration
from truenorth.records.imu import ImuRecord
from truenorth.records.interpolation import held_at_ends
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]


def lag(spec: ImuSpec, sensor: str) -> float:
    """By which slow motion comes out late, s: latency, and the group delay of the low pass at frequency zero.

    Parameters
    ----------
    spec : ImuSpec
    sensor : {"gyro", "accel"}
    """
    bandwidth = 2.0 * math.pi * float(getattr(spec, f"{sensor}_bandwidth"))
    poles = int(getattr(spec, f"{sensor}_filter_order"))
    return float(getattr(spec, f"{sensor}_latency")) + math.sqrt(poles) / bandwidth


def corrected(record: ImuRecord, spec: ImuSpec | None, calibration: Calibration | None = None) -> ImuRecord:
    """The record as an IMU without its known errors would have made it.

    Parameters
    ----------
    record : ImuRecord
    spec : ImuSpec or None
        Lags of its sensors and places of its accelerometers; None: nothing is known of them.
    calibration : Calibration, optional
        Known biases, scale factors and misalignments, taken off first.

    Raises
    ------
    UsageError
        The calibration is none.
    """
    if calibration is not None:
        if not isinstance(calibration, Calibration):
            raise UsageError(
                f"calibration is {calibration!r}; expected a Calibration, such as Calibration.from_file('calibration.yaml')"
            )
        record = calibration.apply(record)
    return record if spec is None else _in_the_centre(at_its_time(record, spec), spec)


def at_its_time(record: ImuRecord, spec: ImuSpec) -> ImuRecord:
    """The record with stamps of when its sensors felt what they say."""
    lags = {sensor: lag(spec, sensor) for sensor in ("gyro", "accel")}
    late = max(lags.values())
    if late == 0.0:
        return record
    moved: dict[str, Any] = {}
    for sensor, own in lags.items():
        if own < late:  # what it read that much earlier
            moved[sensor] = held_at_ends(record.time, getattr(record, sensor), record.time - (late - own))
    return replace(record, time=record.time - late, **moved)


def epoch_felt(at: float, record: ImuRecord, spec: ImuSpec) -> float:
    """An epoch of a log whose sensors are late: after the last moment that they felt it is that moment."""
    last = float(record.time[-1])
    felt = last - max(lag(spec, "gyro"), lag(spec, "accel"))
    return felt if felt < at <= last else at


def _in_the_centre(record: ImuRecord, spec: ImuSpec) -> ImuRecord:
    """The record with the size effect of its accelerometers taken off."""
    if spec.accel_positions is None:
        return record
    T = record.steps[:, None] if record.kind == "increments" else np.ones((len(record), 1))
    w = record.gyro / T
    turning = np.gradient(w, record.time, axis=0)
    accel = record.accel.copy()
    for i, r in enumerate(np.asarray(spec.accel_positions)):
        accel[:, i] -= (T * (np.cross(w, np.cross(w, r)) + np.cross(turning, r)))[:, i]
    return replace(record, accel=accel)


def seen_in(spec: ImuSpec, record: ImuRecord) -> ImuSpec:
    """What a filter sees in a record: noise of samples, what scattered time stamps make of its motion, terms without a state."""
    counted = _as_forces_go(_as_turns_go(_as_warmth_goes(spec, record.duration), record), record)
    return counted.with_random_walks(record.interval).with_more_noise(*record.stamp_walks)


def _as_warmth_goes(spec: ImuSpec, duration: float) -> ImuSpec:
    if spec.temperature_start == spec.temperature_rate == 0.0:
        return spec
    tau = spec.temperature_time_constant
    since = duration if math.isinf(tau) else -tau * math.expm1(-duration / tau)
    change = spec.temperature_rate * since  # it goes one way
    most = max(abs(spec.temperature_start), abs(spec.temperature_start + change))
    walk = abs(change) / math.sqrt(duration)
    return replace(
        spec,
        gyro_turn_on_bias=math.hypot(spec.gyro_turn_on_bias, spec.gyro_bias_temperature * most),
        gyro_rate_random_walk=math.hypot(spec.gyro_rate_random_walk, spec.gyro_bias_temperature * walk),
        gyro_scale_factor=math.hypot(spec.gyro_scale_factor, spec.gyro_scale_factor_temperature * most),
        accel_turn_on_bias=math.hypot(spec.accel_turn_on_bias, spec.accel_bias_temperature * most),
        accel_rate_random_walk=math.hypot(spec.accel_rate_random_walk, spec.accel_bias_temperature * walk),
        accel_scale_factor=math.hypot(spec.accel_scale_factor, spec.accel_scale_factor_temperature * most),
        gyro_bias_temperature=0.0,
        gyro_scale_factor_temperature=0.0,
        accel_bias_temperature=0.0,
        accel_scale_factor_temperature=0.0,
    )


def _as_turns_go(spec: ImuSpec, record: ImuRecord) -> ImuSpec:
    if spec.gyro_scale_factor_asymmetry == spec.accel_scale_factor_asymmetry == 0.0:
        return spec
    T = record.interval if record.kind == "increments" else 1.0
    turn, force = (float(np.max(np.abs(x).mean(0) - np.abs(x.mean(0)))) / T for x in (record.gyro, record.accel))
    A_g, A_a = spec.gyro_scale_factor_asymmetry, spec.accel_scale_factor_asymmetry
    walks = A_g * _walk_of(np.abs(record.gyro), record), A_a * _walk_of(np.abs(record.accel), record)
    return replace(
        spec.with_more_noise(*walks),
        gyro_turn_on_bias=math.hypot(spec.gyro_turn_on_bias, A_g * turn),
        gyro_scale_factor=math.hypot(spec.gyro_scale_factor, A_g),
        gyro_scale_factor_asymmetry=0.0,
        accel_turn_on_bias=math.hypot(spec.accel_turn_on_bias, A_a * force),
        accel_scale_factor=math.hypot(spec.accel_scale_factor, A_a),
        accel_scale_factor_asymmetry=0.0,
    )


def _as_forces_go(spec: ImuSpec, record: ImuRecord) -> ImuSpec:
    G = spec.gyro_g_sensitivity
    if G == 0.0:
        return spec
    whole = spec.with_more_noise(G * _walk_of(record.accel, record), 0.0)
    return replace(whole, gyro_turn_on_bias=math.hypot(spec.gyro_turn_on_bias, G * STANDARD_GRAVITY))


def _walk_of(x: Array, record: ImuRecord) -> float:
    """Random walk that reaches at the end of a log what the integral of some columns less their means reaches at most."""
    T = 1.0 if record.kind == "increments" else record.interval
    gained = T * np.cumsum(x - x.mean(axis=0), axis=0)
    return float(np.linalg.norm(gained, axis=1).max()) / math.sqrt(record.duration)
