"""Speed of the mechanisation: a slow turn over the ellipsoid, 10 minutes at 100 Hz, from increments.

Run: ``python -m benchmarks mechanisation``; other libraries on the same log: ``python -m benchmarks peers``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.timing import best as seconds
from truenorth.core.attitude import dcm_from_euler
from truenorth.records import ImuRecord
from truenorth.state.state import State
from truenorth.strapdown.level import inertial_integrals, integrate_attitude, mechanise

T, COUNT, REPEATS = 0.01, 60_000, 7
LIMIT = 120.0  # ns a sample


def log() -> ImuRecord:
    """A vehicle that sways and turns: integrals of sinusoids over each interval, about 1 g along up."""
    t = T * np.arange(COUNT + 1)
    angle = np.stack([0.02 * np.sin(0.9 * t), 0.03 * np.sin(1.1 * t + 1), 0.6 * np.sin(0.05 * t)], axis=1)
    velocity = np.stack([0.5 * np.sin(0.7 * t), 0.8 * np.sin(0.3 * t), 9.798 * t], axis=1)
    return ImuRecord(t[1:], np.diff(angle, axis=0), np.diff(velocity, axis=0), "increments")


def best(call: Callable[[], object]) -> float:
    """Shortest time a sample over repeats, ns."""
    return 1e9 * seconds(call, REPEATS) / COUNT


def main() -> None:
    record = log()
    lat, lon, alt = np.radians(34.2), np.radians(108.9), 400.0
    state = State.at(dcm_from_euler(1.0, 0.01, -0.02), lat, lon, alt)

    print(f"  {COUNT} samples; ns a sample")
    figures = {
        "truenorth, every sample": best(lambda: mechanise(record, state)),
        "truenorth, 1 Hz": best(lambda: mechanise(record, state, every=100)),
        "truenorth, height fixed": best(lambda: mechanise(record, state, altitude="fixed")),
        "truenorth, 2 samples an update": best(lambda: mechanise(record, state, algorithm="2")),
        "truenorth, 4 samples an update": best(lambda: mechanise(record, state, algorithm="4")),
        "truenorth, attitude alone, inertial": best(lambda: integrate_attitude(record.gyro)),
        "truenorth, inertial integrals": best(
            lambda: inertial_integrals(record.gyro, record.accel, record.steps, np.arange(0, COUNT + 1, 20))
        ),
    }
    first = next(iter(figures.values()))
    for name, figure in figures.items():
        verdict = f"(limit {LIMIT:.0f})" if figure is first else f"{figure / first:6.2f} times"
        print(f"  {name:40s}{figure:8.1f}  {verdict}")


if __name__ == "__main__":
    main()
