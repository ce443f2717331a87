"""Vibration that a log hardly samples: the two errors of its integration, by that integration, and what answers make of them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests import recordings
from truenorth.campaign.fault_benches import BENCHES, RECEIVER, Bench, misses
from truenorth.quality.record_evidence import moving_evidence
from truenorth.quality.vibration import SMALLEST, vibration_evidence
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.records.vibration import coning_left, sampling_error
from truenorth.strapdown.coning import BEFORE
from truenorth.strapdown.level import increments

SIZES = np.radians([0.08, 0.056, 0.064])
PHASES = np.array([0.3, 2.0, 4.1])


def attitude(time, frequency):
    return Rotation.from_rotvec(SIZES * np.sin(2.0 * np.pi * frequency * np.asarray(time)[:, None] + PHASES))


def vibrating(frequency, rate, duration=60.0, step=1e-4):
    """Rates at their stamps, of a rotation that is known: differences of fourth order."""
    time = np.arange(1, round(duration * rate) + 1) / rate
    near, far = (
        (attitude(time - h, frequency).inv() * attitude(time + h, frequency)).as_rotvec() / (2.0 * h)
        for h in (step, 2.0 * step)
    )
    return ImuRecord(time, (4.0 * near - far) / 3.0, np.tile([0.0, 0.0, 9.8], (len(time), 1)), "rates")


def integrated(record, frequency):
    """Error of the attitude as the mechanisation integrates it: RMS about its drift along the worst axis, and the drift."""
    dtheta, _ = increments(record)
    phi = dtheta.copy()
    phi[1:] += BEFORE["previous"] * np.cross(dtheta[:-1], dtheta[1:])
    truth = attitude(record.time, frequency)
    at, error = truth[0], []
    for k in range(1, len(record)):
        at = at * Rotation.from_rotvec(phi[k])
        error.append((truth[k].inv() * at).as_rotvec())
    time, error = record.time[4:], np.array(error[3:])
    drift, start = np.polyfit(time, error, 1)
    left = error - np.outer(time, drift) - start
    return np.sqrt(np.linalg.eigvalsh(left.T @ left / len(left))[-1]), np.abs(drift).max()


@pytest.mark.parametrize(("frequency", "rate"), [(8.0, 50.0), (10.0, 50.0), (10.0, 100.0), (15.0, 100.0)])
def test_both_errors_are_those_of_the_integration(frequency, rate):
    record = vibrating(frequency, rate)
    angle, drift = integrated(record, frequency)
    assert sampling_error(record.gyro, record.interval) == pytest.approx(angle, rel=0.03)
    assert coning_left(record) == pytest.approx(drift, rel=0.02)


def test_axes_in_step_make_no_cone():
    time = np.arange(1, 3001) / 50.0
    rates = np.cos(2.0 * np.pi * 10.0 * time)[:, None] * np.array([0.08, 0.05, 0.06])
    record = ImuRecord(time, rates, np.tile([0.0, 0.0, 9.8], (3000, 1)), "rates")
    assert sampling_error(record.gyro, record.interval) > SMALLEST
    assert coning_left(record) < 1e-15


def test_increments_have_neither():
    record = vibrating(10.0, 50.0)
    counted = ImuRecord(record.time, record.gyro / 50.0, record.accel / 50.0, "increments")
    assert vibration_evidence(counted) == []
    assert coning_left(counted) == 0.0
    assert [item.key for item in moving_evidence(record) if item.kind == "known"] == ["record.vibration"]


def test_a_specification_has_the_drift_where_it_counts():
    record = vibrating(10.0, 50.0)
    spec = imu_spec("navigation")
    assert spec.with_coning_of(record).bias_variance[0] == pytest.approx(
        spec.bias_variance[0] + coning_left(record) ** 2
    )
    assert spec.with_coning_of(vibrating(1.0, 100.0)) is spec
    cheap = imu_spec("consumer")
    assert cheap.with_coning_of(record) is cheap


@pytest.mark.parametrize("name", ["static_adis16405", "stim300_cart_chicago", "mems_rotation_table"])
def test_recordings_have_none(name):
    record = getattr(recordings, name)()[0]
    assert vibration_evidence(record) == []


@pytest.mark.slow
def test_an_aircraft_whose_engines_shake_it():
    """Four flights at 50 Hz: level was 2.3 of its sigma off (RMS), 4 at the most."""
    tones = {"heading": 0.064, "pitch": 0.056, "roll": 0.08}
    shake = {name: [{"amplitude": f"{size} deg", "period": "0.1 s"}] for name, size in tones.items()}

    def scenario(rng):
        flight = BENCHES["transfer"].scenario(rng) | {"imu": "navigation", "output": "rates", "gnss": RECEIVER}
        flight.pop("master")
        return flight | {"disturbances": [{"kind": "sway", "tones": shake}]}

    bench = Bench("shaken", scenario, BENCHES["gnss"].align, BENCHES["gnss"].sits)
    found = []
    for run in range(4):
        inputs, truth = bench.draw(7, run)
        answer = bench.align(inputs)
        assert answer.status == "aligned"
        found.append(misses(answer, truth)["level"])
    assert np.sqrt(np.mean(np.square(found))) < 1.5
