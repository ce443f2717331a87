"""Scenario files: what they say, what is refused with which words, and the folder that a run becomes."""

import json

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import truenorth
from truenorth.cli import app
from truenorth.core.errors import DataError, UsageError
from truenorth.core.schema import Strict
from truenorth.simulation.scenario import Scenario, read_scenario, shipped
from truenorth.simulation.scenario_courses import RouteMotion

BASE = {
    "name": "base",
    "duration": "20 s",
    "rate": "50 Hz",
    "position": {"lat": "45 deg", "lon": "10 deg"},
    "motion": {"kind": "rest"},
}
PAPERS = {"rotary_ship", "transfer_flat_turn", "marine_damping", "marine_manoeuvres", "static_kalman", "odometer_ring"}
RELATED = {"transfer_release", "late_sensors"}
EVERYDAY = {"van", "quay", "take_off", "auv", "table"}


def run(*arguments: str):
    return CliRunner().invoke(app, ["simulate", *arguments])


def test_the_papers_and_the_everyday_scenarios_ship():
    assert set(shipped()) == PAPERS | RELATED | EVERYDAY
    assert all(shipped().values())


@pytest.mark.parametrize("name", sorted(PAPERS | RELATED | EVERYDAY))
def test_a_shipped_scenario_runs_and_reads_back_from_its_resolved_file(name):
    scenario = read_scenario(name)
    again = read_scenario(scenario.to_mapping())
    assert again.model_dump(exclude={"imu"}) == scenario.model_dump(exclude={"imu"})
    assert again.imu_spec == scenario.imu_spec
    short = scenario.model_copy(update={"duration": 20.0})
    first, second, other = (
        short.simulate(),
        again.model_copy(update={"duration": 20.0}).simulate(),
        short.simulate(run=1),
    )
    np.testing.assert_array_equal(first.record.gyro, second.record.gyro)
    np.testing.assert_array_equal(first.record.accel, second.record.accel)
    nothing_drawn = name in ("marine_damping", "marine_manoeuvres")  # all their errors are given
    assert np.array_equal(first.record.gyro, other.record.gyro) == nothing_drawn
    assert scenario.is_drawn == (repr(short.build_motion(run=0)) != repr(short.build_motion(run=1)))


def test_a_disturbance_draws_apart_from_the_others():
    """Taking one away leaves the draws of those before it, and of the sensors, as they were."""
    swell = {"kind": "sway", "tones": {"roll": [{"rms": "1 deg", "period": "6 s", "bandwidth": "15 %"}]}}
    engine = {"kind": "vibration", "sines": [{"frequency": "30 Hz", "acceleration": ["1 mg", "1 mg", "1 mg"]}]}
    both = read_scenario(BASE | {"disturbances": [swell, engine]}).build_motion(seed=3)
    one = read_scenario(BASE | {"disturbances": [swell]}).build_motion(seed=3)
    assert both.motion == one


def test_a_route_comes_from_a_file_next_to_the_scenario(tmp_path):
    (tmp_path / "way.csv").write_text("lat,lon\n45.0,10.0\n45.001,10.0\n45.001,10.002\n")
    content = {**BASE, "motion": {"kind": "route", "file": "way.csv"}}
    del content["position"]
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(content))
    scenario = read_scenario(tmp_path / "s.yaml")
    resolved = read_scenario(scenario.to_mapping())  # needs the file no more
    assert isinstance(resolved.motion, RouteMotion)
    assert len(resolved.motion.points) == 3
    np.testing.assert_array_equal(resolved.simulate().record.gyro, scenario.simulate().record.gyro)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"duration": "5 m"}, r"duration: '5 m' is a quantity of length; a quantity of time"),
        ({"duration": "-5 s"}, r"duration: -5; expected a positive value"),
        ({"duration": 5}, r"duration: 5 has no unit"),
        ({"durration": "5 s"}, r"key 'durration' is not known; did you mean 'duration'"),
        ({"motion": {"kind": "rings"}}, r"motion.kind: 'rings' is not known; expected one of 'rest', 'sway'"),
        ({"motion": {"heading": "1 deg"}}, r"motion.kind is missing; expected one of 'rest'"),
        ({"motion": {"kind": "ring", "speed": "5 m/s"}}, r"motion.radius is missing; give it, such as radius: "),
        ({"motion": {"kind": "ring", "speed": "5 m/s", "radus": "9 m"}}, r"'motion.radus' is not known; did you mean"),
        ({"motion": {"kind": "rest", "heading": "1 m"}}, r"motion.heading: '1 m'"),
        (
            {"motion": {"kind": "legs", "legs": [{"kind": "straight", "duration": "1 s"}, {"kind": "turn"}]}},
            r"motion.legs\[2\].angle is missing",
        ),
        (
            {"motion": {"kind": "sway", "tones": {"roll": [{"period": "3 s"}]}}},
            r"motion.tones.roll\[1\]: expected amplitude, period, phase for a sinusoid, or rms",
        ),
        (
            {"motion": {"kind": "sea", "waves": {"direction": "1 deg", "height": "1 m"}}},
            r"motion.waves: expected height",
        ),
        ({"motion": 3}, r"motion"),
        ({"position": "here"}, r"position: 'here'; expected a mapping of the keys lat, lon, alt"),
        ({"name": ""}, r"name: ''; expected at least 1 character"),
        ({"gnss": {"position_noise": "-1 m"}}, r"gnss: position_noise: '-1 m'; expected zero or more"),
        ({"seed": -1}, r"seed: -1; expected greater than or equal to 0"),
        ({"imu": {"gyro": {"bias": "-3 deg/h"}}}, r"imu: .*gyro.bias: '-3 deg/h' is negative"),
        ({"imu": "navigatoin"}, r"imu: .*did you mean 'navigation'"),
        ({"gnss": {"rate": "5 m"}}, r"gnss: rate: '5 m' is a quantity of length"),
        ({"odometer": {"scale_sgima": "1 %"}}, r"odometer: key 'scale_sgima' is not known; did you mean 'scale_sigma'"),
        ({"flexure": {"correlation_time": "-1 s"}}, r"flexure: .*correlation_time"),
        ({"errors": {"gyro": {"bias": ["1 deg/h", "2 deg/h"]}}}, r"errors: gyro.bias"),
        (
            {"indexer": {"axes": [{"kind": "spin", "direction": "u", "rate": "1 deg/s"}]}},
            r"indexer.axes\[1\].direction: 'u'",
        ),
        ({"indexer": {}}, r"indexer: expected axes, or a scheme"),
        ({"output": "both"}, r"output: 'both'; expected 'increments' or 'rates'"),
    ],
)
def test_a_mistake_is_named_by_the_path_of_its_key(change, words):
    with pytest.raises(DataError, match=words):
        read_scenario(BASE | change)


