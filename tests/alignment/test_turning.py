"""An IMU that turns in its log, with gyros that do not see the earth turn: level with an honest sigma, and no north."""

import numpy as np
import pytest

from tests import recordings
from tests.runs import some
from truenorth.alignment import align
from truenorth.core.position import Position
from truenorth.core.units import STANDARD_GRAVITY as G
from truenorth.simulation.scenario import read_scenario

RUNS = 8


def spinning(rng):
    tilt = {name: f"{rng.uniform(-3.0, 3.0):.3f} deg" for name in ("pitch", "roll")}
    return {
        "name": "spinning",
        "duration": f"{rng.uniform(30.0, 120.0):.0f} s",
        "position": {"lat": f"{rng.uniform(-55.0, 55.0):.3f} deg", "lon": "10 deg"},
        "motion": {"kind": "rest", **tilt},
        "imu": "consumer" if rng.random() < 0.5 else "industrial",
        "indexer": {"axes": [{"kind": "spin", "direction": "z", "rate": f"{rng.uniform(5.0, 30.0):.2f} deg/s"}]},
    }


@pytest.mark.parametrize("given", [True, False])
def test_level_of_a_spinning_imu_is_honest(given):
    """Squares over sigma of two axes, 8 runs: chi-square of 16, whose mean lies in .32 to 2.14 in 99 of 100 such tests."""
    squares = []
    for run in range(RUNS):
        scenario = read_scenario(spinning(np.random.default_rng([5, run])))
        simulation = scenario.simulate(seed=5, run=run)
        place = Position(scenario.position.lat, scenario.position.lon)
        answer = align(simulation.record, place, scenario.imu if given else None)
        assert answer.status == "level_only", answer.reasons
        assert np.degrees(answer.euler_sigma[0]) > 90.0
        up = simulation.motion.states(np.array(answer.time)).C_nb[2]
        tilt = answer.C_nb[:2] @ np.cross(answer.C_nb[2], up)
        squares.append(tilt**2 / np.diag(answer.phi_covariance)[:2])
    assert (0.32 if given else 0.15) < np.mean(squares) < 2.14
    assert np.max(squares) < 16.0


@pytest.mark.parametrize("start", some([0.0], [60.0, 100.0, 135.0]))
@pytest.mark.parametrize("imu", ["consumer", None])
def test_a_turntable_that_turns_while_the_log_runs(start, imu):
    """Up in body axes: the mean of the force as it swings about the axis, and the axis as the gyros show it."""
    record, position = recordings.mems_rotation_table()
    turning = (record.time > 130.0) & (record.time < 162.0)
    gyro = record.gyro[turning] - record.gyro[record.time < 125.0].mean(axis=0)
    angle = np.cumsum(gyro[:, 2]) * record.interval
    swing = np.column_stack([np.ones_like(angle), np.cos(angle), np.sin(angle)])
    _, c, s = np.linalg.lstsq(swing, record.accel[turning] / G, rcond=None)[0]
    axis = gyro.mean(axis=0) / gyro[:, 2].mean()
    up = axis + c * np.cos(angle[-1]) + s * np.sin(angle[-1])
    answer = align(record.between(start, 162.0), position, imu)
    assert answer.status == "level_only"
    tilt = answer.C_nb[:2] @ np.cross(answer.C_nb[2], up / np.linalg.norm(up))
    assert np.all(np.abs(tilt) < 3.0 * np.sqrt(np.diag(answer.phi_covariance)[:2]))
    # The gyros' own misalignment, which nothing shows, is the least that sigma can be.
    assert np.sqrt(answer.phi_covariance[0, 0]) > answer.imu.gyro_misalignment * 0.5
