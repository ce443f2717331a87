"""Fixes of a centimetre of an antenna whose arm nobody has said: it is found together with heading, neither too surely."""

import numpy as np
import pytest

from benchmarks.honesty.circling import drawn_start
from tests.runs import some
from truenorth import Gnss
from truenorth.core.earth import radii
from truenorth.core.position import Position
from truenorth.navigation import navigate
from truenorth.records import GnssRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn
from truenorth.state.track import Track

PLACE = Position.from_degrees(48.0, 11.0)
ARM = np.array([0.2, -0.5, 1.0])
FIX, SPEED, SECONDS = 0.02, 0.05, 150.0


def mower(rng):
    """Lanes of some metres, half a turn at the end of each."""
    legs = straight(5.0)
    for side in (1.0, -1.0, 1.0, -1.0, 1.0):
        lane = [*accelerate(1.0, 0.5, 0.0), *straight(rng.uniform(8.0, 15.0))]
        legs += [*lane, *turn(np.radians(180.0 * side), np.radians(25.0)), *accelerate(0.0, 0.5, 1.0)]
    return course(PLACE, legs, heading=rng.uniform(-3.0, 3.0))


def received(motion, rng):
    time = np.arange(0.5, SECONDS - 0.5)
    s = motion.states(time)
    noise = rng.standard_normal((2, len(time), 3))
    off = np.einsum("kij,j->ki", s.C_nb, ARM) + FIX * noise[0]
    v_n = s.v_n + np.einsum("kij,kj->ki", s.C_nb, np.cross(s.w_ib_b, ARM)) + SPEED * noise[1]
    R_M, R_N = radii(s.lat[0])
    lat, lon = s.lat + off[:, 1] / R_M, s.lon + off[:, 0] / (R_N * np.cos(s.lat))
    sigmas = {"position_sigma": np.full(off.shape, FIX), "velocity_sigma": np.full(off.shape, SPEED)}
    return Gnss(GnssRecord(time, lat, lon, s.alt + off[:, 2], v_n, **sigmas))


@pytest.mark.parametrize(
    ("grade", "seed"),
    some([("industrial", 1)], [(grade, seed) for grade in ("tactical", "industrial") for seed in range(8)]),
)
def test_a_mower_whose_antenna_is_anywhere(grade, seed):
    """The product of an arm's error and heading's passed for knowledge: 6.0 sigmas, and logs that were refused."""
    rng, spec = np.random.default_rng([9, seed]), imu_spec(grade)
    motion = mower(rng)
    record = simulate(motion, rate=50.0, duration=SECONDS, imu=spec, seed=seed).record
    aid = received(motion, rng)
    answer = navigate(record, drawn_start(motion, spec, rng), imu=spec, aid=aid)
    off = answer.track.errors_against(Track.along(motion.states(answer.time))) / answer.track.sigma[:, :9]
    assert answer.status == "navigated"
    assert np.abs(off).max() < 5.5
    assert np.sqrt(np.mean(off[:, 2] ** 2)) < 2.5
