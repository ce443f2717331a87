"""What a specification says beyond biases and noise: known lags and places are taken off, drawn terms are in sigma."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth import ImuRecord, Position, align
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.core.units import STANDARD_GRAVITY
from truenorth.records.specified import corrected, epoch_felt, lag, seen_in
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation.scenario import read_scenario

GYRO = {"bias": "0.01 deg/h", "random_walk": "0.001 deg/sqrt(h)"}
ACCEL = {"bias": "50 ug", "random_walk": "10 ug/sqrt(Hz)"}
LATE = {"bandwidth": "20 Hz", "filter_order": 2}
PLACES = {"positions": [["3 cm", "0 m", "1 cm"], ["0 m", "4 cm", "0 m"], ["2 cm", "0 m", "3 cm"]]}
SWAY = {
    "kind": "sway",
    "heading": "30 deg",
    "tones": {
        "roll": [{"amplitude": "6 deg", "period": "7 s"}],
        "pitch": [{"amplitude": "3 deg", "period": "5 s", "phase": "40 deg"}],
        "heading": [{"amplitude": "2 deg", "period": "9 s"}],
    },
}


def simulated(gyro, accel, output="increments", rate="50 Hz"):
    """A swaying base's log of 40 s, without noise: what the terms alone do."""
    return read_scenario(
        {
            "name": "swaying",
            "duration": "40 s",
            "rate": rate,
            "output": output,
            "position": {"lat": "40 deg"},
            "imu": {"name": "own", "gyro": gyro, "accel": accel},
            "motion": SWAY,
        }
    )


@pytest.mark.parametrize("output", ["increments", "rates"])
@pytest.mark.parametrize(
    ("gyro", "accel", "left"),
    [
        # equal lags are stamps alone; one sensor's own is read between rows; places by differences of the rate
        ({"latency": "5 ms"}, {"latency": "5 ms"}, 0.02),
        (LATE, LATE, 0.02),
        (LATE, {}, 0.03),
        ({}, {"bandwidth": "15 Hz"}, 0.03),
        ({}, PLACES, 0.03),
    ],
)
def test_known_errors_are_taken_off(gyro, accel, left, output):
    """What is left of them, against the ideal log at the corrected stamps, is a small part of what they were."""
    built, ideal = simulated(gyro, accel, output), simulated({}, {}, output)
    record, true = (s.simulate(seed=1).record for s in (built, ideal))
    found = corrected(record, built.imu_spec)
    for sensor in ("gyro", "accel"):
        sums = [np.cumsum(getattr(r, sensor), axis=0) for r in (found, record, true)]
        at = [np.stack([np.interp(r.time, true.time, x) for x in sums[2].T], axis=1) for r in (found, record)]
        inside = slice(50, -50)
        off, was = (np.ptp((a - b)[inside], axis=0).max() for a, b in zip(sums[:2], at, strict=True))
        if was > 1e-9:
            assert off < left * was, (sensor, off, was)


def test_a_log_without_known_errors_is_the_log_itself():
    record = simulated({}, {}).simulate(seed=1).record
    assert corrected(record, imu_spec("navigation")) is record
    assert corrected(record, None) is record


def test_lag_of_a_low_pass():
    """Of one pole 1/w, of Butterworth's two sqrt(2)/w; latency on top."""
    spec = ImuSpec(gyro_bandwidth=10.0, gyro_latency=0.002, accel_bandwidth=10.0, accel_filter_order=2)
    assert lag(spec, "gyro") == pytest.approx(0.002 + 1.0 / (20.0 * math.pi))
    assert lag(spec, "accel") == pytest.approx(math.sqrt(2.0) / (20.0 * math.pi))


def test_an_epoch_at_the_last_stamp_is_the_last_moment_felt():
    record = simulated({}, {}).simulate(seed=1).record
    spec = replace(imu_spec("navigation"), gyro_latency=0.01, accel_latency=0.01)
    assert epoch_felt(record.time[-1], record, spec) == record.time[-1] - 0.01
    assert epoch_felt(record.time[10], record, spec) == record.time[10]
    found = align(record, Position.from_degrees(40.0, 0.0), spec, at=float(record.time[-1]))
    assert found.time == record.time[-1] - 0.01


