"""Gyros that hum without a tilt of gravity, and a base that really trembles."""

import math
from dataclasses import replace

import numpy as np
import pytest

from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.campaign.faults import run_faults
from truenorth.quality.hum import Hum, hum_evidence, hum_of
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.records.vibration import share_left
from truenorth.state.wording import sentence

RATE, ROWS, G = 100.0, 6000, 9.8
TIME = np.arange(ROWS) / RATE
LAT = math.radians(40.0)
NOISE = (3e-7 * math.sqrt(RATE), 1e-4 * math.sqrt(RATE))  # of a navigation-grade IMU: rad/s, m/s^2


def log(rng, frequency, size, *, tilts, arm=0.0, shares=(1.0, 1.0), axes=(1.0, 1.0, 0.0)):
    """A cone of `size` (rad) about x and y, as gyros show it; where it tilts, with what it makes of gravity and on an arm up.

    `shares`: of the amplitudes, that low passes of gyros and accelerometers leave; `axes`: about which it is.
    """
    w = 2.0 * np.pi * frequency
    turn = size * np.multiply(axes, np.column_stack([np.sin(w * TIME), np.cos(w * TIME), np.zeros(ROWS)]))
    rate = size * w * np.multiply(axes, np.column_stack([np.cos(w * TIME), -np.sin(w * TIME), np.zeros(ROWS)]))
    force = np.tile([0.0, 0.0, G], (ROWS, 1))
    if tilts:
        force += shares[1] * np.cross([0.0, 0.0, G - w**2 * arm], turn)
    rate *= shares[0]
    gyro, accel = (
        values + sigma * rng.standard_normal((ROWS, 3)) for values, sigma in zip((rate, force), NOISE, strict=True)
    )
    return ImuRecord(TIME, gyro, accel, "rates")


def together(hums):
    """What is one for sure, and what slow accelerometers may hide."""
    return Hum(sum(x.drift for x in hums), math.hypot(*(x.turn for x in hums)))


def passes(frequency, bandwidth, order):
    """Share of an amplitude that a low pass leaves."""
    return 1.0 / math.sqrt(1.0 + (frequency / bandwidth) ** (2 * order))


@pytest.mark.parametrize("frequency", [7.0, 20.0, 40.0])
@pytest.mark.parametrize("size", [2.5e-5, 1e-3])
def test_a_hum_is_a_drift_and_a_turn_that_nothing_has(frequency, size):
    found = together(hum_of(log(np.random.default_rng(1), frequency, size, tilts=False)))
    x = 2.0 * np.pi * frequency / RATE
    drift = (
        0.5 * RATE * x * size**2 * (1.0 + float(share_left(x)))
    )  # of which the integration makes less the fewer rows there are
    assert np.linalg.norm(found.drift) == pytest.approx(drift, rel=0.05)
    assert found.turn == pytest.approx(size / math.sqrt(2.0), rel=0.05)


@pytest.mark.parametrize("frequency", [7.0, 20.0, 40.0])
@pytest.mark.parametrize("arm", [0.0, -0.02, 0.05, 1.0])
def test_a_base_that_trembles_hums_in_nothing(frequency, arm):
    for size in (3e-5, 1e-3):
        assert hum_evidence(log(np.random.default_rng(2), frequency, size, tilts=True, arm=arm), LAT) == []


@pytest.mark.parametrize("frequency", [11.0, 20.0])
@pytest.mark.parametrize("bandwidth", [5.0, 10.0, 50.0])
@pytest.mark.parametrize("order", [1, 2])
def test_nor_with_accelerometers_that_are_slower_or_faster_than_the_gyros(frequency, bandwidth, order):
    share = passes(frequency, bandwidth, order)
    for size in (1e-4, 1e-3):
        slow = log(np.random.default_rng(4), frequency, size, tilts=True, shares=(1.0, share))
        assert hum_evidence(slow, LAT, ImuSpec(accel_bandwidth=bandwidth, accel_filter_order=order)) == []
        fast = log(np.random.default_rng(5), frequency, size, tilts=True, shares=(share, 1.0))
        assert hum_evidence(fast, LAT, ImuSpec(gyro_bandwidth=bandwidth, gyro_filter_order=order)) == []


