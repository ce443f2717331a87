"""Are the sensors on a swaying base as quiet as their specification? By the likelihood of the whole log.

Their white noise is under the sway, and the fit of the base's motion takes up what it makes of the velocity: white motion, or
a slow oscillator. So the log is filtered again with noisier sensors, with the motion as fitted and with what remains of it
without these. Velocity that wanders as ``t^(1/2)`` and ``g t^(3/2)`` is no motion of a base that stays.

So does a bias that changes: what it explains, by the quiet sensors' filter, is no sign of noise.

White noise is as dense above the sway as under it. Where a sensor is as quiet as specified there, between the lines of an engine,
too, what is slow and louder is a motion that the fit has missed: a ship at her moorings goes to and fro in many tones.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.slow_sway import is_slow
from truenorth.errors.staying import QUIETEST_BASE, StaticModel
from truenorth.errors.sway import AxisMotion, with_motion
from truenorth.estimate.staying import StayingLog
from truenorth.filters import LinearSystem, kalman
from truenorth.quality.density import noise_densities, noise_evidence
from truenorth.quality.floor import FASTEST, white_floor
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit

Array = NDArray[np.float64]

# Of the random walks as specified: below, at and above those of another sensor
FACTORS = tuple(k * limit("another sensor") for k in (0.5, 1.0, 2.0, 4.0, 8.0))
SENSORS = ("accel", "gyro")
NEAR_SWAY = 0.125  # of the highest frequency


def louder_walks(noise: StaticModel, factors: Mapping[str, float]) -> StaticModel:
    """Noise with the random walks of each sensor so many times as large."""
    walks = {name: factors.get(name.split("_")[0], 1.0) * value for name, value in asdict(noise).items()}
    return replace(noise, **walks)


def is_louder(noise: StaticModel, usual: StaticModel) -> bool:
    """Whether a sensor's random walk is another sensor's than the usual one."""
    walks = ("gyro_random_walk", "accel_random_walk")
    return any(getattr(noise, walk) > limit("another sensor") * getattr(usual, walk) for walk in walks)


def noisier_sensors(
    log: StayingLog, motion: Sequence[AxisMotion], interval: float, begun: Callable[[LinearSystem], float]
) -> dict[str, float]:
    """How many times noisier than specified a sensor is, where the log rules out less than ``limit("another sensor")`` times.

    Parameters
    ----------
    log : StayingLog
        About the last estimate; its noise is that of the specification.
    motion : three AxisMotion
        Of the base, as fitted with that noise.
    interval : float, s
        Of the filter.
    begun : callable
        Twice the logarithm of the likelihood ratio by which a bias that changes explains the log better, of a system with the
        noise and the motion of sensors that are quiet.
    """
    seen = _loud_above_sway(log)
    duration = float(log.integrals.time[-1])
    steady = [
        AxisMotion(QUIETEST_BASE, tuple(item for item in axis.oscillators if not is_slow(item, duration)))
        for axis in motion
    ]
    if all(axis == other for axis, other in zip(motion, steady, strict=True)):
        return {}  # no motion that noise could hide in

    def tried(sensor: str, factor: float) -> tuple[float, LinearSystem]:
        """Twice the logarithm of the likelihood, of the better of both motions, and the system with that."""
        other = copy.copy(log)
        other.noise = louder_walks(log.noise, {sensor: factor})
        system = other.linearise()
        both = (motion,) if factor == 1.0 else (motion, steady)
        systems = [with_motion(system, interval, m, spare=False) for m in both]
        found = [2.0 * float(kalman(item).log_likelihood) for item in systems]
        best = int(np.argmax(found))
        return found[best], systems[best]

    def explained(quiet: tuple[float, LinearSystem]) -> float:
        return quiet[0] + begun(quiet[1])

    suspects = [sensor for sensor in SENSORS if seen[sensor] * limit("one noise") >= limit("another sensor")]
    if not suspects:
        return {}
    as_said = tried(SENSORS[0], 1.0)
    found = {}
    for sensor in suspects:
        scattered = tried(sensor, FACTORS[0])  # as sensors of one datasheet do
        factor = FACTORS[1]
        best, _ = tried(sensor, factor)
        if best - max(as_said[0], scattered[0]) <= limit("drift"):
            continue
        for more in FACTORS[2:]:
            better, _ = tried(sensor, more)
            if better < best:
                break
            best, factor = better, more
        if best > max(explained(as_said), explained(scattered)):
            found[sensor] = factor
    return found


def _loud_above_sway(log: StayingLog) -> dict[str, float]:
    """How many times louder than specified each sensor is above the sway; infinite where too few rows show it.

    Of channels that do not look white there, by the floor between the lines of what shakes them: near the sway, since above it a
    filter in the device may take noise away, and rounding adds to it.
    """
    white = white_above_sway(log)
    if white is not None:
        return white
    near, all_through = (white_floor(log.record, fastest) for fastest in (NEAR_SWAY, FASTEST))
    return _times_said(log, np.nan_to_num(np.where(np.isfinite(near), near, all_through), nan=math.inf))


def white_above_sway(log: StayingLog) -> dict[str, float] | None:
    """How many times louder than specified each sensor is above the sway, if all channels look white there."""
    _, density = noise_densities(log.record)
    if not np.isfinite(density).any(axis=0).all():
        return None
    return _times_said(log, np.nanmedian(density, axis=0))


def _times_said(log: StayingLog, density: Array) -> dict[str, float]:
    """Of densities (6,), by the worst axis of each sensor; zero where no noise was said, of which nothing is a multiple."""
    said = {sensor: getattr(log.noise, f"{sensor}_random_walk") for sensor in SENSORS}
    loud = {"gyro": float(density[:3].max()), "accel": float(density[3:].max())}
    return {sensor: loud[sensor] / said[sensor] if said[sensor] > 0.0 else 0.0 for sensor in SENSORS}


def sway_noise_evidence(noisier: Mapping[str, float], spec: ImuSpec, lat: float) -> list[Evidence]:
    """That it is another sensor's specification, and what that does to heading and level."""
    return [
        noise_evidence(name, factor * getattr(spec, f"{name}_random_walk"), spec, lat)
        for name, factor in noisier.items()
    ]
