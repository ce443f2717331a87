"""Terms of a specification that are another name for what the filter knows: the answer is the same, to the last digit."""

import math
from dataclasses import replace

import numpy as np
import pytest

import truenorth
from truenorth.core.position import Position
from truenorth.errors.model import InsModel
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

BASE = imu_spec("navigation")
POSITION = Position.from_degrees(40.0, 118.0)


@pytest.fixture(scope="module")
def record():
    return simulate(rest(POSITION, 0.6), imu=BASE, rate=50.0, duration=200.0, seed=4).record


@pytest.mark.parametrize(
    ("named", "other"),
    [
        ({"gyro_bias": 5e-8}, {"gyro_bias": 3e-8, "gyro_turn_on_bias": 4e-8}),
        ({"accel_bias": 5e-4}, {"accel_bias": 4e-4, "accel_turn_on_bias": 3e-4}),
        ({"gyro_random_walk": 5e-7}, {"gyro_random_walk": 3e-7, "gyro_sample_noise": 4e-7 * math.sqrt(50.0)}),
        ({"accel_random_walk": 5e-4}, {"accel_random_walk": 0.0, "accel_sample_noise": 5e-4 * math.sqrt(50.0)}),
        # A Gauss-Markov bias that forgets at once spreads as a random walk; its own variance is nothing.
        (
            {"gyro_bias_instability": 0.0, "accel_bias_instability": 0.0, "gyro_rate_random_walk": 1e-9},
            {
                "gyro_bias_instability": 1e-9 * math.sqrt(0.5e-8),
                "accel_bias_instability": 0.0,
                "correlation_time": 1e-8,
            },
        ),
    ],
    ids=["turn-on", "accelerometer turn-on", "sample noise", "accelerometer sample noise", "rate random walk"],
)
def test_the_same_under_another_name(record, named, other):
    one, two = (
        truenorth.align(record, POSITION, imu=replace(BASE, **terms), method="kalman") for terms in (named, other)
    )
    np.testing.assert_allclose(two.phi_covariance, one.phi_covariance, rtol=1e-9)
    np.testing.assert_allclose(two.gyro_bias_sigma, one.gyro_bias_sigma, rtol=1e-9)
    plain = truenorth.align(record, POSITION, imu=BASE, method="kalman")
    assert abs(plain.phi_covariance[2, 2] / one.phi_covariance[2, 2] - 1) > 1e-6


def test_the_navigator_knows_the_rate_random_walk():
    model = InsModel.from_spec(replace(BASE, gyro_rate_random_walk=1e-10, accel_rate_random_walk=1e-7))
    assert (model.gyro_rate_walk, model.accel_rate_walk) == (1e-10, 1e-7)
