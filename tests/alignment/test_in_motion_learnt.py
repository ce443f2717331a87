"""What a pass teaches of its sensors: noise larger than said, a receiver that is late, a class of IMU that is too good."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty import moving
from benchmarks.honesty.harness import simulated
from truenorth.aiding.sensors import from_gnss
from truenorth.aiding.source import Aiding
from truenorth.alignment.in_motion import align_in_motion
from truenorth.alignment.in_motion_task import usual_antenna
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.estimate.poorer import poorer
from truenorth.quality.aid_noise import changed, noise_factors
from truenorth.quality.density import with_noise_of
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.state.layout import Layout
from truenorth.state.track import Residuals, Track

SEED = 41  # any
T = np.arange(400.0)


def track_of(innovation, sigma, speed=10.0):
    """Of a vehicle with a speed (M,), m/s, whose sources say so."""
    yes = np.ones(len(T), bool)
    nis = np.sum((innovation / sigma) ** 2, axis=1)
    residuals = Residuals("log", T, innovation, sigma, nis, yes, 0, T, ~yes)
    v_n, place, sensors = np.zeros((len(T), 3)), np.zeros((len(T), 3)), np.zeros((len(T), 15))
    v_n[:, 1] = speed
    P = np.tile(np.eye(15), (len(T), 1, 1))
    return Track(T, np.tile(np.eye(3), (len(T), 1, 1)), v_n, place, sensors, P, Layout(), (residuals,))


@pytest.mark.parametrize("factor", [1.0, 2.0, 6.0])
def test_noise_is_what_is_white_in_innovations(factor):
    """Of a source with sigmas of 1, 2 and .5, the first of them ``factor`` times too small; a slow error counts for nothing."""
    rng = np.random.default_rng(SEED)
    R, predicted = np.array([1.0, 2.0, 0.5]), 0.3
    true = np.hypot(R * [factor, 1.0, 1.0], predicted)
    slow = 5.0 * np.sin(T / 60.0)[:, None]
    track = track_of(true * rng.standard_normal((len(T), 3)) + slow, np.tile(np.hypot(R, predicted), (len(T), 1)))
    source = Aiding("log", "velocity", T, np.zeros((len(T), 3)), np.tile(R, (len(T), 1)))
    found = noise_factors(track, [source], {})
    if factor == 1.0:
        assert found == {}
        return
    assert found["log"] == pytest.approx([factor, 1.0, 1.0], rel=0.15)
    assert changed({}, found)
    assert not changed(found, {"log": 1.05 * found["log"]})


def test_a_wheel_that_stands_says_nothing_of_its_noise():
    """Exact for two thirds of the log, at rest, and four times as noisy as it says on the move."""
    rng = np.random.default_rng(SEED)
    moves = 0.66 * T[-1] < T
    noise = np.where(moves, 4.0, 0.01)[:, None] * rng.standard_normal((len(T), 3))
    source = Aiding("log", "velocity", T, np.zeros((len(T), 3)), np.ones((len(T), 3)))
    found = noise_factors(track_of(noise, np.ones((len(T), 3)), 10.0 * moves), [source], {})
    assert found["log"] == pytest.approx([4.0] * 3, rel=0.25)


@pytest.mark.parametrize("tails", [False, True])
def test_noise_with_long_tails(tails):
    """A third of the rows three times as noisy; two in a hundred, a hundred times, are outliers, unless tails are asked for."""
    rng = np.random.default_rng(SEED)
    kind = rng.random(len(T))
    sigma = np.where(kind < 0.02, 100.0, np.where(kind < 0.35, 3.0, 1.0))[:, None]
    source = Aiding("log", "velocity", T, np.zeros((len(T), 3)), np.ones((len(T), 3)))
    found = noise_factors(
        track_of(sigma * rng.standard_normal((len(T), 3)), np.ones((len(T), 3))), [source], {}, tails=tails
    )
    assert np.all(found["log"] > (5.0 if tails else 1.3))
    assert tails or np.all(found["log"] < 2.5)


def test_a_factor_that_outliers_made_is_unlearnt():
    """A hundred rows that a factor of 500 has made far too quiet: by chance alone q is between none and several."""
    rng = np.random.default_rng(SEED)
    quiet = rng.standard_normal((len(T), 3)) / 500.0
    quiet[100:] = np.nan
    source = Aiding("log", "velocity", T, np.zeros((len(T), 3)), 500.0 * np.ones((len(T), 3)))
    sigma = 500.0 * np.ones((len(T), 3))
    assert noise_factors(track_of(500.0 * quiet, sigma), [source], {"log": 500.0 * np.ones(3)}) == {}


def car(name, run=0):
    case = next(case for case in moving.CASES if case.name.startswith(name))
    return simulated(case.scenario(np.random.default_rng([SEED, run])), SEED, run)


@pytest.fixture(scope="module")
def late():
    return car("GNSS late by 1 s, car")


@pytest.mark.slow
def test_a_late_receiver_is_found_out_and_said(late):
    answer = align_in_motion(late.record, "industrial", gnss=late.aiding["gnss"])
    delay, sigma = answer.moving.delays["GNSS"]
    assert abs(delay - 1.0) < 4.0 * sigma < 0.2
    assert any(item.key == "delay.late" for item in answer.evidence)
    assert answer.moving.summary()["delays_s"]["GNSS"] == [delay, sigma]


@pytest.mark.slow
def test_places_without_velocities_or_with_sigmas_too_small(late):
    """Neither is refused, and the second says so."""
    gnss = late.aiding["gnss"].shifted(-1.0)
    assert align_in_motion(late.record, "industrial", gnss=moving.places_only(gnss, None)).status == "aligned"
    answer = align_in_motion(late.record, "industrial", gnss=moving.boasting(gnss, None))
    assert answer.status == "aligned", answer.reasons
    said = {item.figures["name"]: item.figures["factor"] for item in answer.evidence if item.key == "noise.estimated"}
    assert said["GNSS position"] == pytest.approx(3.0, rel=0.25)


@pytest.mark.slow
def test_an_odometer_noisier_than_usual_is_no_contradiction():
    log = car("odometer noisier")
    answer = align_in_motion(log.record, "navigation", odometer=log.aiding["odometer"], position=log.start)
    assert answer.status == "aligned", answer.reasons


@pytest.mark.slow
def test_a_class_of_imu_that_is_too_good_is_the_suspect(late):
    gnss = late.aiding["gnss"].shifted(-1.0)
    answer = align_in_motion(late.record, "tactical", gnss=gnss)
    assert answer.status == "inconsistent"
    assert answer.evidence[0].key == "specification.suspect"
    assert answer.evidence[0].remedies == ("specification",)


@pytest.mark.parametrize("times", [(1.0, 1.0), (20.0, 1.0), (1.0, 20.0)])
def test_noise_of_rows(times):
    """White noise of a turning base, by its rows, where it is far more than a specification says; else not at all."""
    spec, rng = imu_spec("tactical"), np.random.default_rng(SEED)
    t = np.arange(1, 6001) / 100.0
    walks = np.repeat([spec.gyro_random_walk * times[0], spec.accel_random_walk * times[1]], 3)
    data = np.sin(t)[:, None] * [0.1, 0.1, 0.3, 1.0, 1.0, 0.1] + walks * rng.standard_normal((len(t), 6)) * 10.0
    data[:, 5] += 9.8
    found = with_noise_of(ImuRecord(t, data[:, :3], data[:, 3:]), spec)
    if times == (1.0, 1.0):
        assert found is spec
        return
    assert found.gyro_random_walk == pytest.approx(spec.gyro_random_walk * times[0], rel=0.15)
    assert found.accel_random_walk == pytest.approx(spec.accel_random_walk * times[1], rel=0.15)
    assert found.gyro_turn_on_bias == spec.gyro_turn_on_bias


@pytest.mark.slow
@pytest.mark.parametrize("run", range(3))
def test_a_vehicle_that_vibrates_is_aligned(run):
    """Rows ten times as noisy as the specification says and more, as of a vibration that they do not sample."""
    log = car("GNSS, car", run)
    rng = np.random.default_rng([SEED, run])
    size = np.repeat([np.radians(rng.uniform(0.2, 0.5)), 9.8 * rng.uniform(0.05, 0.2)], 3) * log.record.interval
    noise = size * rng.standard_normal((len(log.record), 6))
    record = replace(log.record, gyro=log.record.gyro + noise[:, :3], accel=log.record.accel + noise[:, 3:])
    answer = align_in_motion(record, "industrial", gnss=log.aiding["gnss"])
    assert answer.status == "aligned", answer.reasons
    assert any(item.key == "specification.noisier" for item in answer.evidence)
    phi = rotation_vector_from_dcm(answer.C_nb @ log.C_nb(answer.time).T)
    assert np.all(np.abs(phi) < 4.0 * np.sqrt(np.diag(answer.phi_covariance)))


def test_a_poorer_imu_has_larger_errors_alone():
    spec = imu_spec("tactical")
    other = poorer(spec, 10.0)
    assert np.sqrt(other.bias_variance) == pytest.approx(10.0 * np.sqrt(spec.bias_variance))
    assert other.correlation_time == spec.correlation_time
    assert other.gyro_scale_factor == 10.0 * spec.gyro_scale_factor


def test_slow_errors_of_heights_are_larger_as_the_receiver_says(late):
    gnss = late.aiding["gnss"]
    antenna = usual_antenna(gnss)
    bias = from_gnss(gnss, antenna)[0].states["bias"].sigma
    assert bias == pytest.approx(antenna.bias_sigma * np.array([1.0, 1.0, 1.5]))  # as simulated
    silent = replace(gnss, position_sigma=None)
    assert from_gnss(silent, antenna)[0].states["bias"].sigma[2] == pytest.approx(antenna.bias_sigma * 5.0 / 3.0)
