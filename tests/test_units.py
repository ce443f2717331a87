"""Units: every datasheet spelling against its value written out by hand, and what must be refused."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.helpers import raises_naming
from truenorth.core.errors import UsageError
from truenorth.core.units import DIMENSIONS, format, parse, parse_quantity, parse_unit

DEG = math.pi / 180
G = 9.80665

SPELLINGS = [
    ("0.01 deg/h", "angular_rate", 0.01 * DEG / 3600),
    ("0.01deg/h", "angular_rate", 0.01 * DEG / 3600),
    ("0.01 °/h", "angular_rate", 0.01 * DEG / 3600),
    ("0.01 º/hr", "angular_rate", 0.01 * DEG / 3600),
    ("1.5e-2 deg / hour", "angular_rate", 0.015 * DEG / 3600),
    ("10 dps", "angular_rate", 10 * DEG),
    ("-20.3 deg/s", "angular_rate", -20.3 * DEG),
    ("0.1 rad/s", "angular_rate", 0.1),
    ("10 deg·h⁻¹", "angular_rate", 10 * DEG / 3600),
    ("0.002 deg/sqrt(h)", "angle_random_walk", 0.002 * DEG / 60),
    ("0.002 deg/√h", "angle_random_walk", 0.002 * DEG / 60),
    ("0.002 °/√hr", "angle_random_walk", 0.002 * DEG / 60),
    ("0.002 deg/√(h)", "angle_random_walk", 0.002 * DEG / 60),
    ("0.002 deg/h^0.5", "angle_random_walk", 0.002 * DEG / 60),
    ("0.002 deg/h^(1/2)", "angle_random_walk", 0.002 * DEG / 60),
    ("0.12 deg/h/sqrt(Hz)", "angle_random_walk", 0.12 * DEG / 3600),
    ("0.12 (°/h)/√Hz", "angle_random_walk", 0.12 * DEG / 3600),
    ("0.005 deg/s/sqrt(Hz)", "angle_random_walk", 0.005 * DEG),
    ("3.8 mdps/√Hz", "angle_random_walk", 3.8e-3 * DEG),
    ("50 ug", "acceleration", 50e-6 * G),
    ("50 µg", "acceleration", 50e-6 * G),  # micro sign
    ("50 μg", "acceleration", 50e-6 * G),  # Greek mu
    ("8 mg", "acceleration", 8e-3 * G),
    ("5 g", "acceleration", 5 * G),
    ("9.81 m/s^2", "acceleration", 9.81),
    ("9.81 m/s²", "acceleration", 9.81),
    ("9.81 m/s2", "acceleration", 9.81),
    ("9.81 m·s⁻²", "acceleration", 9.81),
    ("5 mGal", "acceleration", 5e-5),
    ("10 ug/sqrt(Hz)", "velocity_random_walk", 10e-6 * G),
    ("10 µg/√Hz", "velocity_random_walk", 10e-6 * G),
    ("0.03 m/s/sqrt(h)", "velocity_random_walk", 0.03 / 60),
    ("0.03 m/s/√hr", "velocity_random_walk", 0.03 / 60),
    ("0.5 mm/s", "speed", 5e-4),
    ("36 km/h", "speed", 10.0),
    ("10 kn", "speed", 18520 / 3600),
    ("300 ppm", "ratio", 3e-4),
    ("0.5 %", "ratio", 5e-3),
    ("90 deg", "angle", math.pi / 2),
    ("3 arcmin", "angle", 3 * DEG / 60),
    ("3'", "angle", 3 * DEG / 60),
    ("3 ′", "angle", 3 * DEG / 60),
    ('5"', "angle", 5 * DEG / 3600),
    ("5″", "angle", 5 * DEG / 3600),
    ("5 arcsec", "angle", 5 * DEG / 3600),
    ("1 mrad", "angle", 1e-3),
    ("1 µrad", "angle", 1e-6),
    ("10 ms", "time", 0.01),
    ("5 min", "time", 300.0),
    ("2 h", "time", 7200.0),
    ("100 Hz", "frequency", 100.0),
    ("100 1/s", "frequency", 100.0),
    ("0.3 1", "ratio", 0.3),
    ("2 km", "length", 2000.0),
    ("5 cm", "length", 0.05),
    ("20 °C", "temperature", 20.0),
    ("1 deg/h/g", "rate_per_acceleration", DEG / 3600 / G),
    ("0.1 deg/h/°C", "rate_per_temperature", 0.1 * DEG / 3600),
    ("\N{MINUS SIGN}5 ug", "acceleration", -5e-6 * G),
]


@pytest.mark.parametrize(("text", "dimension", "value"), SPELLINGS)
def test_every_spelling_has_its_value(text, dimension, value):
    assert parse(text, dimension) == pytest.approx(value, rel=1e-14)


def test_examples_in_messages_are_of_their_own_dimension():
    for dimension, (_, example) in DIMENSIONS.items():
        assert parse(example, dimension) > 0.0


def test_no_two_dimensions_are_the_same():
    assert len({dimension for dimension, _ in DIMENSIONS.values()}) == len(DIMENSIONS)


@pytest.mark.parametrize(
    ("text", "dimension", "said"),
    [
        ("0.01 deg/sqrt(h)", "angular_rate", ["angle random walk", "angular rate", "0.01 deg/h"]),
        ("0.01 deg/h", "angle_random_walk", ["angular rate", "deg/sqrt(h)"]),
        ("0.01 deg/h", "frequency", ["angular rate", "frequency"]),  # an angle is no pure number
        ("1 /h", "angular_rate", ["0.01 deg/h"]),
        ("50 ug", "ratio", ["acceleration", "ppm"]),
        ("10 ug/Hz", "velocity_random_walk", ["speed", "ug/sqrt(Hz)"]),
        ("100 ppm", "angle", ["ratio", "angle"]),
        ("0.01", "angular_rate", ["no unit", "0.01 deg/h"]),
        (0.01, "angular_rate", ["no unit", "0.01 deg/h"]),
        (None, "angular_rate", ["no unit"]),
        (True, "ratio", ["no unit"]),
        ("deg/h", "angular_rate", ["number"]),
        ("nan deg/h", "angular_rate", ["number"]),
        ("inf deg/h", "angular_rate", ["number"]),
        ("1e400 deg/h", "angular_rate", ["finite"]),
        ("1e308 km", "length", ["finite"]),
        ("1+1 deg/h", "angular_rate", ["not one number"]),
        ("2*3 deg/h", "angular_rate", ["not one number"]),
        ("1/2 deg/h", "angular_rate", ["not one number"]),
        ("1,5 deg/h", "angular_rate", ["decimal point"]),
        ("1.2.3 deg/h", "angular_rate", ["not one number"]),
        ("1 2 deg/h", "angular_rate", ["not one number"]),
        ("1 deg/furlong", "angular_rate", ["'furlong'", "not known"]),
        ("1 arcsek", "angle", ["did you mean arcsec"]),
        ("1 deg/", "angular_rate", ["its end"]),
        ("1 deg//h", "angular_rate", ["'/h'"]),
        ("1 deg/sqrt(h", "angle_random_walk", ["parenthesis"]),
        ("1 m s^-1", "speed", ["not understood"]),  # never read as milliseconds
        ("1 s^400", "time", ["not understood"]),
        ("(0.12 deg/h)/sqrt(Hz)", "angle_random_walk", ["number"]),
        ("", "angle", ["number"]),
    ],
)
def test_what_is_refused_and_what_the_message_says(text, dimension, said):
    with raises_naming(UsageError, *said):
        parse(text, dimension)


def test_quantity_gives_its_dimension():
    value, dimension = parse_quantity("3 deg/h")
    assert value == 3 * parse_unit("deg/h")[0]
    assert dimension == DIMENSIONS["angular_rate"][0]


UNITS = ["deg/h", "deg/sqrt(h)", "ug", "ug/sqrt(Hz)", "mg", "ppm", "arcmin", "arcsec", "m/s/sqrt(h)", "°/√h", "km/h"]


@given(st.floats(1e-12, 1e12), st.sampled_from(UNITS), st.sampled_from([-1.0, 1.0]))
def test_format_and_parse_are_inverse(number, unit, sign):
    factor, dimension = parse_unit(unit)
    value, found = parse_quantity(format(sign * number * factor, unit, digits=None))
    assert found == dimension
    assert value == pytest.approx(sign * number * factor, rel=2e-15)


def test_format_is_what_a_person_would_write():
    assert format(parse("0.01 deg/h", "angular_rate"), "deg/h") == "0.01 deg/h"
    assert format(parse("30 mg", "acceleration"), "ug", digits=None) == "30000 ug"
    assert format(parse("30 mg", "acceleration"), "mg", digits=None) == "30 mg"
    assert format(1.0, "deg", digits=4) == "57.3 deg"
    assert format(0.0, "deg", digits=None) == "0 deg"


@settings(max_examples=40)
@given(st.text(max_size=12))
def test_any_text_is_a_quantity_or_a_usage_error(text):
    for candidate in (text, f"1 {text}"):
        try:
            value, _ = parse_quantity(candidate)
        except UsageError:
            continue
        assert math.isfinite(value)
