"""Options and the YAML file next to a log: names, units, axes, rate, kind."""

import numpy as np
import pytest

from tests.helpers import raises_naming
from truenorth.core.errors import DataError, UsageError
from truenorth.formats import read_imu

NAMES = ["time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
VALUES = np.column_stack([np.arange(0.1, 0.6, 0.1), np.arange(30.0).reshape(5, 6) + 1])
DEG, G = np.pi / 180, 9.80665


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.csv"
    np.savetxt(path, VALUES, delimiter=",", header=",".join(NAMES), comments="", fmt="%.17g")
    return path


def nearby(log, text):
    log.with_suffix(".yaml").write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    ("units", "time", "gyro", "accel"),
    [
        ("deg/s,g", 1.0, DEG, G),
        ("deg/h, mg, ms", 1e-3, DEG / 3600, 1e-3 * G),
        ({"gyro": "0.05 deg/s", "accel": "3.33 mg"}, 1.0, 0.05 * DEG, 3.33e-3 * G),
        ({"time": "us"}, 1e-6, 1.0, 1.0),
        ("dps,m/s²", 1.0, DEG, 1.0),
    ],
)
def test_units(log, units, time, gyro, accel):
    record = read_imu(log, units=units)
    np.testing.assert_allclose(record.time, time * VALUES[:, 0], rtol=1e-15)
    np.testing.assert_allclose(record.gyro, gyro * VALUES[:, 1:4], rtol=1e-15)
    np.testing.assert_allclose(record.accel, accel * VALUES[:, 4:], rtol=1e-15)


@pytest.mark.parametrize(
    ("axes", "signs", "order"),
    [
        ("FRD", [1, 1, -1], [1, 0, 2]),
        ("FLU", [-1, 1, 1], [1, 0, 2]),
        ("rfu", [1, 1, 1], [0, 1, 2]),
        ("FLD", [-1, 1, -1], [1, 0, 2]),
    ],
)
def test_axes(log, axes, signs, order):
    record = read_imu(log, axes=axes)
    np.testing.assert_array_equal(record.gyro, VALUES[:, 1:4][:, order] * signs)
    np.testing.assert_array_equal(record.accel, VALUES[:, 4:][:, order] * signs)


def test_kind_where_the_names_mislead(log):
    record = read_imu(log, kind="increments", units="arcsec,m/s")
    assert record.kind == "increments"
    np.testing.assert_allclose(record.gyro, VALUES[:, 1:4] * DEG / 3600, rtol=1e-15)


def test_the_file_next_to_and_the_options_that_win(log):
    nearby(log, "units: {gyro: deg/s}\naxes: FRD\nkind: increments\nrate: 10 Hz\n")
    with pytest.raises(UsageError, match="gyro increments cannot be in 'deg/s'"):
        read_imu(log)
    record = read_imu(log, kind="rates", axes="RFU")
    assert record.kind == "rates"
    np.testing.assert_allclose(record.gyro, VALUES[:, 1:4] * DEG, rtol=1e-15)


def test_a_rate_makes_the_time_that_is_missing(log):
    nearby(log, "columns: {time: none_here}\nrate: 50 Hz\n")
    np.testing.assert_allclose(read_imu(log).time, np.arange(1, 6) / 50, rtol=1e-15)
    np.testing.assert_allclose(read_imu(log, rate=100).time, np.arange(1, 6) / 100, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("unit: deg/s,g", ["'unit'", "did you mean 'units'"]),
        ("columns: [a, b]", ["columns", "gyro_x: wx"]),
        ("columns: {gyrox: wx}", ["'gyrox'", "did you mean 'gyro_x'"]),
        ("units: deg/s", ["'deg/s'", "deg/s,g"]),
        ("units: {gyros: deg/s}", ["'gyros'", "did you mean 'gyro'"]),
        ("rate: 0", ["rate", "100"]),
        ("rate: 10 s", ["frequency"]),
        ("rate: yes", ["rate"]),
        ("kind: speeds", ["'speeds'", "rates or increments"]),
        ("axes: [F, R, D]", ["axes"]),
        ("- a", ["list"]),
        ("a: [", ["line", "YAML"]),
    ],
)
def test_mistakes_in_the_file_next_to(log, text, words):
    nearby(log, text)
    with raises_naming(DataError, "log.yaml", *words):
        read_imu(log)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"units": "deg,g"}, ["gyro rates", "'deg'", "deg/h"]),
        ({"units": "deg/s,g,m"}, ["time", "'m'"]),
        ({"units": "deg/s,furlong"}, ["furlong"]),
        ({"units": "deg/s"}, ["deg/s,g"]),
        ({"axes": "FRB"}, ["one axis"]),
        ({"axes": "xyz"}, ["RFU"]),
        ({"rate": -1.0}, ["rate"]),
        ({"rate": float("nan")}, ["rate"]),
        ({"kind": "speeds"}, ["speeds"]),
        ({"columns": {"gyro": "gyro_x"}}, ["'gyro'", "arrays"]),
        ({"columns": {"gyrox": "wx"}}, ["did you mean 'gyro_x'"]),
    ],
)
def test_mistakes_in_the_options(log, options, words):
    with raises_naming(UsageError, *words):
        read_imu(log, **options)