def test_accelerometers_of_which_nothing_is_said_may_be_the_slower_ones():
    for bandwidth in (5.0, 8.0):
        record = log(np.random.default_rng(6), 20.0, 1e-3, tilts=True, shares=(1.0, passes(20.0, bandwidth, 2)))
        for imu in (None, ImuSpec(), ImuSpec(gyro_bandwidth=50.0)):
            (found,) = hum_evidence(record, LAT, imu)
            assert (found.key, found.kind) == ("record.hum_or_slow", "hint")


@pytest.mark.parametrize("imu", [None, ImuSpec(), ImuSpec(accel_bandwidth=50.0, gyro_bandwidth=50.0)])
def test_a_hum_that_no_bandwidth_explains_is_one(imu):
    (found,) = hum_evidence(log(np.random.default_rng(7), 20.0, 1e-3, tilts=False), LAT, imu)
    assert (found.key, found.kind) == ("record.hum", "known")


def test_a_bandwidth_that_is_given_makes_a_hum_sure_whose_tilt_noise_half_hides():
    record = log(np.random.default_rng(8), 20.0, 1e-4, tilts=False)
    assert [item.kind for item in hum_evidence(record, LAT)] == ["hint"]
    assert [item.kind for item in hum_evidence(record, LAT, ImuSpec(accel_bandwidth=100.0))] == ["known"]


def test_about_one_axis_the_turn_counts_and_is_named():
    (found,) = hum_evidence(log(np.random.default_rng(9), 20.0, 1e-3, tilts=False, axes=(1.0, 0.0, 0.0)), LAT)
    assert found.effect.heading == pytest.approx(1e-3 / math.sqrt(2.0), rel=0.05)
    assert "hum by 2.4" in sentence(found)


def test_a_base_that_trembles_faster_than_its_accelerometers_is_aligned():
    """A cone of .34 arcmin at 11 Hz with accelerometers of 5 Hz was refused."""
    for run in (0, 1):
        inputs, truth = BENCHES["still"].draw(12, run)
        record, frequency = inputs["record"], 11.0
        unit = record.interval if record.kind == "increments" else 1.0
        w, x = 2.0 * math.pi * frequency, 2.0 * math.pi * frequency * record.time
        turn = 1e-4 * np.column_stack([np.sin(x), np.cos(x), 0.0 * x])
        rate = 1e-4 * w * np.column_stack([np.cos(x), -np.sin(x), 0.0 * x + 0.5e-4])
        force = (
            passes(frequency, 5.0, 1) * G * np.cross(record.accel / np.linalg.norm(record.accel, axis=1)[:, None], turn)
        )
        record = replace(record, gyro=record.gyro + unit * rate, accel=record.accel + unit * force)
        imu = replace(inputs["imu"], accel_bandwidth=5.0)
        answer = BENCHES["still"].align({**inputs, "record": record, "imu": imu})
        assert answer.status == "aligned"
        assert all(np.all(np.abs(miss) < 3.0) for miss in misses(answer, truth).values())


def test_noise_alone_is_no_hum():
    for seed in range(20):
        assert hum_evidence(log(np.random.default_rng(seed), 20.0, 0.0, tilts=False), LAT) == []


def test_a_log_too_short_or_too_slow_says_nothing():
    record = log(np.random.default_rng(3), 20.0, 1e-3, tilts=False)
    assert hum_evidence(record[:20], LAT) == []
    for times in (10.0, 20.0):  # a row of 10 Hz shows 5 Hz alone
        assert hum_evidence(ImuRecord(times * TIME, record.gyro, record.accel, "rates"), LAT) == []


@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["still", "swaying", "rotary"])
def test_none_passes_in_silence(procedure):
    assert [t for t in run_faults([procedure], ["hum"], runs=14, seed=303) if t.outcome == "silent"] == []
