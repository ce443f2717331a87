"""Whether the specific force is gravity's, of a base that swings: on a rope it is more, in the mean and along the rope."""

from types import SimpleNamespace

import numpy as np
import pytest

from truenorth import ImuRecord
from truenorth.alignment.check import force_size

G = 9.8


@pytest.mark.parametrize("angle", [0.0, 0.05, 0.13])
def test_a_load_that_swings_on_a_rope_is_as_heavy_as_gravity(angle):
    """8 m of rope, 20 s and more at a time: what the mean along the rope is beyond gravity, ``g A^2 / 4``, is not there."""
    time = np.arange(1, 30001) * 0.01
    w = np.sqrt(G / 8.0)
    swing, rate = angle * np.cos(w * time), -angle * w * np.sin(w * time)
    nothing = np.zeros_like(time)
    gyro = np.stack([rate, nothing, nothing], axis=1)
    accel = np.stack([nothing, nothing, G * np.cos(swing) + 8.0 * rate**2], axis=1)
    record = ImuRecord(time, gyro, accel, "rates", "a load")
    residual, noise = force_size(SimpleNamespace(record=record, interval=1.0, gravity=G))
    assert abs(residual) < 0.15 * G * angle**2 / 4.0 + 1e-9
    assert noise < 0.1 * G * angle**2 / 4.0 + 1e-9


def test_an_accelerometer_that_counts_too_much_is_seen_through_a_swing():
    time = np.arange(1, 20001) * 0.01
    rate = 0.1 * np.cos(2.0 * time)
    gyro = np.stack([rate, 0.0 * time, 0.0 * time], axis=1)
    accel = (
        1.001 * G * np.stack([0.0 * time, np.sin(0.05 * np.sin(2.0 * time)), np.cos(0.05 * np.sin(2.0 * time))], axis=1)
    )
    record = ImuRecord(time, gyro, accel, "rates", "a cradle")
    residual, noise = force_size(SimpleNamespace(record=record, interval=1.0, gravity=G))
    assert residual == pytest.approx(1e-3 * G, rel=0.05)
    assert noise < 0.1 * residual
