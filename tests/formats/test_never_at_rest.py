"""Logs that never rest: a leg that walks, a hand that waves. What they turn by is no noise, and their mean rate no bias."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from tests.formats.test_hand_moved import DEG, RATE, G, waved
from truenorth.formats import UnsureError, read_imu
from truenorth.formats.behaviour import SURE_GYRO, gyro_facts, gyro_readings

HEAD = "Counter,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z"
MT_MANAGER = "// Start Time: 0\n// Sample rate: 100.0Hz\n// Scenario: 4.9\n// Firmware Version: 2.5.1\n"


def walking(seed):
    """A leg in quick steps for 40 s, rad/s and m/s^2: the force of its steps hides the most of gravity's turn."""
    rng, shape = np.random.default_rng(seed), (4000, 3)
    time = np.arange(1, shape[0] + 1) / RATE
    turn = gaussian_filter1d(rng.standard_normal(shape), 12.0, axis=0) * np.sqrt(2.0 * 12.0 * np.sqrt(np.pi))
    gyro = 80.0 * DEG * turn + 0.05 * DEG * rng.standard_normal(shape)
    push = gaussian_filter1d(rng.standard_normal(shape), 5.0, axis=0) * np.sqrt(2.0 * 5.0 * np.sqrt(np.pi))
    lean = 0.4 * np.sin(2.0 * np.pi * time)
    up = G * np.column_stack([np.sin(lean), np.zeros_like(lean), np.cos(lean)])
    step = 6.0 * (np.sin(2.0 * np.pi * time) > 0.5)
    return time, gyro, up + step[:, None] * push + 0.02 * rng.standard_normal(shape)


def write(path, gyro, accel, above="", head=HEAD):
    rows = np.column_stack([np.arange(len(gyro)) % 65536, accel, gyro])
    np.savetxt(path, rows, fmt="%.8g", delimiter=",", header=above + head, comments="")
    return path


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("of_gyro", "unit"), [(1.0, "rad/s"), (DEG, "deg/s")])
@pytest.mark.parametrize("log", [walking, waved])
def test_its_unit_is_not_that_in_which_it_seems_to_rest(log, seed, of_gyro, unit):
    """In rad/s a leg has the mean and, from row to row, the turns of a gyro in deg/s that rests."""
    time, gyro, accel = (part[700:4700] for part in waved(seed)) if log is waved else walking(seed)
    facts = gyro_facts(time, gyro / of_gyro, accel, "rates")
    for force in ("m/s^2", "g"):
        best = gyro_readings(facts, "rates", force)[0]
        assert best.unit == unit or best.probability < SURE_GYRO


def test_a_leg_is_asked_about(tmp_path):
    _, gyro, accel = walking(1)
    path = write(tmp_path / "leg.csv", gyro, accel)
    with pytest.raises(UnsureError, match=r"rates of a log that never rests are up to") as caught:
        read_imu(path, rate=RATE)
    assert {option["units"]["gyro"] for option in caught.value.options} == {"rad/s", "deg/s"}
    np.testing.assert_allclose(
        read_imu(path, rate=RATE, units=caught.value.options[0]["units"]).accel, accel, rtol=1e-6, atol=1e-6
    )


def test_mt_manager_writes_rad_per_second(tmp_path):
    _, gyro, accel = walking(1)
    record = read_imu(write(tmp_path / "MT.txt", gyro, accel, MT_MANAGER))
    np.testing.assert_allclose(record.gyro, gyro, rtol=1e-6, atol=1e-6)
    (said,) = [guess.why for guess in record.taken_for if guess.what == "unit of the gyros"]
    assert "MT Manager" in said


def test_a_log_that_contradicts_its_program_is_asked_about(tmp_path):
    """Someone turned the columns of an MT Manager's log to deg/s and kept the lines above them."""
    _, gyro, accel = (part[700:4700] for part in waved(1))
    with pytest.raises(UnsureError, match=r"not sure: deg/s"):
        read_imu(write(tmp_path / "MT.txt", gyro / DEG, accel / G, MT_MANAGER))


def test_the_app_sensor_logger_writes_rad_per_second(tmp_path):
    time, gyro, accel = walking(2)
    for name, values in (("Gyroscope", gyro), ("TotalAcceleration", accel)):
        stamps = np.round(1.7e18 + time * 1e9).astype(np.int64)
        rows = [f"{at},{t:.9g},{z:.9g},{y:.9g},{x:.9g}" for at, t, (x, y, z) in zip(stamps, time, values)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["time,seconds_elapsed,z,y,x", *rows]) + "\n")
    np.testing.assert_allclose(read_imu(tmp_path).gyro, gyro, rtol=1e-6, atol=1e-6)


def test_a_node_that_breaks_the_definition_of_its_message_is_asked_about(tmp_path):
    """sensor_msgs/Imu is in rad/s, and nodes of makers' boards fill it with deg/s: its names do not decide."""
    _, gyro, accel = walking(3)
    three = [f"field.angular_velocity.{x}" for x in "xyz"], [f"field.linear_acceleration.{x}" for x in "xyz"]
    head = ",".join(["field.header.seq", *three[1], *three[0]])
    for unit in (1.0, DEG):
        with pytest.raises(UnsureError, match="unit of the gyros is not sure"):
            read_imu(write(tmp_path / "imu.csv", gyro / unit, accel, head=head), rate=RATE)


def hovering(rng, rate=200.0):
    """A drone for a minute, rad/s and m/s^2: thrust along its own vertical hides gravity's turn, its rows shake."""
    shape = (int(60.0 * rate), 3)

    def gust(tau):
        return gaussian_filter1d(rng.standard_normal(shape), tau * rate, axis=0) * np.sqrt(
            2.0 * tau * rate * np.sqrt(np.pi)
        )

    gyro = 0.2 * gust(0.15) + [0.01, -0.01, -0.14] + 0.1 * rng.standard_normal(shape)
    accel = [0.0, 0.0, G] + [0.05, 0.05, 0.6] * gust(0.3) + 0.02 * rng.standard_normal(shape)
    return np.arange(1, shape[0] + 1) / rate, gyro, accel


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("of_gyro", "unit"), [(1.0, "rad/s"), (DEG, "deg/s")])
def test_a_drone_that_hovers(seed, of_gyro, unit):
    """Its rates of 10 deg/s in rad/s were taken for deg/s of a sensor at rest, of 32 times the earth's rate."""
    time, gyro, accel = hovering(np.random.default_rng(seed))
    facts = gyro_facts(time, gyro / of_gyro, accel, "rates")
    assert facts.restless
    best = gyro_readings(facts, "rates", "g")[0]
    assert best.unit == unit or best.probability < SURE_GYRO


def test_a_base_that_trembles_is_at_rest():
    """It turns as much, and no force goes to and fro."""
    time, gyro, accel = hovering(np.random.default_rng(1))
    at_rest = G * accel / np.linalg.norm(accel, axis=1, keepdims=True)
    assert not gyro_facts(time, gyro, at_rest, "rates").restless
    quiet = gyro_facts(time, 0.01 * np.random.default_rng(2).standard_normal(gyro.shape), accel, "rates")
    assert not quiet.restless
