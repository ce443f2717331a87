"""The epoch of an answer: any time within the log, of any IMU."""

import numpy as np
import pytest

import truenorth as tn
from tests.helpers import raises_naming
from tests.runs import some
from truenorth.simulation import rest, simulate

PLACE = tn.Position.from_degrees(45.0, 7.0, 300.0)
PITCH, ROLL = np.radians([2.0, -3.0])


@pytest.fixture(scope="module")
def log():
    return simulate(
        rest(PLACE, 1.0, PITCH, ROLL), rate=50.0, duration=300.0, start=20.0, imu="industrial", seed=5
    ).record


@pytest.mark.parametrize("imu", ["industrial", None])
@pytest.mark.parametrize("at", some([20.02, 20.027, 140.027, 200.0, 319.997], [139.997, 140.02, 200.013, 320.0]))
def test_gyros_that_do_not_see_the_earth_turn_level_at_any_time(log, imu, at):
    """Two minutes before the epoch are taken, and one between two samples lay outside them; so did the first sample."""
    answer = tn.align(log, PLACE, imu, at=at)
    assert answer.status == "level_only"
    assert answer.time == at
    off = np.array([answer.pitch - PITCH, answer.roll - ROLL])
    assert np.all(np.abs(off) < 4.0 * answer.euler_sigma[1:])


def test_where_the_log_ends_so_do_its_epochs(log):
    for at in (20.01, 320.01):
        with raises_naming(tn.UsageError, "outside the log", "20.02 s to 320 s"):
            tn.align(log, PLACE, "industrial", at=at)
