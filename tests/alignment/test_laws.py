"""Laws of alignment: closed-form limits, equivariance, honest sigmas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from tests.runs import few_and_all, some
from truenorth.alignment import align
from truenorth.core.attitude import (
    dcm_from_euler,
    dcm_from_rotation_vector,
    euler_from_dcm,
    euler_jacobian,
    rotation_vector_from_dcm,
)
from truenorth.core.earth import EARTH_RATE, normal_gravity
from truenorth.core.position import Position
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import Sway, Tone, ideal_log, rest, simulate
from truenorth.simulation.scenario import read_scenario

XIAN = Position.from_degrees(34.25, 108.9, 380.0, horizontal_sigma=0.0, vertical_sigma=0.0)


def misalignment(answer, C_nb) -> np.ndarray:
    """``phi`` of ``C_hat = exp(-[phi x]) C``."""
    return -rotation_vector_from_dcm(answer.C_nb @ C_nb.T)


def biased(record: ImuRecord, eps, nabla) -> ImuRecord:
    T = record.interval
    return ImuRecord(record.time, record.gyro + np.asarray(eps) * T, record.accel + np.asarray(nabla) * T, "increments")


@pytest.mark.parametrize("method", ["analytic", "inertial", "oba", "kalman"])
@pytest.mark.parametrize("lat", some([-60.0, 40.0], [-5.0]))
def test_static_limits(method, lat):
    """phi_E = -nabla_N/g, phi_N = nabla_E/g, phi_U = -eps_E/(w_ie cos L) + phi_N tan L, for every sign of each."""
    position = Position.from_degrees(lat, 10.0, 0.0, horizontal_sigma=0.0, vertical_sigma=0.0)
    motion = rest(position, 0.6)
    clean = simulate(motion, rate=50.0, duration=300.0).record
    C = motion.states(0.0).C_nb
    g = float(normal_gravity(position.lat, position.alt))
    eps_n, nabla_n = np.array([3e-8, 0.0, 0.0]), np.array([4e-4, -2e-4, 0.0])
    answer = align(biased(clean, C.T @ eps_n, C.T @ nabla_n), position, "navigation", method=method)
    phi_N = nabla_n[0] / g
    expected = [
        -nabla_n[1] / g,
        phi_N,
        -eps_n[0] / (EARTH_RATE * np.cos(position.lat)) + phi_N * np.tan(position.lat),
    ]
    np.testing.assert_allclose(misalignment(answer, C), expected, rtol=0.03, atol=2e-7)


@pytest.mark.parametrize("method", ["analytic", "inertial", "oba", "kalman"])
@pytest.mark.parametrize("lat", some([-34.0, 0.0], [-80.0, 80.0]))
def test_a_perfect_imu_is_aligned_perfectly(method, lat):
    position = Position.from_degrees(lat, 10.0, 0.0)
    motion = rest(position, np.radians(222.0), 0.2, -0.4)
    answer = align(simulate(motion, rate=50.0, duration=120.0).record, position, "navigation", method=method)
    assert np.max(np.abs(misalignment(answer, motion.states(0.0).C_nb))) < 2e-7


@pytest.mark.parametrize("method", ["analytic", "inertial", "oba", "kalman"])
def test_turned_body_axes_turn_the_answer(method):
    """The same log in other body axes gives the same body, whatever the axes: near-vertical and upside down too."""
    log = simulate(rest(XIAN, 1.0, 0.1, 0.2), imu=imu_spec("navigation"), rate=20.0, duration=120.0, seed=4).record
    reference = align(log, XIAN, "navigation", method=method)

    @given(st.integers(0, 2**31 - 1))
    @settings(max_examples=4, deadline=None)
    def turned(seed):
        C_new_old = Rotation.random(random_state=seed).as_matrix()
        answer = align(log.rotated(C_new_old), XIAN, "navigation", method=method)
        expected = reference.C_nb @ C_new_old.T
        # Biases' priors are alike on all axes, so that nothing but rounding and the last pass's residue is left.
        sigma = np.sqrt(np.min(np.diag(reference.phi_covariance)))
        assert np.max(np.abs(rotation_vector_from_dcm(answer.C_nb @ expected.T))) < 0.02 * sigma

    turned()


@pytest.mark.parametrize("pitch", [90.0, -90.0, 89.9])
def test_near_vertical_pitch_gives_the_combination(pitch):
    motion = rest(XIAN, np.radians(40.0), np.radians(pitch), np.radians(10.0))
    log = simulate(motion, imu=imu_spec("navigation"), rate=20.0, duration=300.0, seed=2).record
    answer = align(log, XIAN, "navigation")
    assert answer.near_vertical
    name, value, sigma = answer.azimuth
    expected = np.radians(30.0 if pitch > 0 else 50.0)
    assert name == ("heading_minus_roll" if pitch > 0 else "heading_plus_roll")
    assert answer.status == "aligned"
    assert abs(value - expected) < 4 * sigma < np.radians(0.5)
    assert "C_nb" in answer.summary()


@given(st.floats(0, 2 * np.pi), st.floats(-1.4, 1.4), st.floats(-3, 3), st.integers(0, 2**31 - 1))
@settings(max_examples=60, deadline=None)
def test_euler_jacobian_is_the_derivative(heading, pitch, roll, seed):
    C = dcm_from_euler(heading, pitch, roll)
    phi = np.random.default_rng(seed).standard_normal(3) * 1e-6
    moved = euler_from_dcm(dcm_from_rotation_vector(-phi) @ C)
    change = np.array([np.angle(np.exp(1j * (a - b))) for a, b in zip(moved, (heading, pitch, roll), strict=True)])
    np.testing.assert_allclose(change, euler_jacobian(C) @ phi, atol=1e-9)


SHIP = Sway(
    XIAN,
    np.radians(-30.0),
    heading_tones=(Tone(np.radians(5), 7, np.pi / 3),),
    pitch_tones=(Tone(np.radians(7), 5, np.pi / 4),),
    roll_tones=(Tone(np.radians(10), 6, np.pi / 7),),
    east_tones=(Tone(0.02, 7, 0.3),),
    north_tones=(Tone(0.03, 6, 1.0),),
    up_tones=(Tone(0.3, 8, 2.0),),
    lever_arm=(1.0, 3.0, 1.0),
)


def _study(motion, spec, runs, duration, rate=50.0, **options):
    ideal = ideal_log(motion, rate=rate, duration=duration)
    C = motion.states(duration).C_nb
    errors, answers = [], []
    for run in range(runs):
        log = simulate(ideal, imu=spec, seed=20, run=run)
        answer = align(log.record, motion.position, spec, **options)
        errors.append(misalignment(answer, C))
        answers.append(answer)
    covariance = np.array([a.phi_covariance for a in answers])
    return np.array(errors), covariance, answers


@few_and_all(100, few=20)
def test_still_base_sigmas_are_honest(runs):
    """Navigation grade: RMS/sigma per axis .8 to 1.25 of 100 runs (of few its 99.9 % band), and NEES within its 95 % band.

    The specification's deflection of the vertical is not in the simulated gravity, and is taken out of the covariance.
    """
    spec = imu_spec("navigation")
    position = Position.from_degrees(40.0, 118.0, 0.0)
    errors, covariance, answers = _study(
        rest(position, 0.65, 0.03, -0.05), spec, runs, 300.0, rate=20.0, method="kalman"
    )
    from truenorth.coarse.analytic import static_jacobian
    from truenorth.core.earth import DEFLECTION

    J = static_jacobian(position.lat, 9.8)[:, :2] * 9.8 * DEFLECTION
    covariance = covariance - J @ J.T
    ratio = np.sqrt(np.mean(errors**2 / np.einsum("kii->ki", covariance), axis=0))
    low, high = (0.8, 1.25) if runs == 100 else np.sqrt(chi2.ppf([5e-4, 1 - 5e-4], runs) / runs)
    assert np.all((ratio > low) & (ratio < high)), ratio
    nees = np.einsum("ki,kij,kj->k", errors, np.linalg.inv(covariance), errors)
    low, high = chi2.ppf([0.025, 0.975], 3 * runs)  # of 100 runs: 253.9 to 349.9
    assert low < nees.sum() < high, nees.sum()
    assert sum(a.status == "aligned" for a in answers) >= 0.97 * runs


@pytest.mark.slow
def test_innovations_of_a_still_base_are_as_large_as_expected():
    """NIS over 3 rows of six logs of 600 s, each within a tenth of 1: 1800 squares scatter by .033 at one sigma.

    A bias along gravity, or innovations coloured by chance, once made the base's motion ten times what it was.
    """
    scenario = read_scenario("static_kalman")
    for run in range(6):
        sim = scenario.simulate(seed=0, run=run)
        found = align(sim.record, Position(scenario.position.lat), scenario.imu_spec, method="kalman").history
        count = np.isfinite(found.innovation).sum()
        assert abs(np.nansum(found.nis) / count - 1.0) < 0.1


@few_and_all(24, few=2)
def test_swaying_base_sigma_is_honest(runs):
    """Runs on an unrotated base: heading is the gyro bias, levels the accelerometers' and the plumb line's sigma.

    RMS over sigma within its band of 99.9 %, .52 to 1.48 of 24 runs (levels are drawn from the biases alone: the deflection
    of the vertical is in sigma, not in the simulated gravity).
    """
    spec = imu_spec("navigation")
    errors, covariance, answers = _study(SHIP, spec, runs, 300.0, rate=50.0)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    sigma = np.sqrt(np.mean(np.einsum("kii->ki", covariance), axis=0))
    low, high = np.sqrt(chi2.ppf([5e-4, 1 - 5e-4], runs) / runs)
    assert np.all(rms < high * sigma), (rms, sigma)
    assert rms[2] > low * sigma[2]
    assert all(a.method == "swaying" for a in answers)
    assert sum(a.status == "aligned" for a in answers) >= runs - 1


def test_floor_and_random_part_on_a_still_base():
    """The floor is the closed form of the biases' specification; the random part falls with time."""
    spec = ImuSpec(gyro_bias=5e-8, gyro_random_walk=3e-7, accel_bias=5e-4, accel_random_walk=1e-4, name="t")
    position = Position.from_degrees(40.0, 118.0, 0.0)
    motion = rest(position, 0.3)
    sigmas = {}
    for duration in (120.0, 600.0):
        answer = align(simulate(motion, imu=spec, rate=20.0, duration=duration, seed=1).record, position, spec)
        random = answer.euler_sigma[0] ** 2 - answer.euler_sigma_floor[0] ** 2
        sigmas[duration] = np.sqrt(random)
    level = np.hypot(5e-4 / float(normal_gravity(position.lat, 0.0)), np.radians(5 / 3600))
    heading = np.hypot(5e-8 / (EARTH_RATE * np.cos(position.lat)), level * np.tan(position.lat))
    np.testing.assert_allclose(answer.euler_sigma_floor, [heading, level, level], rtol=0.02)
    assert sigmas[600.0] < 0.6 * sigmas[120.0]


