"""A sensor that a hand picks up, waves and puts back: its rests say what the gyros are in, not the waving."""

from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from tests.runs import some
from truenorth.core.errors import UsageError
from truenorth.formats import read_imu

RATE, DEG, G = 100.0, np.pi / 180.0, 9.80665


@cache
def waved(seed: int):
    """Rates (rad/s) and specific forces (m/s^2) of a MEMS sensor: at rest, waved about for a minute, at rest."""
    rng = np.random.default_rng(seed)
    rest, moved, after = 6.0, 60.0, 14.0
    n = round((rest + moved + after) * RATE)
    time = np.arange(1, n + 1) / RATE
    swing = np.clip((time - rest) * 2.0, 0.0, 1.0) * np.clip((rest + moved - time) * 2.0, 0.0, 1.0)
    wave = gaussian_filter1d(rng.standard_normal((n, 6)), 25.0, axis=0) * np.sqrt(2.0 * 25.0 * np.sqrt(np.pi))
    gyro = rng.uniform(60.0, 150.0) * DEG * wave[:, :3] * swing[:, None]
    attitude, behind = Rotation.from_rotvec(gyro / RATE), 1
    while behind < n:  # products of 2, 4, 8 ... turns that end in each row
        attitude = Rotation.concatenate([attitude[:behind], attitude[:-behind] * attitude[behind:]])
        behind *= 2
    up = attitude.inv().apply([0.0, 0.0, G])
    accel = up + rng.uniform(2.0, 4.0) * wave[:, 3:] * swing[:, None]
    gyro = gyro + rng.uniform(-0.5, 0.5, 3) * DEG + 0.05 * DEG * rng.standard_normal((n, 3))
    return time, gyro, accel + 0.02 * rng.standard_normal((n, 3))


@pytest.mark.parametrize("seed", some(range(2), range(2, 4)))
@pytest.mark.parametrize(("of_gyro", "of_accel"), [(DEG, G), (1.0, 1.0)], ids=["deg/s, g", "rad/s, m/s^2"])
def test_waved_sensor(tmp_path, seed, of_gyro, of_accel):
    time, gyro, accel = waved(seed)
    table = np.column_stack([1e3 * time, accel / of_accel, gyro / of_gyro])
    head = "sys_time,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z"
    np.savetxt(path := tmp_path / "waved.csv", table, fmt="%.10g", delimiter=",", header=head, comments="")
    record = read_imu(path)
    np.testing.assert_allclose(record.gyro, gyro, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(record.accel, accel, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("spin", some([120.0, 400.0], [200.0]))
@pytest.mark.parametrize(("of_gyro", "of_accel"), [(DEG, G), (1.0, 1.0)], ids=["deg/s, g", "rad/s, m/s^2"])
def test_a_steady_spin_is_no_rest(tmp_path, spin, of_gyro, of_accel):
    """A turntable that turns forth and back for a minute each: its rate is as steady as a rest, which is half as long."""
    rng = np.random.default_rng(3)
    time = np.arange(1, 20001) / RATE
    turn = np.select(
        [time < 10.0, time < 70.0, time < 80.0, time < 140.0, time < 190.0], [0.0, 1.0, 0.0, -1.0, 0.3 * np.sin(time)]
    )
    gyro = 2e-4 * rng.standard_normal(3) + 5e-4 * rng.standard_normal((len(time), 3))
    gyro[:, 2] += spin * DEG * turn
    accel = [0.0, 0.0, G] + 0.02 * rng.standard_normal((len(time), 3))
    head = "time,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z"
    rows = np.column_stack([time, accel / of_accel, gyro / of_gyro])
    np.savetxt(path := tmp_path / "table.csv", rows, fmt="%.8g", delimiter=",", header=head, comments="")
    np.testing.assert_allclose(read_imu(path).gyro, gyro, rtol=1e-6, atol=1e-9)


def test_clock_that_stands_still(tmp_path):
    """A receiver without satellites repeats its time of week: no clock, and not a time that repeats."""
    _, gyro, accel = waved(1)
    rows = np.column_stack([np.arange(len(gyro)), np.full(len(gyro), 23296.0), accel / G, gyro / DEG])
    head = "pc_counter,gps_tow,acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z"
    np.savetxt(path := tmp_path / "no_sky.csv", rows, fmt="%.10g", delimiter=",", header=head, comments="")
    with pytest.raises(UsageError, match="no time in the log"):
        read_imu(path)
    np.testing.assert_allclose(read_imu(path, rate=RATE).gyro, gyro, rtol=1e-6, atol=1e-9)
