"""The log of an ideal IMU, made once and shared by any number of runs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.records.motion import Moving
from truenorth.simulation.sensing import MOST_SAMPLES, acceleration_gain, increments, leverage

Array = NDArray[np.float64]


@dataclass(frozen=True)
class IdealLog:
    """Ideal increments of a motion; made once, shared by any number of runs.

    Attributes
    ----------
    motion : Motion or Indexed
    edges : (N+1,) array, s
    dtheta, dvel : (N, 3) arrays, rad and m/s
    """

    motion: Moving
    edges: Array
    dtheta: Array
    dvel: Array

    @property
    def interval(self) -> float:
        """Sampling interval, s."""
        return float(self.edges[1] - self.edges[0])

    @cached_property
    def times(self) -> Array:
        """(N,) ends of the intervals, s; records take it as it is."""
        times = self.edges[1:].copy()
        times.flags.writeable = False
        return times

    @cached_property
    def rates(self) -> tuple[Array, Array]:
        """Instantaneous rate and specific force at the end of each interval, (N, 3) rad/s and m/s^2."""
        at = self.motion.states(self.edges[1:])
        return at.w_ib_b, at.f_b

    @cached_property
    def leverage(self) -> Array:
        """(N, 3, 3) 1/s: velocity increment sensed at a place of the IMU compared with that in its centre, per metre."""
        return leverage(self.motion, self.edges)

    @cached_property
    def leverage_rates(self) -> Array:
        """(N, 3, 3) 1/s^2: the same for the specific force at the end of each interval."""
        return acceleration_gain(self.motion.states(self.edges[1:]))


def ideal_log(motion: Moving, *, rate: float, duration: float, start: float = 0.0) -> IdealLog:
    """Increments of an ideal IMU.

    Parameters
    ----------
    motion : Motion or Indexed
    rate : float, Hz
    duration, start : float, s

    Raises
    ------
    UsageError
        A rate or duration that is not positive, or fewer than two samples.
    """
    if not (rate > 0 and duration > 0 and rate * duration >= 2):
        raise UsageError(f"rate {rate:g} Hz over {duration:g} s; expected both positive and two samples at least")
    if rate * duration > MOST_SAMPLES:
        raise UsageError(
            f"{rate * duration:.3g} samples ({rate:g} Hz over {duration:g} s); expected {MOST_SAMPLES:.0e} at most, which are some "
            "20 GB: a lower rate, or a shorter time"
        )
    edges = start + np.arange(round(duration * rate) + 1) / rate
    return IdealLog(motion, edges, *increments(motion, edges))
