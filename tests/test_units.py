"""Datasheet spellings against values worked by hand, both ways, and what must not be read."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from truenorth.errors import DataError, UsageError
from truenorth.specs import ImuSpec, imu_spec
from truenorth.units import DIMENSIONS, format, parse, parse_quantity, parse_unit

DEG = math.pi / 180
G = 9.80665

SPELLINGS = [
    ("0.01 deg/h", "angular_rate", 0.01 * DEG / 3600),
    ("0.01deg/hr", "angular_rate", 0.01 * DEG / 3600),
    ("3 °/h", "angular_rate", 3 * DEG / 3600),
    ("300 deg/s", "angular_rate", 300 * DEG),
    ("0.05 deg/sqrt(h)", "angle_random_walk", 0.05 * DEG / 60),
    ("0.05 deg/√h", "angle_random_walk", 0.05 * DEG / 60),
    ("0.05 °/√hr", "angle_random_walk", 0.05 * DEG / 60),
    ("0.003 deg/s/sqrt(Hz)", "angle_random_walk", 0.003 * DEG),
    ("10 deg/h/sqrt(Hz)", "angle_random_walk", 10 * DEG / 3600),
    ("2 deg/h/sqrt(h)", "rate_random_walk", 2 * DEG / 3600 / 60),
    ("100 ug", "acceleration", 100e-6 * G),
    ("100 µg", "acceleration", 100e-6 * G),
    ("1 mg", "acceleration", 1e-3 * G),
    ("2 g", "acceleration", 2 * G),
    ("0.2 m/s^2", "acceleration", 0.2),
    ("0.2 m/s²", "acceleration", 0.2),
    ("10 ug/sqrt(Hz)", "velocity_random_walk", 10e-6 * G),
    ("10 µg/√Hz", "velocity_random_walk", 10e-6 * G),
    ("0.1 m/s/sqrt(h)", "velocity_random_walk", 0.1 / 60),
    ("50 ppm", "ratio", 50e-6),
    ("0.3 %", "ratio", 0.003),
    ("5 arcmin", "angle", 5 * DEG / 60),
    ("5'", "angle", 5 * DEG / 60),
    ("5 arcsec", "angle", 5 * DEG / 3600),
    ('5"', "angle", 5 * DEG / 3600),
    ("1.5 mrad", "angle", 1.5e-3),
    ("10 kn", "speed", 10 * 1852 / 3600),
    ("36 km/h", "speed", 10.0),
    ("20 ms", "time", 0.02),
    ("1 deg/h/g", "rate_per_acceleration", DEG / 3600 / G),
    ("+1.5e-3 deg", "angle", 1.5e-3 * DEG),
]


@pytest.mark.parametrize(("text", "dimension", "expected"), SPELLINGS)
def test_datasheet_spellings(text, dimension, expected):
    assert parse(text, dimension) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "dimension", "words"),
    [
        ("0.01 deg/sqrt(h)", "angular_rate", ["angle random walk", "0.01 deg/h"]),
        ("0.01 1/s", "angular_rate", ["angular rate", "0.01 deg/h"]),
        ("5 ug", "velocity_random_walk", ["acceleration", "10 ug/sqrt(Hz)"]),
        ("0.01", "angular_rate", ["no unit"]),
        ("nan deg/h", "angular_rate", ["number"]),
        ("inf deg/h", "angular_rate", ["number"]),
        ("1e999 deg/h", "angular_rate", ["finite"]),
        ("1+1 deg", "angle", ["1+1"]),
        ("2*3 deg", "angle", ["2*3"]),
        ("1 2 deg", "angle", ["1 2 deg"]),
        ("1 degg", "angle", ["degg", "deg"]),
        ("1 deg/", "angle", ["deg/"]),
        ("1 deg/sqrt(h", "angle_random_walk", ["deg/sqrt(h"]),
        ("deg", "angle", ["number"]),
        ("", "angle", ["number"]),
        (3, "angle", ["no unit"]),
    ],
)
def test_what_is_refused_and_how(text, dimension, words):
    with pytest.raises(UsageError) as error:
        parse(text, dimension)
    for word in words:
        assert word in str(error.value)


@given(st.floats(1e-9, 1e9), st.sampled_from(sorted({text.split(" ")[-1] for text, _, _ in SPELLINGS if " " in text})))
def test_both_ways(value, unit):
    factor, _ = parse_unit(unit)
    back, _ = parse_quantity(format(value * factor, unit, 17))
    assert back == pytest.approx(value * factor, rel=1e-12)


def test_every_dimension_has_a_right_example():
    for name, (_, example) in DIMENSIONS.items():
        parse(example, name)


def test_presets_are_ordered_and_whole():
    specs = [imu_spec(name) for name in ("navigation", "tactical", "industrial", "consumer")]
    for better, worse in zip(specs, specs[1:], strict=False):
        for key in ("gyro_bias", "gyro_random_walk", "accel_bias", "accel_random_walk"):
            assert 0 < getattr(better, key) < getattr(worse, key)
    assert specs[0].gyro_bias == pytest.approx(0.01 * DEG / 3600)


def test_a_file_reads_back(tmp_path):
    import yaml

    path = tmp_path / "mine.yaml"
    spec = imu_spec("tactical")
    path.write_text(yaml.safe_dump(spec.to_mapping()))
    again = imu_spec(path)
    assert again.name == "tactical"
    for key in ("gyro_bias", "accel_random_walk", "gyro_scale_factor", "correlation_time"):
        assert getattr(again, key) == pytest.approx(getattr(spec, key), rel=1e-5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gyro: {bais: 1 deg/h}", ["gyro.bais", "gyro.bias"]),
        ("gyro: {bias: 1 deg/sqrt(h)}", ["gyro.bias", "angular rate"]),
        ("gyro: {bias: -1 deg/h}", ["gyro.bias", "negative"]),
        ("gyroscope: {bias: 1 deg/h}", ["gyroscope", "gyro"]),
        ("gyro: 3", ["gyro", "bias"]),
        ("- a", ["groups"]),
        ("gyro: {bias: [", ["YAML"]),
    ],
)
def test_bad_specifications_name_the_key(tmp_path, text, words):
    path = tmp_path / "imu.yaml"
    path.write_text(text)
    with pytest.raises(DataError) as error:
        imu_spec(path)
    for word in ["imu.yaml", *words]:
        assert word in str(error.value)


def test_a_negative_value_is_refused():
    with pytest.raises(UsageError, match="gyro_bias"):
        ImuSpec(gyro_bias=-1.0)
    with pytest.raises(UsageError, match="neither a preset"):
        imu_spec("rocket")
