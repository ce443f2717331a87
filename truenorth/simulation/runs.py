"""One simulated log beside its truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from truenorth.records import ImuRecord
from truenorth.simulation.ideal import IdealLog, ideal_log
from truenorth.simulation.imu_errors import TrueErrors, apply_errors
from truenorth.simulation.motion import MotionStates
from truenorth.simulation.sensing import Moving
from truenorth.specs import ImuSpec


@dataclass(frozen=True)
class Simulation:
    """A simulated log beside its truth.

    Attributes
    ----------
    record : ImuRecord
    motion : Motion or Indexed
        The truth at any time: ``motion.states(t)``.
    errors : TrueErrors
    """

    record: ImuRecord
    motion: Moving
    errors: TrueErrors

    @property
    def truth(self) -> MotionStates:
        """The true motion of the IMU at the sample times."""
        return self.motion.states(self.record.time)


def simulate(
    motion: Moving | IdealLog,
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
    motion : Motion, Indexed or IdealLog
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
        dtheta, dvel = (x * interval for x in ideal.rates)
    dtheta, dvel, errors = apply_errors(dtheta, dvel, interval, imu or ImuSpec(), seed=seed, run=run, scenario=scenario)
    scale = interval if kind == "rates" else 1.0
    record = ImuRecord(times, dtheta / scale, dvel / scale, kind, "simulation")
    return Simulation(record, ideal.motion, errors)
