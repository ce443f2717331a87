"""Transfer alignment against a master with errors of its own: RMS of error over sigma of what it finds.

Errors of the master: constant .3 arcmin of level, 2 arcmin of heading, .05 m/s, and as much drift in 200 s. Drawn in each run:
those errors, delay (50 ms), lever arm (1 m), mounting (3 deg), the slave's biases. Each case twice: the errors considered, and
the master taken for the truth. Sigma is honest where the RMS lies in .8 to 1.25.

Run: ``python -m benchmarks.honesty.transfer --runs 20``.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from truenorth.alignment.transfer import align_transfer
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.position import Position
from truenorth.errors.master import MasterErrors
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, ideal_log, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.simulation.sway import Disturbed
from truenorth.simulation.tones import Tone

DEG, ARCMIN = np.radians(1.0), np.radians(1.0 / 60.0)
SECONDS, RATE = 200.0, 100.0
ERRORS = MasterErrors(0.3 * ARCMIN, 2.0 * ARCMIN, 0.05, 0.3 * ARCMIN, 0.05, correlation_time=200.0)


def ship() -> Any:
    """12 m/s at 20 deg N, rolling and pitching, with a turn each way."""
    legs = [*straight(30.0), *s_turn(30 * DEG, 1 * DEG), *straight(200.0)]
    way = course(Position.from_degrees(20.0, 115.0), legs, heading=0.6, speed=12.0)
    return Disturbed(
        way,
        heading_tones=(Tone(1 * DEG, 9.0),),
        pitch_tones=(Tone(2 * DEG, 6.0, 1.0),),
        roll_tones=(Tone(4 * DEG, 8.0, 2.0),),
    )


def aircraft() -> Any:
    """150 m/s at 62 deg N, S-turns."""
    legs = [*straight(30.0), *s_turn(20 * DEG, 3 * DEG), *straight(60.0), *s_turn(20 * DEG, 3 * DEG), *straight(200.0)]
    return course(Position.from_degrees(62.0, 20.0, 3000.0), legs, heading=0.6, speed=150.0)


def run_case(name: str, motion: Any, errors: MasterErrors | None, seed: int, runs: int) -> str:
    """A line of the table."""
    ideal = ideal_log(motion, rate=RATE, duration=SECONDS)
    spec = imu_spec("tactical")
    ratios, nees, refused = [], [], 0
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        arm, tau, mount = rng.standard_normal(3), 0.05 * rng.standard_normal(), 3 * DEG * rng.standard_normal(3)
        sigma = {"level": 0.3 * ARCMIN, "heading": 2.0 * ARCMIN, "attitude_drift": 0.3 * ARCMIN}
        of_master = MasterSpec(
            clock_offset=tau,
            lever_arm=tuple(arm),
            mounting=tuple(mount),
            velocity=0.05,
            velocity_drift=0.05,
            correlation_time=200.0,
            velocity_noise=0.05,
            attitude_noise=ARCMIN,
            **sigma,
        )
        slave = simulate(ideal, imu=spec, seed=seed, run=run).record
        master = simulate_sensor(motion, of_master, duration=SECONDS, seed=seed, run=run).record
        answer = align_transfer(slave, master, spec, master_errors=errors)
        t = answer.transfer
        phi = -rotation_vector_from_dcm(answer.C_nb @ motion.states(np.array(answer.time)).C_nb.T)
        off = np.concatenate([phi, [t.delay - tau], t.lever_arm - arm])
        own = np.concatenate([np.sqrt(np.diag(answer.phi_covariance)), [t.delay_sigma], t.lever_arm_sigma])
        ratios.append(off / own)
        nees.append(phi @ np.linalg.solve(answer.phi_covariance, phi) / 3.0)
        refused += answer.status != "aligned"
    found = np.array(ratios) ** 2
    level, heading, delay, arms = (np.sqrt(found[:, k].mean()) for k in (slice(0, 2), 2, 3, slice(4, 7)))
    how = "considered" if errors else "taken for the truth"
    return (
        f"{name:9s} {how:20s} {runs:3d} runs  heading {heading:5.2f}  level {level:5.2f}  delay {delay:5.2f}  arm {arms:5.2f}  "
        f"NEES/3 {np.mean(nees):6.2f}  refused {refused}"
    )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    for name, motion in (("ship", ship()), ("aircraft", aircraft())):
        for errors in (ERRORS, None):
            print(run_case(name, motion, errors, given.seed, given.runs), flush=True)


if __name__ == "__main__":
    main()
