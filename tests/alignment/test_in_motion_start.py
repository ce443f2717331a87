"""The state from which a pass over a log on the move begins."""

import numpy as np
import pytest

from truenorth.alignment.in_motion_start import GNSS_START, Guess, start_at
from truenorth.core.position import Position
from truenorth.records import GnssRecord, ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.state.layout import DV
from truenorth.state.mounting import Mounting

SPEC = imu_spec("tactical")


@pytest.mark.parametrize(
    ("mounting", "arm"), [({"lever_arm": np.array([0.0, 3.0, 4.0])}, 5.0), ({"lever_arm_sigma": 2.0}, 3.46)]
)
def test_an_antenna_that_swings_does_not_show_the_velocity_of_the_imu(mounting, arm):
    """Rolling by 15 deg/s RMS on an arm of 5 m: 1.3 m/s that the IMU does not have, and by .3 m/s of sigma were rejected."""
    dt, size = 0.01, np.radians(15.0) * np.sqrt(2.0)
    time = dt * np.arange(1, 2001)
    gyro = size * np.sin(2.0 * np.pi * time)[:, None] * [0.0, 1.0, 0.0]
    record = ImuRecord(time, dt * gyro, np.tile([0.0, 0.0, 9.8 * dt], (len(time), 1)), kind="increments")
    fixes = np.arange(0.0, 20.0)
    gnss = GnssRecord(fixes, 0.0 * fixes + 0.8, 0.0 * fixes, 0.0 * fixes, v_n=np.zeros((len(fixes), 3)))
    guess = Guess(np.eye(3), 0.01, 0.1)
    place = Position(0.8, 0.0, 0.0)
    start = start_at(record, guess, place, SPEC, None, gnss, Mounting(), Mounting(**mounting))
    still = start_at(record, guess, place, SPEC, None, gnss, Mounting(), Mounting())
    assert np.sqrt(np.diag(still.P)[DV]) == pytest.approx(GNSS_START)
    assert np.sqrt(np.diag(start.P)[DV]) == pytest.approx(np.hypot(GNSS_START, arm * np.radians(15.0)), rel=0.01)
