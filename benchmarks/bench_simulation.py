"""Speed of the simulator: 10 minutes at 100 Hz of a swaying ship, on a motion that is given.

Run: ``python -m benchmarks simulation``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.timing import best as seconds
from truenorth.core.position import Position
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import IdealLog, Sway, Tone, ideal_log, simulate, simulate_runs

REPEATS = 7
RUNS = 200
LIMITS = {"biases and random walks": 60.0, "every error term": 150.0}  # ms, warm, one core

SHIP = Sway(
    Position.from_degrees(40.0, 118.0),
    heading=-0.5,
    heading_tones=(Tone(0.09, 7, 1.0),),
    pitch_tones=(Tone(0.12, 5, 0.8),),
    roll_tones=(Tone(0.17, 6, 0.4),),
    east_tones=(Tone(0.02, 7, 0.3),),
    north_tones=(Tone(0.03, 6, 1.0),),
    up_tones=(Tone(0.3, 8, 2.0),),
    lever_arm=(10.0, 30.0, 10.0),
)
WALKS = ImuSpec(gyro_bias=5e-8, gyro_random_walk=3e-7, accel_bias=5e-4, accel_random_walk=1e-4, name="walks")
EVERYTHING = imu_spec(Path(__file__).parents[1] / "examples" / "imu_every_term.yaml")


def best(call: Callable[[], object]) -> float:
    """Shortest time over repeats, ms."""
    return 1e3 * seconds(call, REPEATS)


def many(ideal: IdealLog, spec: ImuSpec, workers: int) -> float:
    """Time of all runs, s; each is taken and let go."""
    start = time.perf_counter()
    total = 0.0
    for simulated in simulate_runs(ideal, spec, RUNS, workers=workers):
        total += float(simulated.record.gyro[-1, 0])
    assert np.isfinite(total)
    return time.perf_counter() - start


def main() -> None:
    ideal = ideal_log(SHIP, rate=100.0, duration=600.0)
    print(f"  {len(ideal.dtheta)} samples; ms a log, one thread")
    made = best(lambda: ideal_log(SHIP, rate=100.0, duration=600.0))
    print(f"  {'the ideal log':40s}{made:8.1f}")
    for name, spec in (("biases and random walks", WALKS), ("every error term", EVERYTHING)):
        figure = best(lambda: simulate(ideal, imu=spec))  # noqa: B023
        print(f"  {name:40s}{figure:8.1f}  (limit {LIMITS[name]:.0f})")
    print(f"  {RUNS} runs of one motion, s")
    for name, spec in (("biases and random walks", WALKS), ("every error term", EVERYTHING)):
        one, two = many(ideal, spec, 1), many(ideal, spec, 2)
        print(f"  {name:40s}{one:8.2f} on one thread, {two:.2f} on two ({one / two:.2f} times)")


if __name__ == "__main__":
    main()
