"""IMU specifications: presets, files and back, and files with mistakes."""

import math
from dataclasses import fields

import pytest

from tests.helpers import raises_naming
from truenorth.core.errors import DataError, UsageError
from truenorth.records.presets import PRESETS
from truenorth.records.spec_keys import KEYS
from truenorth.records.specs import ImuSpec, imu_spec

DEG = math.pi / 180
G = 9.80665


def test_a_file_in_datasheet_units(tmp_path):
    file = tmp_path / "fog.yaml"
    file.write_text(
        "name: my FOG\n"
        "gyro: {bias: 0.01 deg/h, random_walk: 0.001 deg/√h, scale_factor: 5 ppm, misalignment: 2 arcsec,\n"
        "       quantisation: 0.1 arcsec, range: 300 deg/s, bias_instability: 0.003 deg/h}\n"
        "accel: {bias: 50 µg, random_walk: 10 ug/sqrt(Hz), quantisation: 0.001 m/s, range: 20 g}\n"
        "correlation_time: 1 h\n",
        encoding="utf-8",
    )
    spec = imu_spec(file)
    assert spec.name == "my FOG"
    expected = {
        "gyro_bias": 0.01 * DEG / 3600,
        "gyro_bias_instability": 0.003 * DEG / 3600,
        "gyro_random_walk": 0.001 * DEG / 60,
        "gyro_scale_factor": 5e-6,
        "gyro_misalignment": 2 * DEG / 3600,
        "gyro_quantisation": 0.1 * DEG / 3600,
        "gyro_range": 300 * DEG,
        "accel_bias": 50e-6 * G,
        "accel_random_walk": 10e-6 * G,
        "accel_bias_instability": 0.0,
        "accel_scale_factor": 0.0,
        "accel_misalignment": 0.0,
        "accel_quantisation": 0.001,
        "accel_range": 20 * G,
        "correlation_time": 3600.0,
    }
    perfect = ImuSpec()
    for item in fields(spec):
        if item.name not in {*expected, "name", "unsaid"}:
            assert getattr(spec, item.name) == getattr(perfect, item.name)
    assert spec.unsaid == ("accel_bias_instability", "accel_scale_factor", "accel_misalignment")
    for name, value in expected.items():
        assert getattr(spec, name) == pytest.approx(value, rel=1e-14), name


def test_presets_are_ordered_from_good_to_poor():
    specs = [imu_spec(name) for name in ("navigation", "tactical", "industrial", "consumer")]
    assert set(PRESETS) == {spec.name for spec in specs}
    for key in ("gyro_bias", "gyro_random_walk", "gyro_bias_instability", "accel_bias", "accel_random_walk"):
        values = [getattr(spec, key) for spec in specs]
        assert values == sorted(values)
        assert len(set(values)) == len(values)
        assert values[0] > 0.0


@pytest.mark.parametrize("name", PRESETS)
def test_written_and_read_back(name, tmp_path):
    spec = imu_spec(name)
    spec.to_yaml(tmp_path / "imu.yaml")
    again = imu_spec(tmp_path / "imu.yaml")
    assert again.name == spec.name
    for item in fields(spec):
        if item.name not in ("name", "accel_positions"):
            assert getattr(again, item.name) == pytest.approx(getattr(spec, item.name), rel=2e-15)


def test_a_written_file_reads_like_a_datasheet(tmp_path):
    imu_spec("navigation").to_yaml(tmp_path / "imu.yaml")
    text = (tmp_path / "imu.yaml").read_text()
    assert "bias: 0.01 deg/h\n" in text
    assert "random_walk: 10 ug/sqrt(Hz)\n" in text


