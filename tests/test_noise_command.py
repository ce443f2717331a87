"""`truenorth noise`: the noise of a still log comes back, that of a moving base is not called the sensors'."""

import json

import numpy as np
import pytest

from truenorth.cli import app
from truenorth.formats import write_imu
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec

ARW, VRW = 2e-5, 1e-3  # rad/sqrt(s), m/s/sqrt(s)


@pytest.fixture
def still(tmp_path):
    rng, rate = np.random.default_rng(8), 50.0
    time = np.arange(1, 30_001) / rate
    gyro = ARW * np.sqrt(rate) * rng.normal(size=(len(time), 3)) + [3e-5, 4e-5, 5e-5]
    accel = VRW * np.sqrt(rate) * rng.normal(size=(len(time), 3)) + [0.0, 0.0, 9.81]
    write_imu(ImuRecord(time, gyro, accel), tmp_path / "still.csv")
    return tmp_path / "still.csv"


def run(capsys, *words):
    with pytest.raises(SystemExit) as stop:
        app([str(word) for word in words])
    return stop.value.code, capsys.readouterr().out


@pytest.mark.slow
def test_white_noise_comes_back_and_stands_in_both_files(still, tmp_path, capsys):
    code, out = run(capsys, "noise", still, "-o", tmp_path / "noise", "--json")
    assert code == 0
    rows = {(row["sensor"], row["term"]): row for row in json.loads(out)["noise"]}
    walk = rows["gyro", "random walk"]
    assert walk["unit"] == "deg/sqrt(h)"
    np.testing.assert_allclose(walk["value"], np.degrees(ARW) * 60.0, rtol=0.05)
    assert all(abs(v - np.degrees(ARW) * 60.0) < 5.0 * s for v, s in zip(walk["value"], walk["sigma"]))
    ours, kalibr = (imu_spec(tmp_path / "noise" / name) for name in ("imu.yaml", "kalibr.yaml"))
    assert ours.gyro_random_walk == pytest.approx(ARW, rel=0.1)
    assert kalibr.gyro_random_walk == pytest.approx(ARW, rel=0.1)
    assert kalibr.accel_random_walk == pytest.approx(VRW, rel=0.1)
    assert (tmp_path / "noise" / "noise.svg").stat().st_size > 1000


@pytest.mark.slow
def test_what_rest_does_not_show_is_not_zero(still, tmp_path, capsys):
    """The file of an IMU's noise names no bias: with zeros in it a log of the same IMU was inconsistent."""
    code, _ = run(capsys, "noise", still, "-o", tmp_path / "noise")
    assert code == 0
    for name in ("imu.yaml", "kalibr.yaml"):
        assert {"gyro_bias", "accel_bias", "gyro_scale_factor"} <= set(imu_spec(tmp_path / "noise" / name).unsaid)
    assert "unnamed" not in (tmp_path / "noise" / "imu.yaml").read_text()
    assert imu_spec(tmp_path / "noise" / "imu.yaml").gyro_random_walk == pytest.approx(ARW, rel=0.1)
    code, _ = run(capsys, "noise", still, "--like", "tactical", "-o", tmp_path / "like")
    assert imu_spec(tmp_path / "like" / "imu.yaml").unsaid == ()


@pytest.mark.parametrize("sway", [0.02, 0.5])  # deg, of a ship at the quay
def test_motion_is_not_the_sensors_noise(sway, tmp_path):
    from truenorth.core.errors import AlignmentError

    rng, rate = np.random.default_rng(5), 50.0
    time = np.arange(1, 15_001) / rate
    angle = np.radians(sway) * np.sin(2.0 * np.pi * time / 8.0)
    gyro = 1e-7 * rng.normal(size=(len(time), 3)) + 4e-5
    gyro[:, 1] += np.gradient(angle, time)
    accel = 1e-4 * rng.normal(size=(len(time), 3)) + 9.81 * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    write_imu(ImuRecord(time, gyro, accel), tmp_path / "quay.csv")
    with pytest.raises(AlignmentError, match=r"is motion, not the sensors' noise|nowhere 15 s at rest"):
        app(["noise", str(tmp_path / "quay.csv")], standalone_mode=False)
