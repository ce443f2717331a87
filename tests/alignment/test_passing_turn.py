"""A base at rest that is turned slowly for a while: the turn is none of a bias, and a change of a bias is no turn."""

import math

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth import ImuRecord, align, imu_spec
from truenorth.alignment.passing_turn import means_at_rest, passing_turns
from truenorth.core.attitude import dcm_from_euler, misalignment
from truenorth.core.earth import EARTH_RATE, normal_gravity
from truenorth.core.position import Position
from truenorth.quality.regimes import motion_summary

PLACE = Position.from_degrees(50.0, 10.0)
DT, DURATION = 0.02, 300.0
HOUR = math.radians(1.0) / 3600.0


def log(rate, seed, bias=0.0, imu="navigation"):
    """A level IMU that turns about the vertical by `rate(t)` deg/s, `bias(t)` deg/h on z; its attitude at the end."""
    rng, spec = np.random.default_rng(seed), imu_spec(imu)
    n = round(DURATION / DT)
    t = DT * np.arange(1, n + 1)
    turning = np.radians(rate(t - 0.5 * DT))
    angle = np.cumsum(turning) * DT
    middle = angle - 0.5 * turning * DT
    north, up = EARTH_RATE * math.cos(PLACE.lat), EARTH_RATE * math.sin(PLACE.lat)
    gyro = np.column_stack([np.sin(middle) * north, np.cos(middle) * north, turning + up]) * DT
    accel = np.tile([0.0, 0.0, float(normal_gravity(PLACE.lat, 0.0))], (n, 1)) * DT
    constant = rng.standard_normal((2, 3))
    gyro += spec.gyro_bias * constant[0] * DT + spec.gyro_random_walk * math.sqrt(DT) * rng.standard_normal((n, 3))
    accel += spec.accel_bias * constant[1] * DT + spec.accel_random_walk * math.sqrt(DT) * rng.standard_normal((n, 3))
    gyro[:, 2] += HOUR * bias * (t > 0.5 * DURATION) * DT
    return ImuRecord(t, gyro, accel, "increments"), dcm_from_euler(-angle[-1], 0.0, 0.0)


def turn(size, begin=120.0, duration=14.0):
    """A rate of so many degrees over a time, which begins and ends within half a second."""
    return lambda t: size / duration * np.clip((t - begin) / 0.5, 0, 1) * np.clip((begin + duration - t) / 0.5, 0, 1)


@few_and_all(24, 1)
@pytest.mark.parametrize("size", [0.3, 2.5, -6.0])
def test_it_is_aligned_as_if_it_had_not_turned(runs, size):
    for seed in range(runs):
        record, C_nb = log(turn(size), seed)
        answer = align(record, PLACE, "navigation")
        assert answer.status == "aligned", answer.reasons
        assert np.abs(misalignment(answer.C_nb, C_nb) / np.sqrt(np.diag(answer.phi_covariance))).max() < 4.0


def test_a_rate_that_stays_is_no_passing_turn():
    for size in (5.0, 300.0):  # deg/h
        record, _ = log(lambda t: 0.0 * t, 1, bias=size)
        assert not passing_turns(motion_summary(record)).any()
        assert align(record, PLACE, "navigation").status == "inconsistent"
    record, _ = log(turn(3.0, DURATION - 10.0, 10.0), 1)  # nothing tells such a turn from a bias
    assert not passing_turns(motion_summary(record)).any()
    assert align(record, PLACE, "navigation").status == "inconsistent"


def test_the_rate_at_rest_is_that_of_the_other_seconds():
    record, _ = log(turn(3.0), 4)
    motion = motion_summary(record)
    turns = passing_turns(motion)
    assert set(np.flatnonzero(turns)) >= set(range(120, 134))
    assert turns.sum() < 19
    at_rest = means_at_rest(record, motion)
    assert abs(at_rest.w_ib_b[2] - EARTH_RATE * math.sin(PLACE.lat)) < 0.05 * HOUR
    assert abs(record.gyro[:, 2].sum() / DURATION - at_rest.w_ib_b[2]) > 30.0 * HOUR


def test_a_base_at_rest_has_none():
    for imu in ("navigation", "tactical", "consumer"):
        record, _ = log(lambda t: 0.0 * t, 2, imu=imu)
        assert not passing_turns(motion_summary(record)).any()