def test_a_specification_passes_through_and_a_mapping_is_read():
    spec = ImuSpec(gyro_bias=1e-7)
    assert imu_spec(spec) is spec
    assert imu_spec({"gyro": {"bias": "1 deg/h"}}).gyro_bias == pytest.approx(DEG / 3600, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gyro: {baias: 1 deg/h}", ["gyro.baias", "did you mean 'gyro.bias'"]),
        ("gyros: {bias: 1 deg/h}", ["'gyros'", "did you mean 'gyro'"]),
        ("gyro: {bias: 1 deg/sqrt(h)}", ["gyro.bias", "angular rate", "0.01 deg/h"]),
        ("accel: {bias: 0.5}", ["accel.bias", "no unit", "50 ug"]),
        ("accel: {bias: -1 mg}", ["accel.bias", "negative"]),
        ("accel: {range: 0 g}", ["accel.range", "positive"]),
        ("gyro: {sample_noise: 1 deg}", ["gyro.sample_noise", "angular rate", "0.01 deg/h"]),
        ("gyro: {rate_random_walk: 1 deg/h}", ["gyro.rate_random_walk", "deg/h/sqrt(h)"]),
        ("gyro: {g_sensitivity: 1 deg/h}", ["gyro.g_sensitivity", "1 deg/h/g"]),
        ("accel: {g_sensitivity: 1 deg/h/g}", ["accel.g_sensitivity", "not known"]),
        ("accel: {bias_temperature: 1 ug}", ["accel.bias_temperature", "10 ug/degC"]),
        ("gyro: {scale_factor_temperature: -1 ppm/K}", ["gyro.scale_factor_temperature", "negative"]),
        ("gyro: {bandwidth: 0 Hz}", ["gyro.bandwidth", "positive"]),
        ("gyro: {filter_order: 3}", ["gyro.filter_order", "3", "1 (one pole)"]),
        ("gyro: {latency: -1 ms}", ["gyro.latency", "negative"]),
        ("accel: {positions: 3 cm}", ["accel.positions", "three places"]),
        ("accel: {positions: [[1 m, 0 m, 0 m], [0 m, 1 m], [0 m, 0 m, 0 m]]}", ["accel.positions[2]", "three places"]),
        (
            "accel: {positions: [[1 m, 0 m, 0 m], [0 m, 1 m, 2 s], [0 m, 0 m, 0 m]]}",
            ["accel.positions[2][3]", "length"],
        ),
        ("temperature: {rate: 1 K}", ["temperature.rate", "1 degC/min"]),
        ("temperature: {time_constant: 0 s}", ["temperature.time_constant", "positive"]),
        ("temperature: {strat: 1 K}", ["temperature.strat", "did you mean 'temperature.start'"]),
        ("correlation_time: 0 s", ["correlation_time", "positive"]),
        ("correlation_time: 300", ["correlation_time", "no unit", "300 s"]),
        ("gyro: 1 deg/h", ["gyro", "expected keys"]),
        ("- gyro", ["list"]),
        ("gyro: {bias: 1 deg/h\naccel: {}", ["line 2", "not a YAML file"]),
        ("gyro: {bias: 1 deg/h, bias: 2 deg/h}", ["line 1", "'bias' twice"]),
    ],
)
def test_mistakes_in_a_file_are_named_with_file_and_key(text, said, tmp_path):
    file = tmp_path / "imu.yaml"
    file.write_text(text)
    with raises_naming(DataError, str(file), *said):
        imu_spec(file)


def test_neither_preset_nor_file():
    with pytest.raises(UsageError, match="did you mean 'navigation'"):
        imu_spec("navigatoin")
    with pytest.raises(UsageError, match="tactical"):
        imu_spec("no/such/file.yaml")


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_sigma_is_zero_or_more_and_finite(value):
    with pytest.raises(UsageError, match="gyro_bias"):
        ImuSpec(gyro_bias=value)


