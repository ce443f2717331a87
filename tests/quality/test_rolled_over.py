"""Gravity at a range's end may have rolled over; that of a sensor with a range of its own has not."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES
from truenorth.quality.rolled_over import rolled_over_evidence
from truenorth.records import ImuRecord


def at_rest(range_of, *, bias=0.0, seed=1):
    """An IMU at rest whose counter ends at so many times gravity, and goes on at the other end."""
    rng, half = np.random.default_rng(seed), 2**15
    force = [0.05, -0.1, 9.8 + bias] + 1e-3 * rng.standard_normal((4000, 3))
    step = 9.8 * range_of / half
    counts = (np.round(force / step) + half) % (2 * half) - half
    gyro = 1e-5 * rng.standard_normal((4000, 3))
    return ImuRecord(0.01 * np.arange(1.0, 4001.0), gyro, counts * step, "rates")


@pytest.mark.parametrize("range_of", [0.95, 0.97, 0.99])
def test_gravity_beyond_the_range_is_warned_of(range_of):
    record = at_rest(range_of)
    assert record.accel[:, 2].max() < 0.0
    (found,) = rolled_over_evidence(record)
    assert found.urgent
    assert found.figures["name"] == "accel_z"


@pytest.mark.parametrize("range_of", [1.2, 2.0, 4.0, 16.0])
def test_a_sensor_that_holds_gravity_is_not(range_of):
    for seed in range(10):
        assert rolled_over_evidence(at_rest(range_of, bias=0.05, seed=seed)) == []


def test_nor_one_without_counts():
    record = at_rest(0.97)
    noise = 1e-6 * np.random.default_rng(2).standard_normal(record.accel.shape)
    assert rolled_over_evidence(replace(record, accel=record.accel + noise)) == []


SI = [(120.0, 1e-8), (125.0, 1e-8), (128.0, 1e-8), (320.0, 1e-6), (333.0, 1e-6), (31.25, 1e-5)]
IN_G = [(125.0, 9.80665e-9), (128.0, 9.80665e-9), (31.25, 9.80665e-6)]


@pytest.mark.parametrize(("rate", "step"), SI + IN_G)
def test_nor_a_text_whose_digits_come_near_a_half_range(rate, step):
    """Velocity increments of 8 decimals at 120 Hz are 8.17 million steps, of 8.39."""
    rng = np.random.default_rng(3)
    force = ([0.05, -0.1, 9.80665] + 3e-3 * rng.standard_normal((4000, 3))) / rate
    gyro, time = 1e-7 * rng.standard_normal((4000, 3)), np.arange(1.0, 4001.0) / rate
    assert rolled_over_evidence(ImuRecord(time, gyro, step * np.round(force / step), "increments")) == []
    other = 1.001 * step  # as near, and no text
    assert rolled_over_evidence(ImuRecord(time, gyro, other * np.round(force / other), "increments")) != []


def test_an_imu_of_which_nothing_is_said_does_not_lie_upside_down_in_silence():
    """Its level was 143 of its sigmas off, `level_only`."""
    inputs, _ = BENCHES["unspecified"].draw(307, 21)
    record = inputs["record"]
    half, end = 2**15, 0.996 * float(np.abs(record.accel).max())
    counts = (np.round(record.accel * half / end) + half) % (2 * half) - half
    sound, spoilt = (align(log, inputs["place"]) for log in (record, replace(record, accel=counts * end / half)))
    assert not any(item.key == "record.rolls_over" for item in sound.evidence)
    assert any(item.key == "record.rolls_over" for item in spoilt.evidence)