CLIMB = {"kind": "climb", "slope": "2 deg", "duration": "3 s"}
ROCK = {"kind": "wing_rock", "duration": "3 s", "amplitude": "5 deg", "period": "4 s"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"position": None}, "position is missing"),
        ({"position": {"lat": "95 deg"}}, "position: latitude 95 deg"),
        (
            {"motion": {"kind": "legs", "legs": [{"kind": "turn", "angle": "9 deg", "rate": "-1 deg/s"}]}},
            r"motion: legs\[1\]: turn of 9 deg at -1 deg/s; expected .* a positive rate",
        ),
        (
            {
                "motion": {
                    "kind": "legs",
                    "legs": [
                        CLIMB,
                        CLIMB,
                        {"kind": "straight", "duration": "-1 s"},
                    ],  # a climb is three legs of a course
                }
            },
            r"motion: legs\[3\]: duration -1 s",
        ),
        (
            {"motion": {"kind": "legs", "legs": [CLIMB | {"rate": "0 deg/s"}]}},
            r"motion: legs\[1\]: climb .* at 0 deg/s",
        ),
        ({"motion": {"kind": "legs", "legs": [CLIMB, ROCK]}}, r"motion: legs\[2\]: window"),
        ({"motion": {"kind": "route", "points": [{"lat": "1 deg", "lon": "1 deg"}]}}, "motion: route of 1"),
        ({"motion": {"kind": "route", "file": "none.csv"}}, "motion: none.csv: cannot be read"),
        (
            {"disturbances": [{"kind": "vibration", "random": [{"frequency": "9 Hz", "density": "1 g^2/Hz"}]}]},
            r"disturbances\[1\]: vibration spectrum",
        ),
    ],
)
def test_an_impossible_motion_is_said_when_it_is_built(change, words):
    with pytest.raises(DataError, match=words):
        read_scenario(BASE | change).build_motion()


