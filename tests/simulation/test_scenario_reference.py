"""The page of every key of a scenario file: it names every key that the schema has, no other, and its defaults."""

import re
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import PlainSerializer

from truenorth.core.schema import Strict, models_in
from truenorth.records.flexure import FlexureSpec
from truenorth.records.specs import ENTRIES, imu_spec
from truenorth.records.unit_spec import UnitSpec, _written
from truenorth.simulation import scenario_courses, scenario_motion, scenario_sensors
from truenorth.simulation.encoder import EncoderSpec
from truenorth.simulation.scenario import Place, Scenario, read_scenario
from truenorth.simulation.scenario_sensors import AIDING

PAGE = Path(__file__).parents[2] / "docs" / "scenarios.md"
NEEDED, NONE = "needed", "–"

# Heading of a table: what it is of.
MODELS: dict[str, type[Strict]] = {"The scenario": Scenario, "position": Place}
MODELS |= {
    name: getattr(scenario_motion, model, None) or getattr(scenario_courses, model)
    for name, model in {
        "motion: rest": "RestMotion",
        "motion: sway": "SwayMotion",
        "tones": "Tones",
        "a tone": "AngleTone",
        "motion: sea": "SeaMotion",
        "waves": "Waves",
        "hull": "HullShape",
        "motion: ring": "RingMotion",
        "motion: legs": "LegsMotion",
        "leg: straight": "Straight",
        "leg: turn": "Turn",
        "leg: s_turn": "STurn",
        "leg: accelerate": "Accelerate",
        "leg: climb": "Climb",
        "leg: wing_rock": "WingRock",
        "motion: route": "RouteMotion",
        "points": "Point",
        "driving": "DrivingStyle",
        "motion: turntable": "TurntableMotion",
        "motion: plug-in": "PlugInMotion",
        "positions": "TablePosition",
        "disturbance: sway": "SwayDisturbance",
        "disturbance: sea": "SeaDisturbance",
        "disturbance: vibration": "Vibration",
        "sines": "Sine",
        "random": "SpectrumPoint",
    }.items()
}
MODELS |= {
    "indexer": scenario_sensors.IndexerModel,
    "axis: spin": scenario_sensors.SpinAxis,
    "axis: swing": scenario_sensors.SwingAxis,
}
SPECS: dict[str, type[UnitSpec]] = dict(AIDING)
SPECS |= {"encoder": EncoderSpec, "flexure": FlexureSpec}


def keys_of(model: type[Strict] | type[UnitSpec]) -> dict[str, str]:
    """Default of each key, as a file writes it."""
    if issubclass(model, UnitSpec):
        return {item.name: _of_spec(item) for item in fields(model)}
    return {name: _of_model(field) for name, field in model.model_fields.items() if name != "kind"}


def _of_spec(item: Any) -> str:
    if item.default is MISSING:
        return NEEDED
    marks = item.metadata
    return _text(_written(item.default, marks) if "dimensions" in marks else item.default)


def _of_model(field: Any) -> str:
    if field.is_required():
        return NEEDED
    default = field.get_default(call_default_factory=True)
    if isinstance(default, Strict):
        return "its defaults"
    writers = [mark.func for mark in _marks(field) if isinstance(mark, PlainSerializer)]
    if not writers or default is None or default == ():
        return _text(default)
    return _text([writers[0](x) for x in default] if isinstance(default, tuple) else writers[0](default))


def _marks(field: Any) -> list[Any]:
    marks, rest = list(field.metadata), list(getattr(field.annotation, "__args__", ()))
    while rest:
        part = rest.pop()
        marks += getattr(part, "__metadata__", ())
        rest += getattr(part, "__args__", ())
    return marks


def _text(value: Any) -> str:
    if value is None or value in ((), {}, [], ""):
        return NONE
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(str, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def tables() -> dict[str, dict[str, str]]:
    """Of the page, by heading: default by key."""
    found: dict[str, dict[str, str]] = {}
    heading = ""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            heading = line.lstrip("# ").replace("`", "")
        elif match := re.match(r"\| `(\w+)` \| (.*?) \|", line):
            found.setdefault(heading, {})[match[1]] = match[2].strip("`")
    return found


@pytest.mark.parametrize("heading", [*MODELS, *SPECS])
def test_a_table_has_the_keys_of_the_schema_and_their_defaults(heading):
    assert tables()[heading] == keys_of(MODELS.get(heading) or SPECS[heading])


def test_the_table_of_the_imu_has_every_term():
    terms = {f"{group}.{key}" for group, key in ENTRIES if group}
    page = PAGE.read_text(encoding="utf-8")
    table = page[page.index("## The IMU") : page.index("## Sensors besides the IMU")]
    groups = {
        f"{group}.{key}"
        for line in table.splitlines()
        if line.startswith("| `")
        for groups, keys in [line.split("|")[1:3]]
        for group in re.findall(r"`(\w+)`", groups)
        for key in re.findall(r"`(\w+)`", keys)
    }
    assert groups == terms | {"gyro.filter_order", "accel.filter_order", "accel.positions"}


def test_no_model_is_without_a_table():
    known, rest, found = set(MODELS.values()), [Scenario], set()
    while rest:
        model = rest.pop()
        if model not in found:
            found.add(model)
            rest += [inner for field in model.model_fields.values() for inner in models_in(field.annotation)]
    assert found - known == {scenario_motion.LengthTone}  # an AngleTone in metres


def test_every_example_of_the_page_is_simulated():
    examples = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    assert len(examples) == 2
    content, imu = map(yaml.safe_load, examples)
    scenario = read_scenario(content)
    assert len(scenario.simulate().record) == 100 * 60
    assert set(scenario.simulate_aiding()) == {*AIDING, "encoder"}
    assert imu_spec(imu).gyro_range > 0
