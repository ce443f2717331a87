"""Navigation with fixes whose receiver says how good they are: white errors, slow ones, constant ones, and parts of each.

What the receiver says is the size of all of a fix's error. `share` of its variance is slow, of a time from half a minute to an
hour, or constant. Velocities are white.

Run: ``python -m benchmarks.honesty.fixes --runs 20``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.honesty.circling import ARM, compared, drawn_start, received
from benchmarks.honesty.driving import STRAIGHT, car, ship
from benchmarks.honesty.frame import Case, Outcome, main
from truenorth.aiding.aids import Gnss
from truenorth.core.earth import radii
from truenorth.navigation import Mounting, navigate
from truenorth.records.specs import imu_spec
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.processes import gauss_markov

SIZE = 1.0  # m, of fixes
VEHICLES = {"car": car, "ship": ship}


def receiver(fixes: Gnss, rng: np.random.Generator, share: float, time: float, every: float) -> Gnss:
    """The same receiver, of whose slow errors nothing is said; a share of the variance of its fixes lasts (s)."""
    record = fixes.record
    count = len(record)
    white, slow = SIZE * math.sqrt(1.0 - share), SIZE * math.sqrt(share)
    if math.isfinite(time):
        lasts = gauss_markov(slow, time, every, count, rng)
    else:
        lasts = np.tile(slow * rng.standard_normal(3), (count, 1))
    R_M, R_N = radii(record.lat[0])
    metres = np.array([R_M, R_N * np.cos(record.lat[0]), 1.0])
    off = (lasts + white * rng.standard_normal((count, 3)))[:, [1, 0, 2]] / metres
    shifted = replace(record, lat=record.lat + off[:, 0], lon=record.lon + off[:, 1], alt=record.alt + off[:, 2])
    shifted = replace(shifted, position_sigma=np.full((count, 3), SIZE))
    return Gnss(shifted, Mounting(lever_arm=ARM))


def driven(
    name: str, grade: str, duration: float, share: float, time: float, every: float = 1.0, **options: Any
) -> Any:
    """A run: the vehicle's drawn course, an IMU of a grade, a drawn start, fixes of such errors."""
    spec = imu_spec(grade)

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number, 11])
        motion = VEHICLES[name](rng, duration)
        sim = simulate(ideal_log(motion, rate=50.0, duration=duration), imu=spec, seed=seed, run=number)
        start = drawn_start(motion, spec, rng)
        fixes = receiver(received(motion, duration, every, rng, place=0.0), rng, share, time, every)
        result = navigate(sim.record, start, aid=fixes, imu=spec, deflection=STRAIGHT, **options)
        return compared(result, motion, tuple(duration * part for part in (0.25, 0.5, 0.75, 1.0)))

    return run


ERRORS = {
    "white": (0.0, math.inf),
    **{f"{time:g} s": (1.0, time) for time in (60.0, 300.0, 3000.0)},
    **{f"half white, half {time:g} s": (0.5, time) for time in (60.0, 300.0, 3000.0)},
    "a tenth constant": (0.1, math.inf),
    "half constant": (0.5, math.inf),
}
CASES = tuple(
    Case(
        "navigation, fixes of 1 m",
        f"{what}, {grade} IMU, {name}, {duration:g} s",
        driven(name, grade, duration, *of, check_clocks=False),
    )
    for name, durations in (("car", (200.0, 600.0)), ("ship", (200.0, 600.0, 1800.0)))
    for grade in ("industrial", "tactical")
    for duration in durations
    for what, of in ERRORS.items()
)

if __name__ == "__main__":
    main(CASES)