def test_aiding_sensors_see_the_body_and_the_imu_its_own_motion(tmp_path):
    """An IMU that turns and sits on a seat that bends; the odometer and the receiver do neither."""
    content = BASE | {
        "motion": {"kind": "ring", "radius": "50 m", "speed": "5 m/s"},
        "indexer": {
            "axes": [{"kind": "spin", "direction": "z", "rate": "18 deg/s"}],
            "encoder": {"resolution": "1 arcsec"},
        },
        "flexure": {"sigma": ["1 arcmin", "1 arcmin", "1 arcmin"]},
        "errors": {"gyro": {"bias": "0.02 deg/h"}},
        "odometer": {},
        "gnss": {"rate": "2 Hz"},
        "velocity_log": {},
        "height": {},
        "master": {"rate": "5 Hz"},
    }
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(content))
    result = run(str(tmp_path / "s.yaml"), "-o", str(tmp_path / "out"), "--no-plot")
    assert result.exit_code == 0, result.output
    body = truenorth.read_trajectory(tmp_path / "out" / "truth_body.parquet")
    imu = truenorth.read_trajectory(tmp_path / "out" / "truth.parquet")
    encoder = read_scenario(content).simulate_aiding()["encoder"].record
    heading = np.unwrap(np.arctan2(imu.C_nb[:, 0, 1], imu.C_nb[:, 1, 1]))
    of_body = np.unwrap(np.arctan2(body.C_nb[:, 0, 1], body.C_nb[:, 1, 1]))
    # Heading is clockwise, an axis turns counter-clockwise; five sigma of the seat's bending.
    turned = np.degrees(-(heading - of_body) - np.ravel(encoder.angles)[1:])
    assert np.max(np.abs(turned)) < 0.1
    assert np.std(turned) > 0.001
    odometer = truenorth.read_odometer(tmp_path / "out" / "odometer.parquet")
    np.testing.assert_allclose(odometer.speed[-50:], 5.0, atol=1e-3)
    gnss = truenorth.read_gnss(tmp_path / "out" / "gnss.parquet")
    np.testing.assert_allclose(gnss.lat[1:], body.at(gnss.time[1:]).lat, atol=1e-10)
    master = truenorth.read_master(tmp_path / "out" / "master.parquet")
    np.testing.assert_allclose(master.v_n[1:], body.at(master.time[1:]).v_n, atol=1e-3)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    np.testing.assert_allclose(summary["true_errors"]["gyro_bias"], np.radians(0.02) / 3600)
    assert "scale" in summary["true_errors_of_aiding"]["odometer"]


def test_an_aiding_sensor_leaves_the_draws_of_the_imu_and_of_the_others():
    noisy = {"gnss": {"position_noise": "1 m"}, "velocity_log": {"noise": "0.1 m/s"}, "imu": "tactical"}
    both = read_scenario(BASE | noisy)
    alone = read_scenario(BASE | {"velocity_log": noisy["velocity_log"], "imu": "tactical"})
    np.testing.assert_array_equal(both.simulate().record.gyro, alone.simulate().record.gyro)
    one, two = (x.simulate_aiding()["velocity_log"].record.velocity for x in (both, alone))
    np.testing.assert_array_equal(one, two)


def test_quantities_are_never_bare_numbers():
    """Every number with a dimension in the schema takes text with a unit; what is left is dimensionless."""

    def bare(model: type[Strict], path: str, seen: set[type]) -> list[str]:
        from truenorth.core.schema import models_in

        found = []
        for name, field in model.model_fields.items():
            if field.annotation is float and not field.metadata:
                found.append(name)
            for inner in models_in(field.annotation):
                if inner not in seen:
                    seen.add(inner)
                    found += bare(inner, f"{path}.{name}", seen)
        return found

    dimensionless = {"peakedness", "roll_damping", "pitch_damping", "heave_damping", "yaw_gain"}
    assert set(bare(Scenario, "", set())) <= dimensionless


@pytest.mark.slow
def test_the_command_writes_a_folder_that_reads_back(tmp_path):
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(BASE | {"imu": "tactical", "seed": 5}))
    result = run(str(tmp_path / "s.yaml"), "-o", str(tmp_path / "out"))
    assert result.exit_code == 0, result.output
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"imu.parquet", "truth.parquet", "scenario.yaml", "summary.json", "figure.png"}
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["seed"], summary["run"], summary["samples"]) == (5, 0, 1000)
    record = truenorth.read_imu(tmp_path / "out" / "imu.parquet")
    again = read_scenario(tmp_path / "out" / "scenario.yaml").simulate()
    np.testing.assert_array_equal(record.gyro, again.record.gyro)
    np.testing.assert_allclose(again.errors.gyro_bias, summary["true_errors"]["gyro_bias"], rtol=0)


def test_many_runs_and_csv(tmp_path):
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(BASE | {"imu": "tactical"}))
    result = run(
        str(tmp_path / "s.yaml"), "-o", str(tmp_path / "out"), "--runs", "3", "--run", "4", "--csv", "--no-plot"
    )
    assert result.exit_code == 0, result.output
    assert [path.name for path in sorted((tmp_path / "out").iterdir())] == ["run_0004", "run_0005", "run_0006"]
    alone = run(str(tmp_path / "s.yaml"), "-o", str(tmp_path / "alone"), "--run", "5", "--csv", "--no-plot")
    assert alone.exit_code == 0
    for name in ("imu.csv", "truth.csv"):
        assert (tmp_path / "out" / "run_0005" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()


def test_list_and_show():
    assert "quay" in run("--list").output
    shown = yaml.safe_load(run("van", "--show").output)
    assert shown["motion"]["driving"]["lateral_acceleration"] == "2.5 m/s^2"


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ([], UsageError, "no scenario"),
        (["van"], UsageError, "no output folder"),
        (["vann", "-o", "x"], UsageError, "did you mean 'van'"),
    ],
)
def test_wrong_usage(arguments, error, words):
    result = run(*arguments)
    assert isinstance(result.exception, error)
    assert words in str(result.exception)
