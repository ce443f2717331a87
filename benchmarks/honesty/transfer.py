"""Transfer alignment against a master with errors of its own: RMS of error over sigma of what it finds.

Errors of the master: constant .3 arcmin of level, 2 arcmin of heading, .05 m/s, and as much drift in 200 s. Drawn in each run:
those errors, delay (50 ms), lever arm (1 m), mounting (3 deg), the slave's biases. Each case twice: the errors considered, and
the master taken for the truth. Sigma is honest where the RMS lies in .8 to 1.25.

A master's clock is assumed to walk against the slave's, as clocks of two computers do. So the aircraft is there twice: the
second time its clock walks as is assumed. The last cases have logs of 700 s, masters whose velocity went through a filter of
the first order, and stamps that scatter from row to row.

Run: ``python -m benchmarks.honesty.transfer --runs 20``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.honesty.bending import bending
from benchmarks.honesty.frame import Case, Outcome, main
from benchmarks.honesty.harness import of_transfer
from truenorth.aiding.aids import VEHICLE_ARM
from truenorth.aiding.matching import What
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_start import DELAY_WALK
from truenorth.core.position import Position
from truenorth.errors.master import MasterErrors
from truenorth.records import MasterRecord
from truenorth.records.motion import MotionStates, Moving
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.gnss import place_of
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.simulation.sway import Disturbed
from truenorth.simulation.tones import Tone

Array = NDArray[np.float64]

DEG, ARCMIN = np.radians(1.0), np.radians(1.0 / 60.0)
SECONDS, RATE = 200.0, 100.0
LONG = 700.0  # s
FINE = 0.002  # s, of steps of a master's filter
YAW, PITCH, ROLL = (Tone(1 * DEG, 9.0),), (Tone(2 * DEG, 6.0, 1.0),), (Tone(4 * DEG, 8.0, 2.0),)
ERRORS = MasterErrors(0.3 * ARCMIN, 2.0 * ARCMIN, 0.05, 0.3 * ARCMIN, 0.05, correlation_time=200.0)


def ship() -> Any:
    """12 m/s at 20 deg N, rolling and pitching, with a turn each way."""
    legs = [*straight(30.0), *s_turn(30 * DEG, 1 * DEG), *straight(200.0)]
    way = course(Position.from_degrees(20.0, 115.0), legs, heading=0.6, speed=12.0)
    return Disturbed(way, heading_tones=YAW, pitch_tones=PITCH, roll_tones=ROLL)


def aircraft() -> Any:
    """150 m/s at 62 deg N, S-turns."""
    legs = [*straight(30.0), *s_turn(20 * DEG, 3 * DEG), *straight(60.0), *s_turn(20 * DEG, 3 * DEG), *straight(200.0)]
    return course(Position.from_degrees(62.0, 20.0, 3000.0), legs, heading=0.6, speed=150.0)


def long_ship() -> Any:
    """As the ship, with a turn each way in each four minutes, 700 s."""
    legs = [*straight(30.0), *([*s_turn(30 * DEG, 1 * DEG), *straight(100.0)] * 4)]
    way = course(Position.from_degrees(20.0, 115.0), legs, heading=0.6, speed=12.0)
    return Disturbed(way, heading_tones=YAW, pitch_tones=PITCH, roll_tones=ROLL)


def long_aircraft() -> Any:
    """As the aircraft, with S-turns in each 100 s, 700 s."""
    legs = [*straight(30.0), *([*s_turn(20 * DEG, 3 * DEG), *straight(60.0)] * 8)]
    return course(Position.from_degrees(62.0, 20.0, 3000.0), legs, heading=0.6, speed=150.0)


def straight_flight() -> Any:
    """150 m/s straight on in still air."""
    return course(Position.from_degrees(62.0, 20.0, 3000.0), straight(400.0), heading=0.6, speed=150.0)


def wandering(master: MasterRecord, rng: np.random.Generator) -> tuple[MasterRecord, float]:
    """A master whose clock walks from row to row as is assumed of it; how late it is in the end, s."""
    late = DELAY_WALK * np.cumsum(np.sqrt(master.steps) * rng.standard_normal(len(master)))
    return replace(master, time=master.time + late), float(late[-1])


@dataclass(frozen=True)
class Scattered:
    """A motion as rows show it whose stamps are off by these times, s: a row stamped `stamps` holds at ``stamps + off``."""

    motion: Moving
    stamps: Array
    off: Array

    @property
    def breaks(self) -> Array:
        """Of the motion."""
        return self.motion.breaks

    @property
    def shortest_period(self) -> float:
        """Of the motion."""
        return self.motion.shortest_period

    def states(self, t: ArrayLike) -> MotionStates:
        """At the times at which rows with these stamps hold."""
        return self.motion.states(t + np.interp(t, self.stamps, self.off))


def filtered(master: MasterRecord, times: Array, way: Moving, arm: Array, constant: float) -> MasterRecord:
    """A master whose velocity went through a filter of the first order: ``v_f' = (v - v_f) / constant``, s.

    Parameters
    ----------
    times : (M,) array, s
        When its rows held.
    arm : (3,) array, m
        From the master to the slave, whose motion `way` is, slave axes.
    """
    t = np.arange(times[0], times[-1] + FINE, FINE)
    v = place_of(way.states(t), -arm)[3]
    kept, f = np.exp(-FINE / constant), v.copy()
    # Of a velocity that is a straight line from point to point.
    ramp = 1.0 - (1.0 - kept) * constant / FINE
    for k in range(1, len(t)):
        f[k] = kept * f[k - 1] + (1.0 - kept) * v[k - 1] + ramp * (v[k] - v[k - 1])
    off = np.stack([np.interp(times, t, axis) for axis in (f - v).T], axis=1)
    assert master.v_n is not None
    return replace(master, v_n=master.v_n + off)


def transferred(
    motion: Any,
    errors: MasterErrors | None,
    grade: str = "tactical",
    walks: bool = False,
    matching: What = "auto",
    far: bool = False,
    *,
    unsaid: bool = False,
    seconds: float = SECONDS,
    constant: float = 0.0,
    scatter: float = 0.0,
) -> Any:
    """A run of a slave of a grade against a master with these errors; None: it is taken for the truth.

    With `walks` its clock walks against the slave's. Where it is `far`, the arm is 15 to 40 m, known to .5 m;
    `unsaid`: 5 m along each axis (one sigma), and nothing is said of it. Its velocity goes
    through a filter of the first order with a time `constant`, s, and its stamps `scatter` by so much, s (one sigma).
    """

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number])
        arm, tau, mount = rng.standard_normal(3), 0.05 * rng.standard_normal(), 3 * DEG * rng.standard_normal(3)
        known: dict[str, Any] = {} if unsaid else {"lever_arm_sigma": 1.0}
        if unsaid:
            arm = VEHICLE_ARM * arm
        if far:
            toward = rng.standard_normal(3)
            given = rng.uniform(15.0, 40.0) * toward / np.linalg.norm(toward)
            arm = given + 0.5 * arm
            known = {"lever_arm": tuple(given), "lever_arm_sigma": 0.5}
        of_master = MasterSpec(
            clock_offset=tau,
            lever_arm=tuple(arm),
            mounting=tuple(mount),
            level=ERRORS.level,
            heading=ERRORS.heading,
            velocity=ERRORS.velocity,
            attitude_drift=ERRORS.attitude_drift,
            velocity_drift=ERRORS.velocity_drift,
            correlation_time=ERRORS.correlation_time,
            velocity_noise=0.05,
            attitude_noise=ARCMIN,
        )
        way, spec = motion(), imu_spec(grade)
        slave = simulate(way, rate=RATE, duration=seconds, imu=spec, seed=seed, run=number).record
        seen: Moving = way
        if scatter > 0.0:
            stamps = np.arange(0.0, seconds + 1.0, 1.0 / of_master.rate)
            seen = Scattered(way, stamps, np.maximum(scatter * rng.standard_normal(len(stamps)), -stamps))
        master = simulate_sensor(seen, of_master, duration=seconds, seed=seed, run=number).record
        if constant > 0.0:
            master = filtered(master, master.time - tau, way, arm, constant)
            # By velocity alone a filter's mean delay is one of the master; with attitude that of attitude is meant.
            tau += constant if matching == "velocity" else 0.0
        late = 0.0
        if walks:
            master, late = wandering(master, rng)
        tau += late
        answer = align_transfer(slave, master, spec, matching=matching, master_errors=errors, **known)
        return of_transfer(answer, way.states(np.array(answer.time)).C_nb, tau, arm)

    return run


ROWS: dict[What, str] = {"velocity": "velocity", "both": "velocity and attitude"}

CASES: tuple[Case, ...] = tuple(
    Case("transfer", f"{name}, errors of the master {how}", transferred(motion, errors), left_out=errors is None)
    for name, motion in (("ship", ship), ("aircraft", aircraft), ("straight flight", straight_flight))
    for how, errors in (("considered", ERRORS), ("left out", None))
)
CASES += (
    Case("transfer", "aircraft, clock of the master as assumed", transferred(aircraft, ERRORS, walks=True)),
    *(
        Case(
            "transfer",
            f"{name}, {grade} slave, an arm of which nothing is said",
            transferred(motion, ERRORS, grade=grade, matching=matching, unsaid=True),
        )
        for name, motion in (("ship", ship), ("aircraft", aircraft))
        for grade, matching in (("tactical", "auto"), ("consumer", "velocity"))
    ),
    Case(
        "transfer",
        "ship, consumer slave, by velocity alone",
        transferred(ship, ERRORS, "consumer", matching="velocity"),
    ),
    Case(
        "transfer",
        "aircraft, consumer slave, by velocity alone",
        transferred(aircraft, ERRORS, "consumer", matching="velocity"),
    ),
    Case(
        "transfer",
        "ship, consumer slave, by position alone",
        transferred(ship, ERRORS, "consumer", matching="position"),
    ),
)
CASES += tuple(
    Case(
        "transfer",
        f"ship, {grade} slave 15 to 40 m away, by position alone",
        transferred(ship, ERRORS, grade, matching="position", far=True),
    )
    for grade in ("tactical", "consumer")
)
CASES += tuple(
    Case(
        "transfer",
        f"{name} of 700 s, {grade} slave, by {ROWS[by]}",
        transferred(motion, ERRORS, grade, matching=by, seconds=LONG),
    )
    for name, motion in (("ship", long_ship), ("aircraft", long_aircraft))
    for grade in ("tactical", "consumer")
    for by in ROWS
)
CASES += tuple(
    Case(
        "transfer",
        f"aircraft, {grade} slave, by {ROWS[by]}, a filter of {constant:g} s",
        transferred(aircraft, ERRORS, grade, matching=by, constant=constant),
        flagged=constant > 0.1,  # the arm is off by what the filter lacks of a turn, and the answer says so
    )
    for constant in (0.1, 0.2)
    for grade in ("tactical", "consumer")
    for by in ROWS
)
CASES += tuple(
    Case(
        "transfer",
        f"{name}, {grade} slave, by {ROWS[by]}, stamps that scatter by 20 ms",
        transferred(motion, ERRORS, grade, matching=by, scatter=0.02),
    )
    for name, motion in (("ship", ship), ("aircraft", aircraft))
    for grade in ("tactical", "consumer")
    for by in ROWS
)

BENT: tuple[tuple[str, Any, dict[str, Any]], ...] = (
    ("a wing of 1 to 8 Hz", aircraft, {"wing": True}),
    ("a hull of 0.5 to 2 Hz", ship, {"wing": False, "frequencies": (0.5, 2.0), "sizes": (0.05, 0.2)}),
)
CASES += tuple(
    Case(
        "transfer",
        f"{name} that bends, {'said' if said else 'unsaid'}, by {ROWS.get(by, by)}",
        bending(motion, said=said, matching=by, **options),
        flagged=not said,
    )
    for name, motion, options in BENT
    for said in (True, False)
    for by in ("both", "velocity", "position+attitude")
)

if __name__ == "__main__":
    main(CASES)
