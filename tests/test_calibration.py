"""A calibration undoes exactly the errors it states."""

import numpy as np
import pytest

from tests.helpers import raises_naming
from truenorth.core.errors import DataError
from truenorth.records import ImuRecord
from truenorth.records.calibration import Calibration

FILE = """
gyro:
  bias: [1.2 deg/h, -0.4 deg/h, 3 deg/s]
  scale_factor: [100 ppm, 0 ppm, -1 %]
accel:
  bias: [1 mg, 0 mg, -2 mg]
  misalignment: [[0 arcsec, 20 arcsec, 0 arcsec], [5 arcmin, 0 deg, 0 deg], [0 deg, 1 deg, 0 deg]]
"""


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_undoes_the_stated_errors(tmp_path, kind):
    path = tmp_path / "cal.yaml"
    path.write_text(FILE)
    calibration = Calibration.from_file(path)
    assert calibration.gyro_bias[0] == pytest.approx(np.radians(1.2) / 3600)
    assert calibration.accel_misalignment[1, 0] == pytest.approx(np.radians(5 / 60))

    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.008, 0.012, 50))
    gyro, accel = rng.standard_normal((2, 50, 3))
    steps = ImuRecord(time, gyro, accel, kind).steps[:, None]
    T = steps if kind == "increments" else 1.0
    measured = ImuRecord(
        time,
        gyro @ (np.eye(3) + np.diag(calibration.gyro_scale_factor)).T + T * calibration.gyro_bias,
        accel @ (np.eye(3) + calibration.accel_misalignment).T + T * calibration.accel_bias,
        kind,
    )
    back = calibration.apply(measured)
    np.testing.assert_allclose(back.gyro, gyro, atol=1e-14)
    np.testing.assert_allclose(back.accel, accel, atol=1e-14)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gyro: {bias: [1 deg/h, 2 deg/h]}", ["gyro.bias", "(2,)", "(3,)"]),
        ("gyro: {bias: [1 ug, 2 ug, 3 ug]}", ["gyro.bias", "angular rate"]),
        ("gyro: {drift: [1 deg/h]}", ["drift", "scale_factor"]),
        ("wheel: {bias: [1 deg/h]}", ["wheel"]),
        ("accel: {misalignment: [[1 deg, 0 deg, 0 deg], [0 deg, 0 deg, 0 deg], [0 deg, 0 deg, 0 deg]]}", ["diagonal"]),
        ("[1, 2", ["YAML"]),
        ("gyro: {scale_factor: [-100 %, 0 ppm, 0 ppm]}", ["gyro", "as large as what is measured"]),
        ("gyro: {bias: [1, 2, 3]}", ["gyro.bias", "no unit"]),
        ("gyro: 1 deg/h", ["gyro", "expected keys"]),
    ],
)
def test_bad_files_name_the_key(tmp_path, text, words):
    path = tmp_path / "cal.yaml"
    path.write_text(text)
    with raises_naming(DataError, "cal.yaml", *words):
        Calibration.from_file(path)
