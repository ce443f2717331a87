"""The marine scenario, coarsely sampled, navigated with given errors: shared by the tests of damping."""

from dataclasses import replace
from functools import cache

import numpy as np

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import radii
from truenorth.core.yaml_file import read_mapping
from truenorth.damping.fix_rows import FixRows
from truenorth.errors.marine import BA, BG, DP, DV, PHI, STATES
from truenorth.simulation import simulate
from truenorth.simulation.scenario import SHIPPED, read_scenario
from truenorth.state.state import State
from truenorth.state.track import Track
from truenorth.strapdown.level import mechanise

HOUR = 3600.0
DEG_PER_HOUR = np.radians(1.0) / HOUR
MICRO_G = 9.80665e-6


def paper_errors():
    """(13,) of the INS after hours at sea: .1 m/s, .7' of level, 7.7' of heading, tens of metres, and its biases."""
    x = np.zeros(STATES)
    x[PHI], x[DV], x[DP] = np.radians(np.array([0.7, 0.7, 7.7]) / 60.0), 0.1, [43.0, 62.0]
    x[BG], x[BA] = 0.005 * DEG_PER_HOUR, 50.0 * MICRO_G
    return x


@cache
def ideal_and_truth(lat=45.78, heading=51.3401917, interval=10.0, hours=48.0):
    """Ideal log and true course of the paper's ship, from a latitude (deg) on a heading (deg)."""
    kept = ("name", "duration", "motion")
    scenario = {key: read_mapping(SHIPPED / "marine_damping.yaml")[key] for key in kept}
    scenario |= {"rate": f"{1.0 / interval} Hz", "duration": f"{hours} h"}
    scenario["position"] = {"lat": f"{lat} deg", "lon": "126.67 deg"}
    scenario["motion"] = scenario["motion"] | {"heading": f"{heading} deg"}
    ideal = read_scenario(scenario).ideal()
    at = ideal.motion.states(ideal.edges)
    return ideal, Track.along(at)


def navigate(ideal, truth, x0, gyro_bias, accel_bias):
    """The course of a free INS that begins with errors `x0` (7,) and has these biases."""
    sim = simulate(ideal, errors={"gyro_bias": gyro_bias, "accel_bias": accel_bias})
    lat, lon, alt = truth.position[0]
    R_M, R_N = radii(lat)
    start = State.at(
        dcm_from_rotation_vector(-x0[PHI]) @ truth.C_nb[0],
        lat + x0[DP][1] / (R_M + alt),
        lon + x0[DP][0] / ((R_N + alt) * np.cos(lat)),
        alt,
        truth.v_n[0] + np.append(x0[DV], 0.0),
    )
    out = mechanise(sim.record, start, altitude="fixed")

    def joined(first, rest):
        return np.concatenate([np.asarray(first)[None], rest])

    return replace(
        truth,
        C_nb=joined(start.C_nb, out.C_nb),
        v_n=joined(start.v_n, out.v_n),
        position=joined([start.lat, start.lon, start.alt], out.position),
    )


def fix_rows(course, z, sigma):
    """Fixes of a course from arrays (K+1, 3) with an epoch a row, NaN where there is none."""
    k = np.flatnonzero(np.isfinite(z).any(axis=1))
    return FixRows(k, course.time[k], z[k], sigma[k], np.zeros((len(k), 3)))
