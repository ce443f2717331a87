"""Errors of an IMU on ideal increments, term by term from its specification.

With x the true rate (specific force) as a mean over a sampling interval T, and dT the temperature above that of
calibration, the terms act in this order:

    s   = (I + S + M + c_S dT) x + A |x| + G f     scale factor, misalignment, asymmetry, g-sensitivity (gyros)
    d   = low pass and delay of s                  bandwidth, latency
    y   = d + b + b_on + c_b dT + b_GM + b_RRW     constant and turn-on bias, temperature, instability, rate random walk
            + (N/sqrt(T) + n) e                    random walk and sample noise, e white with variance 1
    out = quantised(saturated(y))                  range; whole steps, the residue carried on

The size effect comes before: it is in what each accelerometer senses. Noise and biases are those of the output, as on a
datasheet: the low pass does not touch them. The temperature is ``start + rate tau (1 - exp(-t/tau))`` from the beginning
of the log, taken at the middle of each interval. The range limits the mean over an interval.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.compiled import compiled
from truenorth.records.specs import ImuSpec
from truenorth.simulation.drift import Recursion, Wander, of_gauss_markov, of_random_walk, sense, with_errors
from truenorth.simulation.normals import BLOCK, Normals, draw, normals_at
from truenorth.simulation.response import respond
from truenorth.simulation.streams import STREAMS
from truenorth.simulation.true_errors import SensorErrors, TrueErrors, drawn_errors

Array = NDArray[np.float64]
# Of a sensor, besides the constant ones: noise, and how it responds.
TERMS = (
    "random_walk",
    "sample_noise",
    "bias_instability",
    "rate_random_walk",
    "bandwidth",
    "filter_order",
    "latency",
    "range",
    "quantisation",
)


def apply_errors(
    dtheta: Array,  # (N, 3) rad
    dvel: Array,  # (N, 3) m/s
    interval: float,  # s
    spec: ImuSpec,  # terms that are zero are left out
    *,
    seed: int,
    run: int = 0,
    scenario: int = 0,
    given: Mapping[str, ArrayLike] | None = None,  # see :func:`truenorth.simulation.true_errors.drawn_errors`
) -> tuple[Array, Array, TrueErrors]:
    """Ideal increments as the IMU of a specification would give them.

    Returns
    -------
    dtheta, dvel : (N, 3) arrays
    errors : TrueErrors
    """
    errors = drawn_errors(spec, seed=seed, run=run, scenario=scenario, given=given)
    count, steady = len(dtheta), spec.temperature_start == spec.temperature_rate == 0.0
    dT = None if steady else temperature(spec, interval, count)
    results = []
    for group, ideal in (("gyro", dtheta), ("accel", dvel)):

        def stream_of(term: str, group: str = group) -> Normals:
            return normals_at(seed, scenario, run, STREAMS[f"{group}_{term}"])

        own: SensorErrors = getattr(errors, group)
        value, recursions = _terms_of(spec, group, interval)
        bias, walk = own.constant_bias * interval, value["random_walk"] * math.sqrt(interval)
        warmth = dT if dT is not None and own.bias_temperature.any() and dT.any() else None
        terms = {(seed, scenario, run, number): recursion for number, recursion in recursions}
        wander = Wander(count, interval, terms, warmth, own.bias_temperature)
        late = math.isfinite(value["bandwidth"]) or value["latency"] != 0.0
        one = warmth is None and len(terms) == 1
        if one and own.is_linear and not late:
            sensed, matrix = np.ascontiguousarray(ideal), own.matrix
        else:
            sensed, matrix = np.empty_like(ideal), np.zeros((3, 3))
            warm = np.zeros(count) if dT is None else dT
            _sense(
                *(np.ascontiguousarray(x) for x in (ideal, dvel, warm, own.matrix, own.g_sensitivity)),
                own.scale_factor_temperature,
                own.scale_factor_asymmetry,
                sensed,
            )
            order = int(value["filter_order"])
            sensed = respond(sensed, interval, bandwidth=value["bandwidth"], order=order, latency=value["latency"])
        if one:
            ((numbers, recursion),) = terms.items()
            steps, white = normals_at(*numbers), stream_of("random_walk")
            out = with_errors(sensed, matrix, bias, recursion, steps, white, walk)
        else:
            out = sensed
            out += bias
            if wander:
                out += wander.integrals()
            if walk > 0.0:
                _make_noise(out.reshape(-1), stream_of("random_walk"), walk)
        if value["sample_noise"] > 0.0:
            _make_noise(out.reshape(-1), stream_of("sample_noise"), value["sample_noise"] * interval)
        full_scale, step = value["range"] * interval, value["quantisation"]
        if step > 0.0 or math.isfinite(full_scale):
            _put_out(out, full_scale, step)
        results.append((out, replace(own, wander=wander)))
    (gyro, gyro_errors), (accel, accel_errors) = results
    return gyro, accel, TrueErrors(gyro_errors, accel_errors)


def temperature(spec: ImuSpec, interval: float, count: int) -> Array:
    """(N,) temperature above that of calibration in the middle of each interval, K."""
    if spec.temperature_start == spec.temperature_rate == 0.0:
        return np.zeros(count)
    t = interval * (np.arange(count) + 0.5)
    tau = spec.temperature_time_constant
    since = t if math.isinf(tau) else -tau * np.expm1(-t / tau)
    return np.asarray(spec.temperature_start + spec.temperature_rate * since)


def size_effect(leverage: Array, spec: ImuSpec) -> Array:
    """What accelerometers sense compared with one in the centre, each by its own place, (N, 3) of the leverage (N, 3, 3)."""
    return np.einsum("kij,ij->ki", leverage, np.asarray(spec.accel_positions))


@lru_cache(maxsize=16)
def _terms_of(
    spec: ImuSpec, group: str, interval: float
) -> tuple[Mapping[str, float], tuple[tuple[int, Recursion], ...]]:
    """Terms of a group's noise and response by name, and of those that wander by themselves stream and recursion."""
    value = {term: float(getattr(spec, f"{group}_{term}")) for term in TERMS}
    found = {}
    if value["bias_instability"] > 0.0:
        found["bias_instability"] = of_gauss_markov(value["bias_instability"], spec.correlation_time, interval)
    if value["rate_random_walk"] > 0.0:
        found["rate_random_walk"] = of_random_walk(value["rate_random_walk"], interval)
    return value, tuple((STREAMS[f"{group}_{term}"], recursion) for term, recursion in found.items())


