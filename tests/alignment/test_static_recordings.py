"""System 4 on real recordings: every method on one still log, and a specification from the Allan deviation."""

from dataclasses import replace

import numpy as np
import pytest

from tests import recordings
from truenorth.alignment import align
from truenorth.core.attitude import dcm_from_euler, dcm_from_rotation_vector, euler_from_dcm
from truenorth.core.units import significant
from truenorth.errors.large_azimuth import attitude_error, large_azimuth_system
from truenorth.errors.stationary import StationaryModel
from truenorth.errors.walks import Walks
from truenorth.filters import around_circle, extended, gaussian_sum
from truenorth.papers.static.gyrocompass import gyrocompass_loop
from truenorth.quality.noise import noise_coefficients
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.strapdown.inertial import earth_rotation, integrate
from truenorth.strapdown.level import increments

DEG_PER_HOUR = np.radians(1.0) / 3600.0


def _by_hypotheses(record, position, start, spec):
    """Gaussian sum of twelve extended filters around the circle."""
    integrals = integrate(record, 5.0)
    model = StationaryModel(position.lat, position.alt, Walks.of(spec))
    sigmas = [0.01, 0.01, 1.0, 1e-2, 1e-2, *[spec.gyro_bias] * 3, *[spec.accel_bias] * 2]
    P0 = np.diag(np.square(sigmas))
    system = large_azimuth_system(model, [integrals], start[None], P0, 1e-8)
    found = gaussian_sum(extended, system, around_circle(np.zeros(10), P0, 2, 12))
    B = attitude_error(found.hypotheses.likeliest[0])[0]
    return earth_rotation(integrals.time[-1], position.lat).T @ B.T @ start @ integrals.C_ib[-1]


@pytest.mark.slow
def test_every_method_on_the_laboratory_log_against_its_reference():
    """Heading to a tenth of a degree, level to .002 deg, by all methods; three start from an azimuth that is 140 deg off."""
    record, position, given = recordings.navgrade_static_beijing()
    spec = imu_spec("navigation")
    found = {}
    for method in ("analytic", "inertial", "oba", "kalman", "auto"):
        answer = align(record, position, spec, method=method)
        found[method] = answer.euler
        assert abs(np.degrees(answer.heading) - given["heading_cw"]) < 3 * np.degrees(answer.euler_sigma[0]) + 0.02
    level = align(record, position, spec, method="analytic").euler[1:]
    start = dcm_from_rotation_vector([0.0, 0.0, 2.4]) @ dcm_from_euler(np.radians(given["heading_cw"]), *level)
    dtheta, dvel = increments(record)
    loop = gyrocompass_loop(dtheta[None], dvel[None], record.interval, start[None], position.lat, position.alt)
    found["gyrocompass_loop"] = np.array(euler_from_dcm(loop[0]))
    found["gaussian_sum"] = np.array(euler_from_dcm(_by_hypotheses(record, position, start, spec)))
    for method, euler in found.items():
        heading, pitch, roll = np.degrees(euler)
        assert abs(heading - given["heading_cw"]) < (0.5 if method == "gyrocompass_loop" else 0.15), method
        assert abs(pitch - given["pitch"]) < 0.01, method
        assert abs(roll - given["roll"]) < 0.01, method


@pytest.mark.slow
def test_a_specification_from_the_allan_deviation_refuses_heading_with_figures():
    """The bias instability alone, two hundred times what a heading of 5 deg allows; the walk and it as the datasheet says."""
    record, position = recordings.static_adis16405()
    gyro, accel = noise_coefficients(record)
    spec = ImuSpec(
        gyro_bias=float(np.max(np.abs(record.gyro.mean(axis=0)))),
        gyro_random_walk=float(np.max(gyro.random_walk)),
        gyro_bias_instability=float(np.max(gyro.bias_instability)),
        accel_bias=imu_spec("consumer").accel_bias,
        accel_random_walk=float(np.max(accel.random_walk)),
        accel_bias_instability=float(np.max(accel.bias_instability)),
        name="adis16405 by Allan",
    )
    # Datasheet: 2.0 deg/sqrt(h), .007 deg/s of bias stability; .2 m/s/sqrt(h), .2 mg.
    assert np.degrees(spec.gyro_random_walk) * 60 == pytest.approx(2.0, rel=0.4)
    assert np.degrees(spec.gyro_bias_instability) == pytest.approx(0.007, rel=0.8)
    assert spec.accel_random_walk * 60 == pytest.approx(0.2, rel=0.5)
    answer = align(record.between(None, 600.0), position, spec)
    assert answer.status == "level_only"
    assert answer.summary()["heading_deg"] is None
    bias = significant(np.hypot(spec.gyro_bias, spec.gyro_bias_instability) / DEG_PER_HOUR)
    assert f"gyro bias can be {bias} deg/h (specification 'adis16405 by Allan')" in answer.reasons[0]
    assert "needs 0.8" in answer.reasons[0]  # w_ie cos(51 deg) tan(5 deg) = .83 deg/h
    assert np.all(np.isfinite(answer.euler_sigma[1:]))


@pytest.mark.parametrize("order", [(0, 2, 1), (1, 2, 0), (2, 0, 1), (2, 1, 0)])
def test_accelerometers_of_another_order_under_good_gyros(order):
    """A parked vehicle that people shake: the rate about the wrong vertical is as steady as no base turns."""
    record, position = recordings.rlg_vehicle_xian()
    window = record.between(record.time[0] + 300.0, record.time[0] + 600.0)
    answer = align(replace(window, accel=window.accel[:, list(order)]), position, "navigation")
    assert answer.status == "inconsistent"
    assert any(item.key == "rate.misses" for item in answer.evidence)
