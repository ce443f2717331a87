"""Sensors noisier than specified on a base that sways: what the log says of them, both ways."""

from dataclasses import replace
from zlib import crc32

import numpy as np
import pytest

from benchmarks.honesty.foreign_rows import aligned, moored
from tests.runs import some
from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.campaign.faults import FAULTS


def _said(answer):
    return {item.key for item in answer.evidence if item.key.startswith("specification.")}


@pytest.mark.slow
def test_a_log_rounded_to_more_than_its_noise_is_not_silent():
    """Gyros to 300 times their noise, accelerometers to 5 times theirs: level was 3.4 sigmas off, `aligned`."""
    inputs, truth = BENCHES["swaying"].draw(12, 0)
    spoil = next(item.apply for item in FAULTS if item.name == "coarse quantum")
    spoilt, _ = spoil(inputs, np.random.default_rng([12, 0, crc32(b"swaying coarse quantum")]))
    answer = align(spoilt["record"], inputs["place"], spoilt["imu"])
    worst = max(float(np.abs(x).max()) for x in misses(answer, truth).values())
    assert answer.status == "inconsistent" or worst < 3.0, answer


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["accel", "gyro"])
def test_noise_of_another_sensor_is_named_on_a_sway(sensor):
    inputs, _ = BENCHES["swaying"].draw(12, 3)
    record, rng = inputs["record"], np.random.default_rng(4)
    walk = 20.0 * getattr(inputs["imu"], f"{sensor}_random_walk")
    scale = np.sqrt(record.interval) if record.kind == "increments" else 1.0 / np.sqrt(record.interval)
    rows = getattr(record, sensor) + walk * scale * rng.standard_normal((len(record), 3))
    answer = align(replace(record, **{sensor: rows}), inputs["place"], inputs["imu"])
    assert f"specification.{sensor}_noise" in _said(answer), answer


@pytest.mark.parametrize("sensor", some(["gyro"], ["accel"]))
def test_a_specification_without_noise_is_no_measure_of_rows(sensor):
    inputs, truth = BENCHES["swaying"].draw(12, 3)
    spec = replace(inputs["imu"], **{f"{sensor}_random_walk": 0.0})
    answer = align(inputs["record"], inputs["place"], spec)
    assert not any(item.key.endswith("_rows") for item in answer.evidence)
    assert answer.status != "aligned" or max(float(np.abs(x).max()) for x in misses(answer, truth).values()) < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("run", [12, 18])
def test_a_ship_that_moves_slowly_in_many_tones_has_the_gyros_that_she_says(run):
    """Her engine hides how quiet they are but for the floor between its lines: 8 and 16 times the noise was said, and refused."""
    outcome = aligned(moored, "navigation", 400.0)(1, run)
    assert outcome.refused == ""
    assert max(float(np.abs(x).max()) for x in outcome.ratios.values()) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("loud", [False, True])
def test_rows_louder_than_specified_are_in_sigma_where_the_log_does_not_rule_them_out(loud):
    """Gyros rounded to 300 of their noise: the log of a sway allows 1 to 24 times; heading was 5.5 sigmas off, `aligned`."""
    inputs, truth = BENCHES["swaying"].draw(5332, 2)
    if loud:
        spoil = next(item.apply for item in FAULTS if item.name == "coarse quantum")
        inputs, _ = spoil(inputs, np.random.default_rng([5332, 2, crc32(b"swaying coarse quantum")]))
    answer = align(inputs["record"], inputs["place"], inputs["imu"])
    assert bool(_said(answer) & {"specification.gyro_rows"}) == loud
    assert max(float(np.abs(x).max()) for x in misses(answer, truth).values()) < 3.0
