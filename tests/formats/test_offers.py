"""What a question offers is an answer as it stands: a command with it goes on, and keeps what was said before."""

import numpy as np
import pytest

from tests.formats.corpus.truth import truth
from tests.formats.test_field_logs import attitude, rows
from truenorth.core.errors import DataError
from truenorth.formats import UnsureError, read_gnss, read_imu

MOVED = truth("swaying", "tactical")


def answered(path, right, **options):
    """The record after the first of the options that holds what is `right` of each question; how many questions there were."""
    for asked in range(5):
        try:
            return read_imu(path, **options), asked
        except UnsureError as error:
            fits = [option for option in error.options if right.items() >= option.get("columns", {}).items()]
            options |= fits[0]  # or the question offers nothing that is right
    raise AssertionError(options)


def field(scale=1.0):
    """A magnetometer's counts, that turn with the base."""
    angles = np.radians(attitude(MOVED)[0])
    return scale * np.stack([0.3 * np.cos(angles[:, 2]), 0.3 * np.sin(angles[:, 2]), 0.9 + 0.1 * angles[:, 0]], axis=1)


def test_without_names_the_gyros_are_found_next_to_the_accelerometers_that_are_said(tmp_path):
    """Two sets of three show gravity, and each offer named three columns: with these alone the others were missing."""
    path = tmp_path / "log.txt"
    path.write_text(rows(MOVED.time, MOVED.accel, MOVED.gyro, 9.81 * field(), sep="\t"))
    right = dict(zip(("accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z"), "234567"))
    record, asked = answered(path, right)
    assert asked >= 1
    np.testing.assert_allclose(record.gyro, MOVED.gyro, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(record.accel, MOVED.accel, rtol=1e-6)


def test_the_accelerometers_are_found_next_to_gyros_that_are_said(tmp_path):
    path = tmp_path / "log.csv"
    head = "time,U1,U2,U3,V1,V2,V3,W1,W2,W3\n"
    path.write_text(head + rows(MOVED.time, MOVED.gyro, 0.02 * field(), MOVED.accel))
    record, asked = answered(path, {f"gyro_{x}": f"U{k}" for k, x in enumerate("xyz", 1)})
    assert asked == 1
    np.testing.assert_allclose(record.accel, MOVED.accel, rtol=1e-6)
    np.testing.assert_allclose(record.gyro, MOVED.gyro, rtol=1e-6, atol=1e-8)


def test_a_sign_that_is_said_stays(tmp_path):
    (path := tmp_path / "log.csv").write_text(rows(MOVED.time, MOVED.gyro, MOVED.accel * [1.0, -1.0, 1.0]))
    record = read_imu(path, columns={"accel_x": "5", "accel_y": "-6", "accel_z": "7"})
    np.testing.assert_allclose(record.accel, MOVED.accel, rtol=1e-6)
    np.testing.assert_allclose(record.gyro, MOVED.gyro, rtol=1e-6, atol=1e-8)


def test_an_offer_keeps_what_was_said(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(rows(MOVED.time, MOVED.time + 5.0, MOVED.accel, MOVED.gyro, 9.81 * field()))
    with pytest.raises(UnsureError, match="all increase like a clock") as caught:
        read_imu(path)
    said = caught.value.options[0]
    with pytest.raises(UnsureError) as caught:
        read_imu(path, **said)
    assert all(option["columns"].items() >= said["columns"].items() for option in caught.value.options)


def test_part_of_a_sensor_is_not_guessed(tmp_path):
    (path := tmp_path / "log.csv").write_text(rows(MOVED.time, MOVED.gyro, MOVED.accel))
    with pytest.raises(DataError, match="column 'gyro_x' is missing"):
        read_imu(path, columns={"accel_x": "5", "accel_y": "6"})


def test_a_latitude_without_a_longitude_is_named(tmp_path):
    """Places without a word of it were left out, and a velocity alone was used."""
    path = tmp_path / "gnss.csv"
    path.write_text("time,lat,lengthwise,VE,VN\n" + "\n".join(f"{k},48.0,11.0,1.0,0.5" for k in range(10)))
    with pytest.raises(DataError, match="expected lon next to lat; understood only time, lat"):
        read_gnss(path)