def at_rest(count=1000, T=0.02):
    time = T * np.arange(1, count + 1)
    return ImuRecord(time, np.zeros((count, 3)), np.tile([0.0, 0.0, STANDARD_GRAVITY * T], (count, 1)), "increments")


def test_drawn_terms_count_as_what_the_filters_have():
    record = at_rest()
    warm = ImuSpec(
        gyro_bias_temperature=1e-6, accel_bias_temperature=1e-4, temperature_start=-5.0, temperature_rate=0.1
    )
    found = seen_in(warm, record)  # -5 K to -3 K in 20 s
    assert found.gyro_turn_on_bias == pytest.approx(5e-6)
    assert found.gyro_rate_random_walk * math.sqrt(record.duration) == pytest.approx(1e-6 * 0.1 * record.duration)
    assert found.accel_turn_on_bias == pytest.approx(5e-4)
    leans = seen_in(ImuSpec(gyro_g_sensitivity=1e-7), record)
    assert leans.gyro_turn_on_bias == pytest.approx(1e-7 * STANDARD_GRAVITY)
    assert leans.gyro_random_walk == pytest.approx(0.0, abs=1e-15)  # a force that stays is a bias
    askew = seen_in(ImuSpec(accel_scale_factor_asymmetry=1e-4), record)
    assert askew.accel_scale_factor == pytest.approx(1e-4)
    assert askew.accel_turn_on_bias == pytest.approx(0.0, abs=1e-15)  # nothing swings through zero


def test_what_is_counted_is_counted_once():
    """A specification that an alignment hands on is not counted again, but for the force that stays."""
    spec = replace(
        imu_spec("tactical"), gyro_bias_temperature=1e-6, temperature_start=5.0, accel_scale_factor_asymmetry=1e-4
    )
    once = seen_in(spec, at_rest())
    assert seen_in(once, at_rest()) == once


def of_bench(name, gyro, accel, more=None):
    bench = BENCHES[name]

    def scenario(rng):
        imu = {"name": "own", "gyro": GYRO | gyro, "accel": ACCEL | accel} | (more or {})
        return dict(bench.scenario(rng)) | {"imu": imu}

    return replace(bench, scenario=scenario)


@pytest.mark.parametrize(
    ("name", "gyro", "accel"),
    some(
        [
            ("swaying", LATE, LATE),  # 20 sigmas of level without
            (
                "rotary",
                {},
                {"positions": [["3 cm", "0 m", "0 m"], ["0 m", "3 cm", "0 m"], ["0 m", "0 m", "3 cm"]]},
            ),  # refused
        ],
        [
            ("swaying", {"scale_factor_asymmetry": "30 ppm"}, {}),  # refused without
            ("rotary", LATE, LATE),  # 62 sigmas of level without
        ],
    ),
)
def test_an_answer_knows_what_its_specification_says(name, gyro, accel):
    bench = of_bench(name, gyro, accel)
    inputs, truth = bench.draw(1, 0)
    answer = bench.align(inputs)
    assert answer.status == "aligned"
    assert max(np.abs(x).max() for x in misses(answer, truth).values()) < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("axes", [{"scale_factor": "300 ppm"}, {"misalignment": "20 arcsec"}])
def test_a_slave_with_one_kind_of_axis_error_is_levelled(axes):
    """Seat, arm and sensors turn together only where each can: level was known to what was said of the seat, 3 deg."""
    bench = of_bench(
        "attitude", {"bias": "1 deg/h", "random_walk": "0.05 deg/sqrt(h)"} | axes, {"bias": "500 ug"} | axes
    )
    inputs, truth = bench.draw(1, 0)
    answer = bench.align(inputs)
    assert answer.status == "aligned"
    assert np.degrees(np.sqrt(np.diag(answer.phi_covariance))).max() < 0.05
    assert max(np.abs(x).max() for x in misses(answer, truth).values()) < 4.0
