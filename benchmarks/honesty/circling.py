"""Navigation in circles, with GNSS: what scale factors and misalignments of the gyros do, whose errors add up turn by turn.

Run: ``python -m benchmarks.honesty.circling --runs 20``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.honesty.frame import Case, Outcome, main
from benchmarks.honesty.voyage import DEG
from truenorth.aiding.aids import Gnss
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.earth import radii
from truenorth.core.position import Position
from truenorth.navigation import Mounting, Start, navigate
from truenorth.records import GnssRecord
from truenorth.records.motion import Moving
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight, turn
from truenorth.state.layout import BA, BG, DP, DV, PHI

Array = NDArray[np.float64]
ARM = np.array([0.3, 0.5, 0.8])  # m, to the antenna
PLACE, SPEED = 1.0, 0.05  # m, m/s: white noise of the fixes


def drawn_start(motion: Moving, spec: ImuSpec, rng: np.random.Generator) -> Start:
    """A start whose level (.2 deg), heading (2 deg), velocity and place are off as its covariance says."""
    sigma = np.concatenate([np.repeat([0.2 * DEG, 0.05, 2.0], 3), np.zeros(6)])
    sigma[2] = 2.0 * DEG
    x0 = sigma * rng.standard_normal(15)
    sigma[BG], sigma[BA] = spec.gyro_bias, spec.accel_bias
    at = motion.states(np.array([0.0]))
    R_M, R_N = radii(at.lat[0])
    lat, lon = at.lat[0] + x0[DP][1] / R_M, at.lon[0] + x0[DP][0] / (R_N * np.cos(at.lat[0]))
    C = dcm_from_rotation_vector(-x0[PHI]) @ at.C_nb[0]
    zero = np.zeros(3)
    return Start(0.0, C, at.v_n[0] + x0[DV], lat, lon, at.alt[0] + x0[DP][2], zero, zero, np.diag(sigma**2))


def received(motion: Moving, duration: float, every: float, rng: np.random.Generator, place: float = PLACE) -> Gnss:
    """Fixes of an antenna on its arm, with white noise of `place` (m), and velocities."""
    time = np.arange(0.4, duration, every)
    fix = motion.states(time)
    R_M, R_N = radii(fix.lat[0])
    antenna = fix.v_n + np.einsum("kij,kj->ki", fix.C_nb, np.cross(fix.w_ib_b, ARM))
    arm = np.einsum("kij,j->ki", fix.C_nb, ARM)
    noise = rng.standard_normal((2, len(time), 3)) * np.array([place, SPEED])[:, None, None]
    off = arm + noise[0]
    record = GnssRecord(
        time,
        fix.lat + off[:, 1] / R_M,
        fix.lon + off[:, 0] / (R_N * np.cos(fix.lat)),
        fix.alt + off[:, 2],
        v_n=antenna + noise[1],
        position_sigma=np.full_like(off, PLACE),
        velocity_sigma=np.full_like(off, SPEED),
    )
    return Gnss(record, Mounting(lever_arm=ARM, bias_sigma=0.0))


def compared(result: Any, motion: Moving, times: tuple[float, ...]) -> Outcome:
    """Errors of a navigation over its sigmas at some times."""
    k = [int(np.argmin(np.abs(result.time - t))) for t in times]
    true = motion.states(result.time[k])
    phi = np.array([-rotation_vector_from_dcm(a @ b.T) for a, b in zip(result.C_nb[k], true.C_nb, strict=True)])
    s = result.track.sigma[k]
    ratio = phi / s[:, PHI]
    R_M, R_N = radii(true.lat)
    lat, lon, alt = (result.position[k] - np.stack([true.lat, true.lon, true.alt], axis=1)).T
    dp = np.stack([lon * (R_N + true.alt) * np.cos(true.lat), lat * (R_M + true.alt), alt], axis=1) / s[:, DP]
    dv = (result.v_n[k] - true.v_n) / s[:, DV]
    bad = "" if result.status == "navigated" else f"{result.status}: {result.reasons[0]}"
    said = f"sigma {np.degrees(s[-1, PHI]).round(3)} deg"
    return Outcome({"heading": ratio[:, 2], "level": ratio[:, :2], "velocity": dv, "position": dp}, bad, said)


def circling(grade: str, circles: float, **options: Any) -> Any:
    """A run: so many circles at 12 deg/s one way, an S turn, straight on; a place and heading of its own."""
    spec = imu_spec(grade)

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number, 5])
        place = Position.from_degrees(rng.uniform(-60.0, 60.0), rng.uniform(-180.0, 180.0), 100.0)
        legs = [
            *straight(rng.uniform(5.0, 15.0)),
            *turn(rng.choice([-1, 1]) * circles * 360.0 * DEG, 12.0 * DEG),
            *s_turn(30.0 * DEG, 6.0 * DEG),
            *straight(30.0),
        ]
        motion = course(place, legs, heading=rng.uniform(0.0, 6.28), speed=8.0)
        duration = 45.0 + 30.0 * circles
        sim = simulate(ideal_log(motion, rate=50.0, duration=duration), imu=spec, seed=seed, run=number)
        start = drawn_start(motion, spec, rng)
        fixes = received(motion, duration, 0.2, rng)
        result = navigate(sim.record, start, aid=fixes, imu=spec, **options)
        return compared(result, motion, (0.35 * duration, 0.6 * duration, duration))

    return run


CASES = tuple(
    Case("navigation, GNSS", f"{grade} IMU, {n:g} circles at 12 deg/s", circling(grade, n))
    for grade, n in (("industrial", 1.0), ("industrial", 4.0), ("tactical", 4.0))
)

if __name__ == "__main__":
    main(CASES)
