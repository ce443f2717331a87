"""What begins within the log of a base that stays, and is no noise of its sensors and none of its base."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty import vehicles
from benchmarks.honesty.foreign import sensed
from tests import recordings
from tests.alignment.test_in_motion_recordings import FOG
from tests.runs import some
from truenorth.alignment import align
from truenorth.core.position import Position
from truenorth.records.specs import imu_spec


@pytest.mark.usefixtures("without_gyro_matrix")
@pytest.mark.parametrize("imu", some([FOG], [None]))
def test_an_accelerometer_that_drifts_on_an_idling_car_is_no_noise(imu):
    """.5 mg within the last quarter: gyros 180 times as noisy as usual explained it, and level was that of the drift, 5 sigmas off.

    It is seen; the answer is refused, or has in its sigma what the drift does.
    """
    record, position = recordings.fog_gps_xian()
    course = np.maximum(np.arange(len(record)) / len(record) - 0.75, 0.0) / 0.25
    accel = record.accel.copy()
    accel[:, 1] += 0.005 * record.interval * course
    sound, answer = align(record, position, imu), align(replace(record, accel=accel), position, imu)
    assert answer.status == "inconsistent" or np.all(np.abs(answer.euler - sound.euler) < 2.0 * answer.euler_sigma)
    keys = {item.key for item in answer.evidence}
    assert "bias.accel_steps" in keys
    assert "specification.gyro_noise" not in keys


def test_a_piece_that_is_missing_is_seen_though_the_noise_of_the_base_has_grown_by_it():
    """Fifteen seconds cut out while people got in: the base seemed to shake by 17 mm/s, and heading was 5 sigmas off."""
    record, position = recordings.fog_gps_xian()
    rows = np.r_[0:3400, 6400 : len(record)]
    time = record.time[0] + record.interval * np.arange(len(rows))
    cut = replace(record, time=time, gyro=record.gyro[rows], accel=record.accel[rows])
    assert align(cut, position, FOG).status == "inconsistent"
    assert align(record.between(record.time[0] - record.interval, 53.0), position, FOG).status == "aligned"


@pytest.mark.slow
@pytest.mark.parametrize(("vehicle", "seed", "run"), [(vehicles.raft, 77100, 2), (vehicles.gondola, 50210, 8)])
def test_biases_that_wander_as_promised_do_not_step(vehicle, seed, run):
    """A fit of the noise that knows no wander named steps of 1230 and 147 ug, with likelihood ratios of 39 and 47."""
    rng = np.random.default_rng([seed, run, 9])
    true = vehicle(rng, 300.0)
    answer = align(sensed(rng, true, imu_spec("tactical")), Position(*true.place.mean(axis=0).tolist()))
    assert answer.status != "inconsistent"
    assert not [item for item in answer.evidence if item.key == "bias.accel_steps" and item.kind == "bounded"]
