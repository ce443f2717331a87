"""Vibration that a log hardly samples: the two errors of its integration, by that integration, and what answers make of them."""

from itertools import accumulate

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests import recordings
from tests.runs import some
from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES, RECEIVER, Bench, misses
from truenorth.core.earth import earth_rate_n, normal_gravity
from truenorth.core.position import Position
from truenorth.quality.record_evidence import moving_evidence
from truenorth.quality.vibration import SMALLEST, vibration_evidence
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.records.vibration import cone_drift, coning_left, sampling_error
from truenorth.simulation import rest
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
    turns = Rotation.from_rotvec(phi).as_matrix()
    turns[0] = truth[0].as_matrix()
    at = Rotation.from_matrix(list(accumulate(turns, np.matmul)))
    time, error = record.time[4:], (truth.inv() * at).as_rotvec()[4:]
    drift, start = np.polyfit(time, error, 1)
    left = error - np.outer(time, drift) - start
    return np.sqrt(np.linalg.eigvalsh(left.T @ left / len(left))[-1]), np.abs(drift).max()


@pytest.mark.parametrize(("frequency", "rate"), [(8.0, 50.0), (10.0, 50.0), (10.0, 100.0), (15.0, 100.0)])
def test_both_errors_are_those_of_the_integration(frequency, rate):
    record = vibrating(frequency, rate)
    angle, drift = integrated(record, frequency)
    assert sampling_error(record.gyro, record.interval) == pytest.approx(angle, rel=0.03)
    assert coning_left(record) == pytest.approx(drift, rel=0.02)


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize(("frequency", "rate"), some([(5.0, 200.0), (20.0, 100.0)], [(17.3, 200.0)]))
def test_the_mean_rate_of_a_base_that_trembles_is_short_of_its_turn_by_the_cone(frequency, rate, kind):
    """It comes back to where it was; the mean of its gyros does not."""
    if kind == "rates":
        record = vibrating(frequency, rate)
        mean = record.gyro.mean(axis=0)
    else:
        fine = vibrating(frequency, 10.0 * rate)
        parts = fine.gyro.reshape(-1, 10, 3).sum(axis=1) * fine.interval
        force = 9.8 / rate * np.array([0.0, 0.0, 1.0]) + np.zeros_like(parts)
        record = ImuRecord(fine.time[9::10], parts, force, "increments")
        mean = parts.mean(axis=0) * rate
    assert np.abs(mean).max() > np.radians(0.5) / 3600.0
    np.testing.assert_allclose(cone_drift(record), -mean, rtol=5e-3, atol=1e-9)


@pytest.mark.parametrize("off", [0.0, 0.1])
def test_a_base_on_a_cone_is_aligned_and_a_gyro_out_of_specification_on_it_is_not(off):
    """Mean rates 4 deg/h short of the earth's were "missed": 7 of 7 sound logs at 200 Hz; one gyro off by ten sigmas is one."""
    place, C = Position.from_degrees(45.0, 10.0), rest(Position.from_degrees(45.0, 10.0), 0.7).states(0.0).C_nb
    shaken = vibrating(10.0, 200.0, duration=300.0)
    swing = attitude(shaken.time, 10.0).inv()
    earth, up = (
        swing.apply(C.T @ earth_rate_n(place.lat)),
        swing.apply(C.T @ [0.0, 0.0, normal_gravity(place.lat, 0.0)]),
    )
    spec, rng = imu_spec("navigation"), np.random.default_rng(8814)
    noise = [
        s * np.sqrt(200.0) * rng.standard_normal(up.shape) for s in (spec.gyro_random_walk, spec.accel_random_walk)
    ]
    gyro = shaken.gyro + earth + noise[0] + np.radians(off) / 3600.0 * np.array([0.0, 1.0, 0.0])
    answer = align(ImuRecord(shaken.time, gyro, up + noise[1]), place, spec)
    assert (answer.status == "inconsistent") == (off > 0.0)
    if off:
        assert any(item.key == "rate.misses" for item in answer.evidence)
    else:
        phi = -Rotation.from_matrix(
            answer.C_nb @ (C @ attitude(answer.time * np.ones(1), 10.0).as_matrix()[0]).T
        ).as_rotvec()
        assert np.abs(phi[2]) < 4.0 * np.sqrt(answer.phi_covariance[2, 2])


def test_axes_in_step_make_no_cone():
    time = np.arange(1, 3001) / 50.0
    rates = np.cos(2.0 * np.pi * 10.0 * time)[:, None] * np.array([0.08, 0.05, 0.06])
    record = ImuRecord(time, rates, np.tile([0.0, 0.0, 9.8], (3000, 1)), "rates")
    assert sampling_error(record.gyro, record.interval) > SMALLEST
    assert coning_left(record) < 1e-15


def test_increments_have_neither():
    shaken = vibrating(9.0, 50.0)  # at 10 Hz every fifth row is alike, as of five sensors in turn
    gravity = attitude(shaken.time, 9.0).inv().apply([0.0, 0.0, 9.8])  # without its tilt this is a hum
    record = ImuRecord(shaken.time, shaken.gyro, gravity, "rates")
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
