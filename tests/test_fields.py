"""Options are fields of the models: each mark sets what is there, defaults agree, and no field of a model is forgotten."""

import math
from dataclasses import MISSING, fields
from importlib import import_module

import numpy as np
import pytest

from truenorth.aiding.aids import ANTENNA, WHEEL
from truenorth.alignment.transfer import ON_MASTER
from truenorth.cli.aiding_options import ByMaster, OnIndexer, OnTheMove, Turntable
from truenorth.cli.attitude_options import OfAttitude
from truenorth.cli.fields import MODELS, given, marks
from truenorth.cli.live_options import Aids, Turned
from truenorth.cli.navigate import Damping
from truenorth.cli.sensor_options import Sensors
from truenorth.core.errors import UsageError

GROUPS = (OnTheMove, ByMaster, OnIndexer, Turntable, OfAttitude, Sensors, Damping, Turned, Aids)
TEXTS = {
    "attitude_mounting": "1,2,3,0.5",
    "attitude_sigma": "0.1,0.3,300",
    "baseline": "90,1",
    "damping": "external",
    "delay": "30 ms,5 ms",
    "estimate": "scale,mounting,lever_arm,latency",
    "flexure": "3 arcmin,5 s",
    "gnss_drift": "2,60",
    "indexer_axes": "x,z",
    "indexer_sigma": "10 arcsec",
    "log_bias": "0.1 m/s",
    "log_drift": "0.5 m/s, 3 h",
    "log_mounting": "0.3 deg",
    "log_scale": "0.5 %",
    "magnetometer_iron": "10,3",
    "master_sigma": "tactical",
    "matching": "both",
    "mounting": "1,2,3",
}
ARMS = ("lever_arm", "wheel_arm", "antenna_arm")
USUAL = {"wheel": WHEEL, "antenna": ANTENNA, "on master": ON_MASTER}

ELSEWHERE = "another option, or the log itself"
ONE_VALUE = "one value serves every log that is known; the library takes another"
NOT_SAID = {
    "Mounting": {
        "gate": ONE_VALUE,
        "slip": ONE_VALUE,
        "compliance": ONE_VALUE,
        "velocities": "found in the log; a latency that is said is that of places and velocities",
        "drift": "found in the log, wherever the latency is not said",
    },
    "Barometer": {"record": ELSEWHERE, "mounting": "the weather's usual error"},
    "Attitude": {"record": ELSEWHERE},
    "Magnetometer": {
        "record": ELSEWHERE,
        "field": "from place and date",
        "noise": ONE_VALUE,
        "anomaly": ONE_VALUE,
        "anomaly_distance": ONE_VALUE,
        "mounting": "axes of its log",
    },
    "Master": {
        "record": ELSEWHERE,
        "mounting": "the part 'on master'",
        "velocity_noise": "fitted",
        "attitude_noise": "fitted",
        "position_noise": "fitted",
        "acceleration_noise": "fitted",
        "heading": "found",
    },
    "Indexer": {"record": ELSEWHERE, "offset_sigma": ONE_VALUE, "latency_sigma": ONE_VALUE},
    "Positions": {"record": ELSEWHERE},
}


def model(part):
    module, _, name = MODELS[part].partition(":")
    return getattr(import_module(module), name)


def text_of(name, group):
    if name in ARMS:
        return "1,2,3"
    kind = next(field.type for field in fields(group) if field.name == name)
    return TEXTS.get(name, True if kind == "bool" else 0.25)


def said(group, name, part):
    mark = next(mark for field, mark in marks(group) if field == name and mark.part == part)
    return mark.read(text_of(name, group), f"--{name}")


MARKS = [(group, name, mark.part) for group in GROUPS for name, mark in marks(group)]


def test_every_part_has_options():
    assert {part for _, _, part in MARKS} == set(MODELS)


@pytest.mark.parametrize(("group", "name", "part"), MARKS, ids=lambda x: getattr(x, "__name__", x))
def test_an_option_sets_fields_of_its_model(group, name, part):
    found = said(group, name, part)
    known = {field.name for field in fields(model(part))}
    assert found
    assert set(found) <= known, f"--{name} sets {set(found) - known}, which {model(part).__name__} has not"


def test_every_field_of_a_model_is_an_option_or_has_a_reason():
    reached = {}
    for group, name, part in MARKS:
        reached.setdefault(model(part), set()).update(said(group, name, part))
    for each, names in reached.items():
        reasons = NOT_SAID.get(each.__name__, {})
        assert {field.name for field in fields(each)} == names | set(reasons), each.__name__
        assert not names & set(reasons), each.__name__


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.__name__)
def test_what_is_not_given_is_as_the_model_has_it(group):
    untouched = group()
    for part in {part for where, _, part in MARKS if where is group}:
        defaults = USUAL.get(part) or model(part)
        for name, value in given(untouched, part).items():
            usual = getattr(defaults, name, MISSING)
            assert usual is not MISSING, (part, name)
            np.testing.assert_equal(value, usual, err_msg=f"{part} {name}")


def test_an_arm_to_the_imu_is_the_opposite_of_one_from_it():
    from_imu = given(OnTheMove(antenna_arm="1,2,3"), "antenna")["lever_arm"]
    to_imu = given(OnIndexer(lever_arm="1,2,3"), "on master")["lever_arm"]
    np.testing.assert_array_equal(from_imu, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(to_imu, -from_imu)


def test_an_arm_from_the_master_is_known_to_a_metre_unless_something_else_is_said():
    assert given(OnIndexer(lever_arm="1,2,3"), "on master")["lever_arm_sigma"] == 1.0
    for sigma in (None, 0.1):
        by, arm = ByMaster(lever_arm_sigma=sigma), OnIndexer(lever_arm="1,2,3")
        assert by.mounted(arm).lever_arm_sigma == (1.0 if sigma is None else sigma)
    assert ByMaster().mounted().lever_arm_sigma == 5.0


def test_of_two_options_of_one_field_the_later_holds():
    known = given(Sensors(wheel_arm="1,2,3"), "wheel")
    doubtful = given(Sensors(wheel_arm="1,2,3", estimate="lever-arm"), "wheel")
    assert known["lever_arm_sigma"] == 0.0
    assert doubtful["lever_arm_sigma"] == 2.0


def test_a_log_s_drift_without_a_time_is_one_to_be_found():
    assert given(Sensors(log_drift="0.5 m/s"), "log") == {"drift": 0.5, "drift_time": None}
    assert given(ByMaster(delay="30 ms"), "on master").get("latency_sigma") is None


def test_degrees_are_radians_inside():
    assert given(OnTheMove(mounting_sigma=2.0), "wheel")["angle_sigma"] == math.radians(2.0)
    np.testing.assert_allclose(given(OfAttitude(attitude_sigma="0.1"), "attitude")["noise"], math.radians(0.1))


@pytest.mark.parametrize(
    ("group", "part", "named"),
    [
        (OnTheMove(wheel_arm="1,2"), "wheel", "--wheel-arm"),
        (Sensors(gnss_drift="2,0"), "antenna", "--gnss-drift"),
        (Sensors(estimate="speed"), "wheel", "--estimate"),
        (ByMaster(flexure="3 arcmin"), "master", "--flexure"),
        (OfAttitude(magnetometer_iron="ten"), "magnetometer", "--magnetometer-iron"),
    ],
)
def test_a_text_that_is_no_field_names_its_option(group, part, named):
    with pytest.raises(UsageError, match=named):
        given(group, part)
