"""Simulated odometer: what a wheel counts while the body moves.

The wheel stands at a lever arm from the IMU and rolls along the vehicle's forward axis, which mounting angles turn from the IMU's.
Its speed is that axis times the velocity of the wheel's point over the ground; the distance of an interval is the integral of it by
quadrature, exact to rounding as the IMU's increments are. The wheel turns on while its messages are lost in an outage:
the distance of the rows that are missing is missing, and not in the row that follows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import UsageError
from truenorth.records import OdometerRecord
from truenorth.records.motion import MotionStates, Moving
from truenorth.records.unit_spec import value
from truenorth.simulation.aiding import (
    Aided,
    Draws,
    DroppingSpec,
    check_windows,
    kept,
    random_windows,
    velocity_b,
)
from truenorth.simulation.sensing import integrals

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class OdometerSpec(DroppingSpec[OdometerRecord]):
    """An odometer and its errors.

    Attributes
    ----------
    output : {"distance", "pulses", "speed"}
    scale : float
        Relative scale error, positive where too much is counted; `scale_sigma` draws another one on top.
    mounting : (2,) floats, rad
        Heading (clockwise) and pitch (nose up) of the vehicle's forward axis seen from the IMU's; `mounting_sigma` draws more.
    lever_arm : (3,) floats, m
        From the IMU to the wheel, IMU axes.
    pulse_size : float, m
        True distance of a pulse is ``pulse_size / (1 + scale)``; needed by pulses.
    noise : float, m/s
        White, of the (mean) speed of each sample.
    slips : tuple of (start, stop, size)
        Windows (s) in which the wheel counts ``1 + size`` times what it should; -1 is a wheel that is locked.
    slip_rate, slip_duration, slip_size : float, 1/s, s, 1
        More of them at random: mean number a second, length and size of each.
    lost : float
        Probability of a pulse to be lost.
    signed : bool
        Whether reverse driving counts negative; where not, each sample is the magnitude of its interval's.
    """

    sensor = "odometer"
    rate: float = value("frequency", "Hz", 10.0, sign="positive")
    output: Literal["distance", "pulses", "speed"] = "distance"
    scale: float = value("ratio", "%", sign="any")
    scale_sigma: float = value("ratio", "%")
    mounting: tuple[float, float] = value("angle angle", "deg deg", (0.0, 0.0), sign="any")
    mounting_sigma: float = value("angle", "deg")
    lever_arm: tuple[float, float, float] = value("length length length", "m m m", (0.0, 0.0, 0.0), sign="any")
    pulse_size: float = value("length", "m", 0.02, sign="positive")
    noise: float = value("speed", "m/s")
    slips: tuple[tuple[float, float, float], ...] = value("time time ratio", "s s %", (), sign="any", many=True)
    slip_rate: float = value("frequency", "Hz")
    slip_duration: float = value("time", "s", 1.5)
    slip_size: float = value("ratio", "%", 0.3, sign="any")
    lost: float = value("ratio", "%")
    signed: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_windows("slips", self.slips)
        if self.output not in ("distance", "pulses", "speed"):
            raise UsageError(f"output {self.output!r} is not known; use distance, pulses or speed")
        if self.lost > 1.0:
            raise UsageError(f"lost is {self.lost:g}; expected the part of pulses that is lost, 0 to 100 %")
        if self.lost > 0.0 and self.output != "pulses":
            raise UsageError(f"lost pulses, but the output is {self.output}; expected output pulses")

    def sense(self, body: Moving, times: Array, draws: Draws) -> Aided[OdometerRecord]:
        """An odometer that counts from the first time on.

        Errors ``scale, mounting (2,), phase`` (of the first pulse), ``slips`` (start, stop, size), ``lost`` (pulses a row),
        ``noise`` (m/s a row).
        """
        scale = self.scale + self.scale_sigma * draws("scale").standard_normal()
        mounting = np.asarray(self.mounting) + self.mounting_sigma * draws("mounting").standard_normal(2)
        drawn = random_windows(self.slip_rate, self.slip_duration, times, draws("slips"))
        slips = (*self.slips, *((*window, self.slip_size) for window in drawn))
        forward = dcm_from_euler(mounting[0], mounting[1], 0.0)[:, 1]

        def speed(at: MotionStates) -> Array:
            return velocity_b(at, self.lever_arm) @ forward

        noise = self.noise * draws("noise").standard_normal(len(times) - 1)
        there = kept(self, times[1:], draws)
        sampled = times[1:][there]
        stamps = sampled + self.latency
        errors = {"scale": scale, "mounting": mounting, "slips": slips, "noise": noise[there]}
        if self.output == "speed":
            values = speed(body.states(times[1:])) * (1.0 + scale) * _slipping(times[1:], slips) + noise
            values = values if self.signed else np.abs(values)
            return Aided(
                OdometerRecord(stamps, values[there], "speed", None, self.signed, "simulation"), sampled, errors
            )

        bounds = np.array([bound for slip in slips for bound in slip[:2] if times[0] < bound < times[-1]])
        finer = np.union1d(times, bounds)
        parts = integrals(body, finer, lambda at: speed(at)[..., None], 1)[:, 0] * _slipping(
            0.5 * (finer[1:] + finer[:-1]), slips
        )
        distance = (1.0 + scale) * np.add.reduceat(parts, np.searchsorted(finer, times[:-1])) + noise * np.diff(times)
        distance = distance if self.signed else np.abs(distance)
        if self.output == "distance":
            return Aided(
                OdometerRecord(stamps, distance[there], "distance", None, self.signed, "simulation"), sampled, errors
            )

        phase = draws("phase").random()
        pulses = np.diff(np.floor(np.cumsum(distance) / self.pulse_size + phase), prepend=0.0)
        lost = draws("lost").binomial(np.abs(pulses).astype(np.int64), self.lost)
        pulses -= np.sign(pulses) * lost
        record = OdometerRecord(stamps, pulses[there], "pulses", self.pulse_size, self.signed, "simulation")
        return Aided(record, sampled, errors | {"phase": phase, "lost": lost[there]})


def _slipping(times: Array, slips: tuple[tuple[float, float, float], ...]) -> Array:
    """What the wheel turns for each metre of ground, at some times."""
    factor = np.ones(len(times))
    for start, stop, size in slips:
        factor += np.where((times >= start) & (times < stop), size, 0.0)
    return factor