@compiled
def _sense(x: Any, f: Any, dT: Any, matrix: Any, G: Any, by_temperature: Any, asymmetry: Any, out: Any) -> None:
    """``(I + matrix + c dT) x + A |x| + G f``; everything as increments."""
    changes = False
    for i in range(3):
        changes |= by_temperature[i] != 0.0 or asymmetry[i] != 0.0
        for j in range(3):
            changes |= G[i, j] != 0.0
    if not changes:
        sense(x, matrix, out)
        return
    for k in range(len(x)):
        for i in range(3):
            total = (1.0 + by_temperature[i] * dT[k]) * x[k, i] + asymmetry[i] * abs(x[k, i])
            for j in range(3):
                total += matrix[i, j] * x[k, j] + G[i, j] * f[k, j]
            out[k, i] = total


@compiled
def _make_noise(out: Any, numbers: Normals, sigma: float) -> None:
    """Add white noise to (N,): the numbers that the generator's own method gives."""
    e = np.empty(BLOCK)
    for first in range(0, len(out), BLOCK):
        count = min(BLOCK, len(out) - first)
        draw(numbers, e[:count])
        for k in range(count):
            out[first + k] += e[k] * sigma


@compiled
def _put_out(out: Any, full_scale: float, step: float) -> None:
    """Limited to the full scale; then whole steps of the running sum: what a counter gives."""
    for i in range(3):
        total, counted = 0.0, 0.0
        for k in range(len(out)):
            y = min(max(out[k, i], -full_scale), full_scale)
            if step > 0.0:
                total += y
                count = np.floor(total / step)
                y = (count - counted) * step
                counted = count
            out[k, i] = y