def test_every_key_is_written_and_read_back(tmp_path):
    content = {
        "name": "full",
        "gyro": {key: f"3 {entry.unit}" for key, entry in KEYS["gyro"].items()} | {"filter_order": 2},
        "accel": {key: f"3 {entry.unit}" for key, entry in KEYS["accel"].items()}
        | {"positions": [["3 cm", "0 m", "0 m"], ["0 m", "3 cm", "0 m"], ["0 m", "0 m", "-30 mm"]]},
        "temperature": {"start": "-20 degC", "rate": "-1 K/min", "time_constant": "10 min"},
        "correlation_time": "10 s",
    }
    spec = imu_spec(content)
    assert spec.unsaid == ()
    for item in fields(spec):
        alike = item.name in ("accel_filter_order", "unsaid")
        assert getattr(spec, item.name) != getattr(ImuSpec(), item.name) or alike
    assert spec.accel_positions == ((0.03, 0, 0), (0, 0.03, 0), (0, 0, -0.03))
    assert spec.gyro_rate_random_walk == pytest.approx(3 * DEG / 3600 / 60, rel=1e-14)
    assert spec.accel_rate_random_walk == pytest.approx(3e-6 * G / 60, rel=1e-14)
    assert spec.gyro_g_sensitivity == pytest.approx(3 * DEG / 3600 / G, rel=1e-14)
    assert spec.temperature_rate == pytest.approx(-1 / 60, rel=1e-14)
    spec.to_yaml(tmp_path / "imu.yaml")
    again = imu_spec(tmp_path / "imu.yaml")
    for item in fields(spec):
        if item.name not in ("name", "accel_positions"):
            assert getattr(again, item.name) == pytest.approx(getattr(spec, item.name), rel=2e-15)
    assert again.accel_positions == spec.accel_positions


def test_sample_noise_as_random_walks():
    spec = ImuSpec(gyro_sample_noise=4e-6, gyro_random_walk=3e-7, accel_sample_noise=1e-4).with_random_walks(0.01)
    assert spec.gyro_random_walk == pytest.approx(5e-7, rel=1e-14)
    assert spec.accel_random_walk == pytest.approx(1e-5, rel=1e-14)
    assert spec.gyro_sample_noise == spec.accel_sample_noise == 0.0


def test_positions_are_three_places_of_three_lengths():
    with pytest.raises(UsageError, match="three places"):
        ImuSpec(accel_positions=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    with pytest.raises(UsageError, match="1 or 2"):
        ImuSpec(gyro_filter_order=0)


def test_a_name_that_no_file_can_have():
    with pytest.raises(UsageError, match="so long a name"):
        imu_spec("9" * 300)


def test_what_no_sensor_can_be_is_refused_with_its_range(tmp_path):
    """Squares of such numbers overflow."""
    groups = {"gyro": {"bias": "1e200 deg/h"}, "accel": {"bias": "50 ug"}}
    with raises_naming(DataError, "gyro.bias", "1e200 deg/h", "expected 0 to 2.06265e+11 deg/h"):
        imu_spec(groups)
    with raises_naming(DataError, "temperature.start", "-1e200 K", "-10000 K to 10000 K"):
        imu_spec({"gyro": {"bias": "1 deg/h"}, "temperature": {"start": "-1e200 K"}})
    with raises_naming(DataError, "correlation_time", "1e-300 s", ">= 0.0001 s"):
        imu_spec({"correlation_time": "1e-300 s"})
    with raises_naming(DataError, "accel.bandwidth", "1e-200 Hz", ">= 1e-06 Hz"):
        imu_spec({"accel": {"bandwidth": "1e-200 Hz"}})
    with raises_naming(UsageError, "accel_bias is 1e+200", "1.01972e+13 ug"):
        ImuSpec(accel_bias=1e200)
    with raises_naming(UsageError, "accel_positions", "100 m"):
        ImuSpec(accel_positions=((1e200, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    for group, entries in KEYS.items():  # the ends themselves are taken, and have finite squares
        for key, entry in entries.items():
            low, high = entry.bounds
            spec = ImuSpec(**{f"{group}_{key}": high if math.isfinite(high) else max(low, 1.0)})
            assert all(math.isfinite(x) for x in spec.bias_variance)
