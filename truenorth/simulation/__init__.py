"""Simulation: the truth and the measurements of a known motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.errors import UsageError
from truenorth.records import ImuRecord
from truenorth.simulation.imu_errors import TrueErrors, apply_errors
from truenorth.simulation.motion import Motion, MotionStates
from truenorth.simulation.sway import Disturbed, Sway, rest
from truenorth.simulation.tones import Tone
from truenorth.specs import ImuSpec

__all__ = [
    "Disturbed",
    "IdealLog",
    "Motion",
    "MotionStates",
    "Simulation",
    "Sway",
    "Tone",
    "TrueErrors",
    "ideal_log",
    "rest",
    "simulate",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class IdealLog:
    """Ideal increments of a motion; made once, shared by any number of runs.

    Attributes
    ----------
    motion : Motion
    edges : (N+1,) array, s
    dtheta, dvel : (N, 3) arrays, rad and m/s
    """

    motion: Motion
    edges: Array
    dtheta: Array
    dvel: Array

    @property
    def interval(self) -> float:
        """Sampling interval, s."""
        return float(self.edges[1] - self.edges[0])


@dataclass(frozen=True)
class Simulation:
    """A simulated log beside its truth.

    Attributes
    ----------
    record : ImuRecord
    motion : Motion
        The truth at any time: ``motion.states(t)``.
    errors : TrueErrors
    """

    record: ImuRecord
    motion: Motion
    errors: TrueErrors

    @property
    def truth(self) -> MotionStates:
        """The true motion at the sample times."""
        return self.motion.states(self.record.time)


def ideal_log(motion: Motion, *, rate: float, duration: float, start: float = 0.0) -> IdealLog:
    """Increments of an ideal IMU.

    Raises
    ------
    UsageError
        A rate or duration that is not positive, or fewer than two samples.
    """
    if not (rate > 0 and duration > 0 and rate * duration >= 2):
        raise UsageError(f"rate {rate:g} Hz over {duration:g} s; expected both positive and two samples at least")
    edges = start + np.arange(round(duration * rate) + 1) / rate
    return IdealLog(motion, edges, *motion.increments(edges))


def simulate(
    motion: Motion | IdealLog,
    *,
    rate: float = 100.0,
    duration: float = 600.0,
    start: float = 0.0,
    imu: ImuSpec | None = None,
    seed: int = 0,
    run: int = 0,
    scenario: int = 0,
    kind: Literal["increments", "rates"] = "increments",
) -> Simulation:
    """Simulate the log of an IMU.

    Parameters
    ----------
    motion : Motion or IdealLog
        An ideal log that was made before saves its time; it brings its own rate, duration and start.
    rate : float, Hz
    duration : float, s
    start : float, s
    imu : ImuSpec, optional
        Its errors are drawn; an ideal IMU when left out.
    seed, run, scenario : int
        The same three give the same bits.
    kind : {"increments", "rates"}
        Rates are instantaneous, the errors those of the increments divided by the interval.

    Returns
    -------
    Simulation
    """
    ideal = motion if isinstance(motion, IdealLog) else ideal_log(motion, rate=rate, duration=duration, start=start)
    interval, times = ideal.interval, ideal.edges[1:]
    dtheta, dvel = ideal.dtheta, ideal.dvel
    if kind == "rates":
        at = ideal.motion.states(times)
        dtheta, dvel = at.w_ib_b * interval, at.f_b * interval
    dtheta, dvel, errors = apply_errors(dtheta, dvel, interval, imu or ImuSpec(), seed=seed, run=run, scenario=scenario)
    scale = interval if kind == "rates" else 1.0
    record = ImuRecord(times, dtheta / scale, dvel / scale, kind, "simulation")
    return Simulation(record, ideal.motion, errors)
