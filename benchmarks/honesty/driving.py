"""Navigation of a car and of a ship with GNSS: what scale factors and misalignments do on turns, pushes and in a swell.

Each grade of IMU in each vehicle, and the sensors of one sort alone wrong by theirs (`gyros`, `accelerometers`), where the
specification promises both. Without the second looks of `check_clocks`, which can only add to sigma.

Run: ``python -m benchmarks.honesty.driving --runs 20``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np

from benchmarks.honesty.circling import compared, drawn_start, received
from benchmarks.honesty.frame import Case, Outcome, main
from benchmarks.honesty.voyage import DEG
from truenorth.core.position import Position
from truenorth.errors.deflection import Deflection
from truenorth.navigation import navigate
from truenorth.records.motion import Moving
from truenorth.records.specs import imu_spec
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, climb, length, straight, turn
from truenorth.simulation.sway import Disturbed
from truenorth.simulation.tones import Tone

CAR, SHIP = 240.0, 400.0  # s
STRAIGHT = Deflection(0.0)  # the simulator's plumb line
Sort = Literal["both", "gyros", "accelerometers"]


def _tone(rng: np.random.Generator, amplitude: float, period: float) -> tuple[Tone, ...]:
    return (Tone(amplitude * DEG * rng.uniform(0.5, 1.0), period * rng.uniform(0.8, 1.2), rng.uniform(0.0, 6.28)),)


def car(rng: np.random.Generator, duration: float = CAR) -> Moving:
    """Off from a stop, turns of 30 to 120 deg at 6 to 12 deg/s, faster and slower, up and down slopes; its body rolls a little."""
    place = Position.from_degrees(rng.uniform(-60.0, 60.0), rng.uniform(-180.0, 180.0), 100.0)
    speed = 0.0
    legs = [*straight(rng.uniform(5.0, 20.0))]
    while length(legs) < duration:
        faster = rng.uniform(5.0, 18.0)
        angle, rate = rng.choice([-1.0, 1.0]) * rng.uniform(30.0, 120.0), rng.uniform(6.0, 12.0)
        legs += accelerate(faster, rng.uniform(1.0, 2.0), before=speed, onset=1.0)
        legs += straight(rng.uniform(3.0, 15.0)) + turn(angle * DEG, rate * DEG)
        legs += climb(rng.uniform(-3.0, 3.0) * DEG, rng.uniform(5.0, 12.0))
        speed = faster
    way = course(place, legs, heading=rng.uniform(0.0, 6.28))
    return Disturbed(way, roll_tones=_tone(rng, 0.3, 2.0), pitch_tones=_tone(rng, 0.3, 1.5))


def ship(rng: np.random.Generator, duration: float = SHIP) -> Moving:
    """4 to 10 m/s in a swell, a turn of 40 to 150 deg at 1 to 2 deg/s now and then."""
    place = Position.from_degrees(rng.uniform(-60.0, 60.0), rng.uniform(-180.0, 180.0))
    legs = [*straight(rng.uniform(10.0, 60.0))]
    while length(legs) < duration:
        angle = rng.choice([-1.0, 1.0]) * rng.uniform(40.0, 150.0)
        legs += turn(angle * DEG, rng.uniform(1.0, 2.0) * DEG, onset=5.0) + straight(rng.uniform(30.0, 90.0))
    way = course(place, legs, heading=rng.uniform(0.0, 6.28), speed=rng.uniform(4.0, 10.0))
    return Disturbed(
        way,
        heading_tones=_tone(rng, 1.0, 9.0),
        pitch_tones=_tone(rng, 3.0, 6.0),
        roll_tones=_tone(rng, 8.0, 9.0),
    )


def driven(vehicle: Any, duration: float, grade: str, wrong: Sort = "both", **options: Any) -> Any:
    """A run: the vehicle's drawn course, an IMU of a grade, a drawn start, fixes every second."""
    spec = imu_spec(grade)
    true = spec
    if wrong != "both":
        other = "accel" if wrong == "gyros" else "gyro"
        true = replace(spec, **{f"{other}_scale_factor": 0.0, f"{other}_misalignment": 0.0})

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number, 8])
        motion = vehicle(rng)
        sim = simulate(ideal_log(motion, rate=50.0, duration=duration), imu=true, seed=seed, run=number)
        start = drawn_start(motion, spec, rng)
        fixes = received(motion, duration, 1.0, rng)
        result = navigate(sim.record, start, aid=fixes, imu=spec, deflection=STRAIGHT, **options)
        return compared(result, motion, tuple(duration * share for share in (0.25, 0.5, 0.75, 1.0)))

    return run


GRADES = ("consumer", "industrial", "tactical", "navigation")
VEHICLES = {"car": (car, CAR), "ship": (ship, SHIP)}
CASES = tuple(
    Case(
        "navigation, GNSS",
        f"{grade} IMU, {name}" + ("" if wrong == "both" else f", {wrong} alone off axis"),
        driven(*VEHICLES[name], grade, wrong, check_clocks=False),
    )
    for name, grades, wrong in (
        ("car", GRADES, "both"),
        ("ship", GRADES, "both"),
        ("car", ("consumer", "industrial"), "gyros"),
        ("car", ("consumer", "industrial"), "accelerometers"),
    )
    for grade in grades
)

if __name__ == "__main__":
    main(CASES)
