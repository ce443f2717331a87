"""Specifications of aiding sensors: into files and back to the bit, with units; wrong ones are named."""

from dataclasses import fields

import numpy as np
import pytest
from pydantic import TypeAdapter

from tests.simulation.made import LOADED, SENSORS
from truenorth.core import schema
from truenorth.core.errors import DataError
from truenorth.simulation import (
    EncoderSpec,
    FlexureSpec,
    GnssSpec,
    HeightSpec,
    MasterSpec,
    OdometerSpec,
    VelocityLogSpec,
)


@pytest.mark.parametrize("sensor", SENSORS)
def test_specifications_go_into_files_and_come_back(sensor):
    kind = SENSORS[sensor]
    assert kind.from_mapping(LOADED[sensor].to_mapping()) == LOADED[sensor]
    assert kind().to_mapping() == {}


QUANTITIES = [
    "Angle",
    "AngularRate",
    "Length",
    "Speed",
    "Acceleration",
    "AccelerationDensity",
    "Time",
    "Frequency",
    "Ratio",
]
KINDS = [*SENSORS.values(), FlexureSpec, EncoderSpec]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("number", [1 / 3, 1e-7 / 7, 0.07])
def test_any_value_comes_back_from_a_file_to_the_bit(kind, number):
    """Also where the unit of the file would round it; each term alone, as `simulate` writes the resolved scenario."""
    for item in fields(kind):
        if "dimensions" not in item.metadata:
            continue
        row = (number,) * len(item.metadata["dimensions"])
        given = row if len(row) > 1 else number
        if item.name in ("outages", "slips"):
            given = ((number, 1.0 + number, *row[2:]),)
        elif item.metadata["many"]:
            given = (row,)
        other = {"output": "pulses"} if item.name == "lost" else {}
        spec = kind(**{item.name: given}, **other)
        assert kind.from_mapping(spec.to_mapping()) == spec, item.name


@pytest.mark.parametrize("name", QUANTITIES)
@pytest.mark.parametrize("number", [1 / 3, 1e-7 / 7, 0.07])
def test_any_quantity_of_a_scenario_comes_back_to_the_bit(name, number):
    adapter = TypeAdapter(getattr(schema, name))
    assert adapter.validate_python(adapter.dump_python(number)) == number


def test_a_specification_with_its_units():
    text = {"rate": "4 Hz", "output": "pulses", "pulse_size": "2 cm", "scale_sigma": "0.3 %", "signed": False}
    text |= {"mounting": ["2 deg", "0.5 deg"], "slips": [["10 s", "11.5 s", "30 %"]]}
    spec = OdometerSpec.from_mapping(text)
    assert (spec.pulse_size, spec.scale_sigma, spec.slips) == (0.02, 0.003, ((10.0, 11.5, 0.3),))
    assert spec.mounting == pytest.approx(np.radians([2.0, 0.5]))
    assert OdometerSpec.from_mapping(spec.to_mapping()) == spec


@pytest.mark.parametrize(
    ("kind", "content", "words"),
    [
        (OdometerSpec, {"scal": "1 %"}, ["odo: key 'scal'", "'scale'"]),
        (OdometerSpec, {"scale": "1 m"}, ["odo: scale", "ratio"]),
        (OdometerSpec, {"rate": "-1 Hz"}, ["odo: rate: '-1 Hz'; expected a positive value"]),
        (OdometerSpec, {"noise": "-1 m/s"}, ["odo: noise: '-1 m/s'; expected zero or more"]),
        (OdometerSpec, {"mounting": "1 deg"}, ["odo: mounting", "2 quantities"]),
        (OdometerSpec, {"slips": [["1 s", "2 s"]]}, ["odo: slips[1]", "3 quantities"]),
        (OdometerSpec, {"slips": [["2 s", "1 s", "1 %"]]}, ["slips, number 1", "an end after its start"]),
        (OdometerSpec, {"lost": "1 %"}, ["lost pulses", "distance"]),
        (OdometerSpec, {"output": "miles"}, ["output 'miles'"]),
        (OdometerSpec, {"signed": "no"}, ["odo: signed: 'no'", "true or false"]),
        (VelocityLogSpec, {"frame": "navigation", "axes": "forward"}, ["body axes"]),
        (GnssSpec, {"outlier_rate": "120 %"}, ["outlier_rate is 1.2"]),
        (MasterSpec, {"with_attitude": False, "with_velocity": False}, ["without attitude and velocity"]),
        (FlexureSpec, {"correlation_time": "0 s"}, ["odo: correlation_time: '0 s'; expected a positive value"]),
        (FlexureSpec, {"sigma": ["1 deg", "-1 deg", "0 deg"]}, ["odo: sigma: '-1 deg'; expected zero or more"]),
        (HeightSpec, ["lag"], ["odo: expected keys"]),
    ],
)
def test_a_wrong_specification_is_named(kind, content, words):
    with pytest.raises(DataError) as caught:
        kind.from_mapping(content, "odo")
    for word in words:
        assert word in str(caught.value), caught.value
