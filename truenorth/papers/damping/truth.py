"""The paper's voyage: a ship at rest, then two days under way, its INS navigating freely with given errors, and its log."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.units import parse
from truenorth.damping.course import without_errors
from truenorth.errors.marine import BA, BG, DP, DV, PHI, STATES
from truenorth.records.specs import ImuSpec
from truenorth.simulation import IdealLog, simulate
from truenorth.simulation.scenario import read_scenario
from truenorth.state.state import State
from truenorth.state.track import Track
from truenorth.strapdown.level import mechanise

Array = NDArray[np.float64]

HOUR = 3600.0
ARCMIN = math.radians(1.0 / 60.0)
GYRO_BIAS = parse("0.005 deg/h", "angular_rate")
ACCEL_BIAS = parse("50 ug", "acceleration")
LOG_NOISE = 0.05  # m/s, of each row at 1 Hz


@dataclass(frozen=True)
class Voyage:
    """The ideal log of the ship's IMU, and where it truly was."""

    ideal: IdealLog
    truth: Track
    log_noise: Array  # (K+1, 2) m/s: white, of a speed log with a row an epoch

    def reference(self, c: float | Array) -> Array:
        """(K+1, 2) what the log says with a constant error (m/s)."""
        return self.truth.v_n[:, :2] + c + self.log_noise

    def paper_errors(self) -> Array:
        """(13,) errors of the INS at the beginning and its biases, all with the paper's (positive) signs."""
        lat, _, alt = self.truth.position[0]
        R_M, R_N = earth.radii(lat)
        x = np.zeros(STATES)
        x[DV] = 0.1
        x[DP] = ARCMIN / 30.0 * np.array([(R_N + alt) * math.cos(lat), R_M + alt])
        x[PHI] = np.array([0.7, 0.7, 7.7]) * ARCMIN
        x[BA], x[BG] = ACCEL_BIAS, GYRO_BIAS
        return x

    def navigate(self, x0: Array, spec: ImuSpec | None = None, seed: int = 0, run: int = 0) -> Track:
        """What a free INS says that begins with errors `x0` (13,), biases with them, and draws its noise from a specification."""
        given = {"gyro_bias": x0[BG], "accel_bias": x0[BA]}
        record = simulate(self.ideal, imu=spec, seed=seed, run=run, errors=given).record
        begin = without_errors(self.truth[:2], -x0[:7])
        lat, lon, alt = (float(value) for value in begin.position[0])
        start = State.at(begin.C_nb[0], lat, lon, alt, begin.v_n[0])
        out = mechanise(record, start, altitude="fixed")
        C_nb, v_n, position = (
            np.concatenate([first[:1], rest])
            for first, rest in ((begin.C_nb, out.C_nb), (begin.v_n, out.v_n), (begin.position, out.position))
        )
        return Track.of_motion(self.truth.time, C_nb, v_n, position)


def drawn(values: Array) -> Array:
    """(13,) draws in the order of the states; drawn in the paper's: velocity, position, attitude, accelerometers, gyros."""
    x = np.empty(STATES)
    x[DV], x[DP], x[PHI], x[BA], x[BG] = np.split(values, [2, 4, 7, 10])
    return x


def sail(interval: float, seed: int, run: int = 0, scenario: str = "marine_damping") -> Voyage:
    """A shipped scenario of a ship that keeps its course, sampled at an interval (s).

    Its motion is smooth: an IMU and a log at 1 Hz lose nothing (3 cm in two days). The IMU sits with its axes east, north,
    up (the paper's heading 0), not along the hull.
    """
    ideal = read_scenario(scenario).model_copy(update={"rate": 1.0 / interval}).ideal()
    at = ideal.motion.states(ideal.edges)
    C = at.C_nb[0]  # the ship keeps its course: this mounting has the heading 0 throughout
    ideal = replace(ideal, dtheta=ideal.dtheta @ C.T, dvel=ideal.dvel @ C.T)
    truth = Track.along(replace(at, C_nb=at.C_nb @ C.T))
    noise = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3, run))).standard_normal((len(at.lat), 2))
    return Voyage(ideal, truth, LOG_NOISE / math.sqrt(interval) * noise)
