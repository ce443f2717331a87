"""A velocity log alone, live: what its curve makes of the place is summed as the rows come, and goes on from a saved run."""

import json
import math

import numpy as np
import pytest

import truenorth as tn
from truenorth.live import Navigator
from truenorth.live.feeds import VelocityFeed
from truenorth.live.outputs import json_line
from truenorth.navigation import Start
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight, turn
from truenorth.state.mounting import Mounting

PLACE, SPEC, SPAN = tn.Position.from_degrees(48.0, 11.0, 0.0), imu_spec("industrial"), 120.0
SIGMA = np.repeat([3e-3, 0.01, 3.0, SPEC.gyro_bias, SPEC.accel_bias], 3)
SIGMA[2:5] = 0.3, 3.0, 3.0  # rad and m/s: heading is hardly known, so that the curve counts


@pytest.fixture(scope="module")
def ship():
    """Log, start, and what a log along two axes says each second."""
    motion = course(PLACE, [*straight(60.0), *turn(1.0, 0.05), *straight(100.0)], heading=0.7, speed=6.0)
    log, t = simulate(motion, rate=20.0, duration=SPAN, imu=SPEC, seed=1).record, np.arange(1.0, SPAN - 1.0)
    begin, q = motion.states(0.0), motion.states(t)
    zero = np.zeros(3)
    start = Start(0.0, begin.C_nb, begin.v_n, PLACE.lat, PLACE.lon, 0.0, zero, zero, np.diag(SIGMA**2))
    seen = np.einsum("kji,kj->ki", q.C_nb, q.v_n) + np.random.default_rng(1).normal(0.0, 0.03, (len(t), 3))
    seen[:, 2] = np.nan
    return log, start, t, seen


def run_of(start):
    return Navigator(start, SPEC, feeds=[VelocityFeed(mounting=Mounting())], altitude="fixed", kind="rates")


def fed(run, ship, rows, since=0.0, until=math.inf):
    log, _, t, seen = ship
    for first in range(0, len(log), rows):
        part = log[first : first + rows]
        if since < part.time[0] and part.time[-1] <= until:
            run.push(part.time, part.gyro, part.accel)
            now = (t > part.time[0] - part.interval) & (t <= part.time[-1])
            run.feeds["velocity"].push(t[now], seen[now])
    return run


def test_what_has_come_counts_once_whoever_asks_and_in_a_run_that_was_saved(ship, tmp_path):
    whole = fed(run_of(ship[1]), ship, 20)
    half = fed(run_of(ship[1]), ship, 20, until=60.0)
    half.save(tmp_path / "run.npz")
    again = fed(Navigator.load(tmp_path / "run.npz"), ship, 20, since=60.0)
    assert np.array_equal(again.answer.motion.position_sigma, whole.answer.motion.position_sigma)
    answer = whole.answer
    end = whole.finish().track
    np.testing.assert_allclose(end.sigma[-1, 6:8], answer.motion.position_sigma[:2], rtol=0.05)
    # Heading is known to some 17 deg: 720 m of way may have led aside by that.
    assert end.sigma[-1, 6:8].max() > 100.0


def test_where_height_is_held_nobody_knows_the_vertical_velocity(ship):
    answer = fed(run_of(ship[1]), ship, 200, until=30.0).answer
    assert np.isnan(answer.motion.v_sigma).tolist() == [False, False, True]
    said = json.loads(json_line(answer))
    assert said["v_n_sigma_m_s"] == [*answer.motion.v_sigma[:2], None]
