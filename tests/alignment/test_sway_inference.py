"""What begins within the log of a base that sways, and is no noise of its sensors."""

from dataclasses import replace

import numpy as np
import pytest

from tests import recordings
from tests.alignment.test_in_motion_recordings import FOG
from truenorth.alignment import align


@pytest.mark.parametrize("imu", [None, FOG])
def test_an_accelerometer_that_drifts_on_an_idling_car_is_no_noise(imu):
    """.5 mg within the last quarter: gyros 180 times as noisy as usual explained it, and level was that of the drift."""
    record, position = recordings.fog_gps_xian()
    course = np.maximum(np.arange(len(record)) / len(record) - 0.75, 0.0) / 0.25
    accel = record.accel.copy()
    accel[:, 1] += 0.005 * record.interval * course
    answer = align(replace(record, accel=accel), position, imu)
    assert answer.status == "inconsistent"
    keys = {item.key for item in answer.evidence}
    assert "bias.accel_steps" in keys
    assert "specification.gyro_noise" not in keys
