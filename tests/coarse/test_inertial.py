"""Inertial-frame coarse alignment: exact for a perfect IMU, its covariance against Monte Carlo, latitude unknown."""

import numpy as np
import pytest

from tests import recordings
from truenorth.coarse import (
    coarse_covariance,
    dual_vector,
    estimate_latitude,
    latitude_sigma,
    means,
    oba,
    two_position,
)
from truenorth.coarse.uncertainty import base_velocity
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.position import Position
from truenorth.errors.staying import StaticModel
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import Sway, Tone, ideal_log, rest, simulate
from truenorth.strapdown.inertial import integrate

PLACE = Position.from_degrees(40.0, 118.0)
METHODS = [(method, form) for method in (dual_vector, oba) for form in ("velocity", "position")]


@pytest.mark.parametrize(("method", "form"), METHODS)
@pytest.mark.parametrize("lat", [-70.0, 0.0, 40.0])
def test_a_perfect_imu_turning_on_the_spot(method, form, lat):
    """An IMU that turns but does not go anywhere: what is left is the strapdown's own error."""
    place = Position.from_degrees(lat, 0.0)
    motion = Sway(place, 0.7, roll_tones=(Tone(0.2, 6.0),), heading_tones=(Tone(0.1, 9.0),))
    integrals = integrate(simulate(motion, rate=100.0, duration=120.0).record)
    coarse = method(integrals, place.lat, place.alt, form)
    assert np.max(np.abs(rotation_vector_from_dcm(coarse.C_n0_i @ motion.states(0.0).C_nb.T))) < 1e-6


def test_the_running_sum_ends_at_the_answer():
    integrals = integrate(simulate(rest(PLACE), rate=20.0, duration=60.0).record)
    coarse = oba(integrals, PLACE.lat, PLACE.alt)
    np.testing.assert_array_equal(coarse.C_history[-1], coarse.C_n0_i)
    assert len(coarse.C_history) == len(integrals.time)


@pytest.mark.parametrize(("method", "form"), METHODS)
def test_covariance_is_that_of_monte_carlo(method, form):
    """80 runs on a still base: RMS/sigma of each axis within .7 to 1.3 (5 sigma of an RMS of 80 is .4)."""
    spec = ImuSpec(gyro_bias=5e-8, gyro_random_walk=2e-6, accel_bias=3e-4, accel_random_walk=5e-4, name="coarse")
    ideal = ideal_log(rest(PLACE, 0.9, 0.1, 0.05), rate=10.0, duration=120.0)
    C = ideal.motion.states(0.0).C_nb
    P = np.diag(np.repeat([spec.gyro_bias**2, spec.accel_bias**2], 3))
    model = StaticModel(spec.gyro_random_walk, spec.accel_random_walk)
    errors, variances = [], []
    for run in range(80):
        integrals = integrate(simulate(ideal, imu=spec, seed=31, run=run).record)
        coarse = method(integrals, PLACE.lat, PLACE.alt, form)
        covariance, floor = coarse_covariance(coarse, integrals, model, P, np.zeros(3))
        assert np.all(np.linalg.eigvalsh(covariance - floor) > -1e-18)
        errors.append(-rotation_vector_from_dcm(coarse.C_n0_i @ C.T))
        variances.append(np.diag(covariance))
    ratio = np.sqrt(np.mean(np.square(errors), axis=0) / np.mean(variances, axis=0))
    assert np.all((ratio > 0.7) & (ratio < 1.3)), ratio


@pytest.mark.parametrize("lat", [-55.0, -20.0, 35.0, 70.0])
def test_latitude_is_found_with_its_sign(lat):
    place = Position.from_degrees(lat, 0.0)
    integrals = integrate(simulate(rest(place, 0.4), rate=20.0, duration=300.0).record)
    assert estimate_latitude(integrals) == pytest.approx(place.lat, abs=2e-4)


@pytest.mark.slow
def test_latitude_sigma_is_that_of_monte_carlo():
    spec = ImuSpec(gyro_bias=2e-8, gyro_random_walk=2e-7, accel_random_walk=1e-4, name="latitude")
    ideal = ideal_log(rest(PLACE, 0.9), rate=10.0, duration=200.0)
    P = np.diag(np.repeat([spec.gyro_bias**2, 0.0], 3))
    model = StaticModel(spec.gyro_random_walk, spec.accel_random_walk)
    errors, sigmas = [], []
    for run in range(40):
        integrals = integrate(simulate(ideal, imu=spec, seed=41, run=run).record)
        lat = estimate_latitude(integrals)
        C = oba(integrals, lat, 0.0).C_n0_i
        errors.append(lat - PLACE.lat)
        sigmas.append(latitude_sigma(lat, 0.0, C, integrals, model, P, np.zeros(3)))
    ratio = np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(sigmas)))
    assert 0.6 < ratio < 1.45  # 4 sigma of an RMS of 40


def test_latitude_of_the_ring_laser_log():
    record, position = recordings.rlg_vehicle_xian()
    integrals = integrate(record)
    lat = estimate_latitude(integrals, position.alt)
    spec = imu_spec("navigation")
    C = oba(integrals, lat, position.alt).C_n0_i
    disturbance = np.sqrt(np.mean(base_velocity(integrals, C, lat, position.alt) ** 2, axis=0))
    P = np.diag(np.repeat([spec.gyro_bias**2, spec.accel_bias**2], 3))
    model = StaticModel(spec.gyro_random_walk, spec.accel_random_walk)
    sigma = latitude_sigma(lat, position.alt, C, integrals, model, P, disturbance)
    assert abs(lat - position.lat) < 3 * sigma
    assert abs(np.degrees(lat - position.lat)) < 0.5


def test_two_positions_take_the_biases_out():
    """Turned by 180 deg about the vertical: horizontal biases separate exactly, the vertical one keeps its prior mean."""
    eps, nabla = np.array([5e-7, -3e-7, 0.0]), np.array([2e-3, -1e-3, 0.0])
    motion = rest(PLACE, 0.6)
    clean = simulate(motion, rate=10.0, duration=60.0).record
    C_b1_b2 = dcm_from_rotation_vector(np.array([0.0, 0.0, np.pi]))
    from truenorth.records import ImuRecord

    def biased(record):
        T = record.interval
        return ImuRecord(record.time, record.gyro + T * eps, record.accel + T * nabla, record.kind)

    first, second = means(biased(clean)), means(biased(clean.rotated(C_b1_b2.T)))
    C_nb, gyro_bias, accel_bias = two_position(first, second, C_b1_b2, PLACE.lat, 1e-6, 1e-2)
    np.testing.assert_allclose(gyro_bias[:2], eps[:2], atol=1e-12)
    np.testing.assert_allclose(accel_bias[:2], nabla[:2], atol=1e-8)
    assert np.max(np.abs(rotation_vector_from_dcm(C_nb @ motion.states(0.0).C_nb.T))) < 1e-6
