"""Large azimuth: the models against each other, against their Jacobians and against a log of known attitude."""

import math

import numpy as np
import pytest

from truenorth.core.attitude import dcm_from_euler, dcm_from_rotation_vector
from truenorth.core.position import Position
from truenorth.errors.large_azimuth import attitude_error, large_azimuth_system
from truenorth.errors.stationary import BA, BG, DV, PHI, StationaryModel
from truenorth.filters import check_jacobians
from truenorth.simulation import rest, simulate
from truenorth.strapdown.inertial import earth_rotation, integrate

LAT, HEADING = math.radians(50.0), 0.7
P0 = np.diag([3e-3, 3e-3, 1.8, 1e-3, 1e-3, 5e-8, 5e-8, 5e-8, 1e-3, 1e-3]) ** 2
FORMS = ("tilt_azimuth", "rotation_vector", "quaternion")


@pytest.fixture(scope="module")
def log():
    """A still base with constant biases, no noise; its integrals of 5 s and the biases."""
    gyro, accel = (3e-7, -2e-7, 1e-7), (2e-3, -1e-3, 0.0)
    errors = {"gyro_bias": gyro, "accel_bias": accel}
    made = simulate(rest(Position(LAT), HEADING), rate=10.0, duration=120.0, errors=errors)
    return integrate(made.record, 5.0), np.array(gyro), np.array(accel)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("azimuth", [0.0, 0.4, -2.0, 3.0])
def test_the_true_state_predicts_the_log(log, form, azimuth):
    """The INS's velocity and attitude after 120 s from a wrong azimuth, tilted by 2 arcmin, from the true state."""
    integrals, gyro, accel = log
    wrong = dcm_from_rotation_vector([-6e-4, 4e-4, 0.0]) @ dcm_from_rotation_vector([0.0, 0.0, -azimuth])
    start = wrong @ dcm_from_euler(HEADING, 0.0, 0.0)
    system = large_azimuth_system(StationaryModel(LAT), [integrals], start[None], P0, 1e-10, form)
    x = _state(form, wrong, azimuth)
    x[-5:-2], x[-2:] = gyro, accel[:2]
    for k in range(system.p.shape[1]):
        out = np.empty_like(x)
        system.transition(x, system.p[0, k], out)
        x = out
        np.testing.assert_allclose(x[-7:-5], system.z[0, k], atol=3e-6 * (k + 1))
    C_hat = start @ integrals.C_ib[-1]
    truth = earth_rotation(integrals.time[-1], LAT) @ dcm_from_euler(HEADING, 0.0, 0.0)
    np.testing.assert_allclose(attitude_error(x, form).T @ C_hat, truth, atol=2e-7)


def _state(form, wrong, azimuth):
    from truenorth.core.attitude import quaternion_from_dcm, rotation_vector_from_dcm

    if form == "quaternion":
        return np.concatenate([quaternion_from_dcm(wrong), np.zeros(7)])
    if form == "rotation_vector":
        return np.concatenate([-rotation_vector_from_dcm(wrong), np.zeros(7)])
    return np.concatenate([[6e-4, -4e-4, azimuth], np.zeros(7)])


def test_jacobians_and_linearity_in_all_but_the_azimuth(log):
    integrals, *_ = log
    system = large_azimuth_system(StationaryModel(LAT), [integrals], np.eye(3)[None], P0, 1e-10)
    check_jacobians(system, np.random.default_rng(0))
    check = check_jacobians(system, np.random.default_rng(0), tolerance=1e-3, nonlinear=[2])
    assert check.transition < 1e-3


def test_small_azimuth_is_the_linear_model(log):
    """Phi of the ten states, over a short interval in which the earth does not turn the frame."""
    integrals, *_ = log
    C = dcm_from_euler(HEADING, 0.0, 0.0)
    system = large_azimuth_system(StationaryModel(LAT), [integrals], C[None], P0, 1e-10)
    out = np.zeros((10, 10))
    system.transition_jacobian(np.zeros(10), system.p[0, 0], out)
    F = StationaryModel(LAT).dynamics(C)
    np.testing.assert_allclose(out[DV, :2], 5.0 * F[DV, :2], rtol=1e-3, atol=1e-2)
    np.testing.assert_allclose(out[DV, BA], 5.0 * F[DV, BA], rtol=1e-3, atol=2e-3)
    np.testing.assert_allclose(out[PHI, BG], 5.0 * F[PHI, BG], rtol=1e-3, atol=2e-3)
    # The tilt that the azimuth makes in n, -wc phi_U t, is gravity's turn in n0: g wc T^2/2 of velocity.
    assert out[4, 2] == pytest.approx(F[0, 2] * StationaryModel(LAT).gravity * 5.0**2 / 2, rel=1e-3)
    assert abs(out[3, 2]) < 1e-3 * abs(out[4, 2])
