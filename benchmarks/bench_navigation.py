"""Speed of navigation: an hour of flight at 100 Hz, free inertial, with covariance, aided by GNSS, smoothed.

Limits: .15 s free inertial, 1 s with 15 states at 10 Hz and GNSS at 1 Hz. Run: ``python -m benchmarks navigation``.
"""

from __future__ import annotations

import numpy as np

from benchmarks.timing import best
from truenorth.aiding.source import Aiding
from truenorth.core.position import Position
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.state.state import Start

SECONDS, REPEATS = 3600.0, 3
FREE_LIMIT, AIDED_LIMIT = 0.15, 1.0  # s


def main() -> None:
    legs = [*straight(20.0), *s_turn(np.radians(60.0), np.radians(3.0), 4)]
    motion = course(Position.from_degrees(45.0, 10.0, 3000.0), legs, heading=0.5, speed=200.0)
    record = simulate(motion, rate=100.0, duration=SECONDS).record
    s = motion.states(0.0)
    P = np.diag(np.repeat([2e-4, 0.2, 10.0, 5e-8, 5e-4], 3) ** 2)
    start = Start(0.0, s.C_nb, s.v_n, float(s.lat), float(s.lon), float(s.alt), np.zeros(3), np.zeros(3), P)
    seconds = np.arange(1.0, SECONDS) + 0.3337
    at = motion.states(seconds)
    gnss = Aiding(
        "GNSS position",
        "position",
        seconds,
        np.stack([at.lat, at.lon, at.alt], axis=1),
        np.full((len(seconds), 3), 2.0),
    )
    small, large = InsModel(1e-6, 1e-4), InsModel.from_spec(imu_spec("tactical"))
    free = best(lambda: navigate_track(record, start, small, covariance=False, interval=10.0), REPEATS)
    aided = best(lambda: navigate_track(record, start, small, [gnss], interval=0.1, every=10), REPEATS)
    print(f"free inertial                            {free:.3f} s (limit {FREE_LIMIT:g} s)")
    print(f"15 states at 10 Hz, GNSS at 1 Hz         {aided:.3f} s (limit {AIDED_LIMIT:g} s)")
    more = best(lambda: navigate_track(record, start, large, [gnss], interval=0.1, every=10), REPEATS)
    print(f"21 states at 10 Hz, GNSS at 1 Hz         {more:.3f} s")
    smooth = best(lambda: navigate_track(record, start, large, [gnss], interval=1.0, every=1, smooth=True), REPEATS)
    print(f"21 states at 1 Hz, GNSS at 1 Hz, smoothed {smooth:.3f} s")
    assert free < FREE_LIMIT, "slower than the limit: is the machine busy?"
    assert aided < AIDED_LIMIT, "slower than the limit: is the machine busy?"
