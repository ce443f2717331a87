"""Navigation with an antenna on a mast that swings: the arm said, not said, or said wrong; means over the interval, or not.

Drawn in each run: the IMU's grade, a car that is shaken or a ship that rolls, the arm (2 to 12 m up), the receiver's rate (1 to
10 Hz), whether its velocities are means over its interval, how hard and how quickly the vehicle shakes, and how long the log is.

Run: ``python -m benchmarks.honesty.masts --runs 20``.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.honesty.circling import compared, drawn_start
from benchmarks.honesty.driving import STRAIGHT, car, ship
from benchmarks.honesty.frame import Case, Outcome, main
from benchmarks.honesty.voyage import DEG
from truenorth.aiding.aids import Gnss
from truenorth.core.earth import radii
from truenorth.navigation import Mounting, navigate
from truenorth.records import GnssRecord
from truenorth.records.motion import Moving
from truenorth.records.specs import imu_spec
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.sway import Disturbed
from truenorth.simulation.tones import Tone

Array = NDArray[np.float64]
Said = Literal["said", "not said", "said wrong"]
GRADES = ("consumer", "industrial", "tactical")
PLACE, SPEED = 0.5, 0.03  # m, m/s: white noise of a receiver
DOUBTED = "arm doubted"
MEANS = 20  # moments that a mean is taken of


def shaken(motion: Moving, rng: np.random.Generator) -> Moving:
    """The same vehicle on rough ground: .2 to 1.2 deg about both level axes, of .35 to 1.2 s each."""

    def tone() -> tuple[Tone, ...]:
        return (Tone(rng.uniform(0.2, 1.2) * DEG, rng.uniform(0.35, 1.2), rng.uniform(0.0, 6.28)),)

    return Disturbed(motion, roll_tones=tone(), pitch_tones=tone())


def received(
    motion: Moving, duration: float, every: float, mean: float, arm: Array, rng: np.random.Generator
) -> GnssRecord:
    """Fixes of an antenna on its arm; its velocities are means over so many seconds before their stamp."""
    time = np.arange(1.4, duration, every)
    fix = motion.states(time)
    R_M, R_N = radii(fix.lat[0])
    off = np.einsum("kij,j->ki", fix.C_nb, arm) + PLACE * rng.standard_normal((len(time), 3))
    moments = time[:, None] - np.linspace(0.0, mean, MEANS if mean > 0.0 else 1)
    at = motion.states(moments.ravel())
    v = at.v_n + np.einsum("kij,kj->ki", at.C_nb, np.cross(at.w_ib_b, arm))
    v = v.reshape(*moments.shape, 3).mean(axis=1) + SPEED * rng.standard_normal((len(time), 3))
    return GnssRecord(
        time,
        fix.lat + off[:, 1] / R_M,
        fix.lon + off[:, 0] / (R_N * np.cos(fix.lat)),
        fix.alt + off[:, 2],
        v_n=v,
        position_sigma=np.full_like(off, PLACE),
        velocity_sigma=np.full_like(off, SPEED),
    )


def carried(vehicle: str, means: bool, said: Said, longest: float = 600.0, **options: Any) -> Any:
    """A run on a car or a ship."""

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number, 12])
        grade = str(rng.choice(GRADES))
        duration = float(np.exp(rng.uniform(np.log(200.0), np.log(longest))))
        motion = shaken(car(rng, duration), rng) if vehicle == "car" else ship(rng, duration)
        arm = np.array([rng.uniform(-1.5, 1.5), rng.uniform(-4.0, 4.0), rng.uniform(2.0, 12.0)])
        every = 1.0 / float(rng.choice([1.0, 2.0, 5.0, 10.0]))
        spec = imu_spec(grade)
        sim = simulate(ideal_log(motion, rate=100.0, duration=duration), imu=spec, seed=seed, run=number)
        start = drawn_start(motion, spec, rng)
        record = received(motion, duration, every, every if means else 0.0, arm, rng)
        given = arm * (1.0 + (said == "said wrong") * rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.3))
        mounting = None if said == "not said" else Mounting(lever_arm=given, latency_sigma=0.2)
        result = navigate(sim.record, start, aid=Gnss(record, mounting), imu=spec, deflection=STRAIGHT, **options)
        found = compared(result, motion, tuple(duration * part for part in (0.25, 0.5, 0.75, 1.0)))
        about = f"{grade}, {duration:.0f} s, {1.0 / every:g} Hz, arm {arm.round(1)} m, {found.said}"
        about += f", {DOUBTED}" * any(item.key == "second_look.arm" for item in result.evidence)
        return Outcome(found.ratios, found.refused, about)

    return run


CASES = tuple(
    Case(
        "navigation, mast",
        f"{vehicle}, arm {said}, {'means over the interval' if means else 'velocities of the moment'}",
        carried(vehicle, means, said),
        flagged=said == "said wrong",
    )
    for vehicle in ("car", "ship")
    for said in ("said", "not said", "said wrong")
    for means in (False, True)
)

if __name__ == "__main__":
    main(CASES)
