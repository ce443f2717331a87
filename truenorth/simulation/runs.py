"""Simulated logs with their truth: one, or many that share a motion."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Literal

from numpy.typing import ArrayLike

from truenorth.core.errors import UsageError
from truenorth.core.shown import Shown
from truenorth.records import ImuRecord
from truenorth.records.motion import MotionStates, Moving
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation.ideal import IdealLog, ideal_log
from truenorth.simulation.imu_errors import apply_errors, size_effect
from truenorth.simulation.true_errors import TrueErrors

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Simulation(Shown):
    """A simulated log with its truth.

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

    def in_brief(self) -> dict[str, str]:
        """Length, rate and kind of the log."""
        r = self.record
        return {
            "samples": str(len(r)),
            "span": f"{r.time[0]:.3f} to {r.time[-1]:.3f} s",
            "rate": f"{1.0 / r.interval:.4g} Hz",
        }

    def to_frame(self) -> pd.DataFrame:
        """The log and the truth at its times side by side, index ``time``."""
        return self.record.to_frame().join(self.truth.trajectory().to_frame())


def simulate(
    motion: Moving | IdealLog,
    *,
    rate: float = 100.0,
    duration: float = 600.0,
    start: float = 0.0,
    imu: ImuSpec | str | PathLike[str] | None = None,
    seed: int = 0,
    run: int = 0,
    scenario: int = 0,
    kind: Literal["increments", "rates"] = "increments",
    errors: Mapping[str, ArrayLike] | None = None,
) -> Simulation:
    """Simulate the log of an IMU.

    Parameters
    ----------
    motion : Motion, Indexed or IdealLog
        An ideal log that was made before saves its time; it brings its own rate, duration and start.
    rate : float, Hz
    duration : float, s
    start : float, s
    imu : ImuSpec or str, optional
        A specification, a preset's name or a file, as of :func:`truenorth.imu_spec`. Its errors are drawn; an ideal IMU when
        left out.
    seed, run, scenario : int
        The same three give the same bits.
    kind : {"increments", "rates"}
        Rates are instantaneous, the errors those of the increments divided by the interval.
    errors : mapping, optional
        Constant errors in SI that are given, not drawn, by name: ``{"gyro_bias": (1e-7, -1e-7, 2e-7)}``; from datasheet
        units by :func:`truenorth.simulation.given_errors`.

    Raises
    ------
    UsageError
        Something else than a motion; a rate, a duration or a given error that makes no sense.
    """
    if isinstance(motion, str):
        raise UsageError(
            f"motion {motion!r} is a name; expected a motion; a scenario is simulated by "
            f"`truenorth.simulation.scenario.read_scenario({motion!r}).simulate()`"
        )
    if not hasattr(motion, "states") and not isinstance(motion, IdealLog):
        raise UsageError(
            f"motion is a {type(motion).__name__}; expected a motion, such as `rest(...)`, or an ideal log"
        )
    ideal = motion if isinstance(motion, IdealLog) else ideal_log(motion, rate=rate, duration=duration, start=start)
    spec = ImuSpec() if imu is None else imu_spec(imu)
    interval = ideal.interval
    dtheta, dvel = (x * interval for x in ideal.rates) if kind == "rates" else (ideal.dtheta, ideal.dvel)
    if spec.accel_positions is not None:
        leverage = ideal.leverage_rates * interval if kind == "rates" else ideal.leverage
        dvel = dvel + size_effect(leverage, spec)
    dtheta, dvel, drawn = apply_errors(
        dtheta, dvel, interval, spec, seed=seed, run=run, scenario=scenario, given=errors
    )
    if kind == "rates":
        dtheta, dvel = dtheta / interval, dvel / interval
    for rows in (dtheta, dvel):  # nobody else has them: the record need not copy
        rows.flags.writeable = False
    record = ImuRecord(ideal.times, dtheta, dvel, kind, "simulation")
    return Simulation(record, ideal.motion, drawn)


def simulate_runs(
    ideal: IdealLog,
    imu: ImuSpec,
    runs: int | Iterable[int],
    *,
    workers: int = 1,
    seed: int = 0,
    scenario: int = 0,
    kind: Literal["increments", "rates"] = "increments",
    errors: Mapping[str, ArrayLike] | None = None,
) -> Iterator[Simulation]:
    """Simulate many runs of one motion, in order, as they are asked for.

    At most ``workers + 1`` logs wait to be taken. The bits do not depend on the workers.

    Parameters
    ----------
    ideal : IdealLog
    imu : ImuSpec
    runs : int or iterable of int
        How many, or which.
    workers : int
        Threads.
    seed, scenario, kind, errors
        As in :func:`simulate`.

    Yields
    ------
    Simulation

    Raises
    ------
    UsageError
        Fewer than one worker.
    """
    if workers < 1:
        raise UsageError(f"workers={workers}; expected 1 or more")
    one = partial(simulate, ideal, imu=imu, seed=seed, scenario=scenario, kind=kind, errors=errors)
    numbers = range(runs) if isinstance(runs, int) else runs
    if workers == 1:
        for run in numbers:
            yield one(run=run)
        return
    if imu.accel_positions is not None:
        _ = ideal.leverage_rates if kind == "rates" else ideal.leverage  # made once, before the threads ask for it
    waiting: deque[Future[Simulation]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        try:
            for run in numbers:
                waiting.append(pool.submit(one, run=run))
                if len(waiting) > workers:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()