def test_a_base_that_leaves_is_said():
    """A north ramp to .05 m/s from half time on: mean NIS does not see it, the drift test does."""
    spec = imu_spec("navigation")
    log = simulate(rest(XIAN), imu=spec, rate=20.0, duration=300.0, seed=3).record
    acceleration = np.where(log.time > 150.0, 0.05 / 150.0, 0.0)[:, None] * np.array([0.0, 1.0, 0.0])
    leaving = ImuRecord(log.time, log.gyro, log.accel + acceleration * log.interval, "increments")
    answer = align(leaving, XIAN, spec)
    assert answer.status == "inconsistent"
    assert "drifts north" in answer.reasons[0]
    assert align(log, XIAN, spec).status == "aligned"


def test_a_wrong_latitude_contradicts_a_good_imu():
    log = simulate(rest(XIAN), imu=imu_spec("navigation"), rate=20.0, duration=300.0, seed=3).record
    answer = align(log, Position.from_degrees(36.25, 108.9, 380.0), "navigation")
    assert answer.status == "inconsistent"
    assert "check the latitude" in answer.reasons[0]


def test_at_the_pole_there_is_no_north():
    pole = Position.from_degrees(89.995, 0.0, 0.0)
    log = simulate(rest(pole), imu=imu_spec("navigation"), rate=20.0, duration=300.0).record
    answer = align(log, pole, "navigation")
    assert answer.status == "not_observable"
    assert answer.summary()["heading_deg"] is None


def test_convergence_ends_at_the_answer_without_the_bases_motion():
    """What earlier epochs would have said of the final attitude: no trace of 10 deg of sway, and within the sigmas."""
    log = simulate(SHIP, imu=imu_spec("navigation"), rate=50.0, duration=300.0, seed=4).record
    answer = align(log, XIAN, "navigation")
    angles, sigmas = answer.convergence
    np.testing.assert_allclose(angles[-1], answer.euler, atol=1e-9)
    late = slice(len(angles) // 2, None)
    assert np.max(np.abs(angles[late] - answer.euler) / sigmas[late]) < 3.0
    assert np.max(np.abs(np.degrees(angles[late, 1:] - answer.euler[1:]))) < 0.01
