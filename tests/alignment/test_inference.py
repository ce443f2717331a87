"""The inferred size of an unseen bias, against the distribution it claims."""

import math
from dataclasses import replace

import numpy as np
import pytest

from truenorth.alignment import align
from truenorth.alignment.inference import predictive_sigma
from truenorth.alignment.usual import usual
from truenorth.core.position import Position
from truenorth.records.specs import PRESETS, imu_spec
from truenorth.simulation.scenario import read_scenario


def test_the_prior_alone_gives_three_sigmas_that_hold_as_many_as_of_a_normal_variable():
    """Draws of a log-normal s and a normal variable of that size: .27 % beyond three (a million: +-.02 %)."""
    width = math.log(7.0)
    found = predictive_sigma(np.zeros(2), np.full(2, 1e6), 1e-6, width, 1e-12, 1.0)
    rng = np.random.default_rng(3)
    drawn = 1e-6 * np.exp(width * rng.standard_normal(1_000_000)) * rng.standard_normal(1_000_000)
    assert np.mean(np.abs(drawn) > 3.0 * found) == pytest.approx(0.0027, abs=2e-4)


def test_a_known_scale_is_its_own_sigma():
    """A prior without width leaves a normal variable, whose three sigmas are those of its standard deviation."""
    found = predictive_sigma(np.zeros(0), np.zeros(0), 1e-6, 1e-3, 1e-8, 1e-4)
    assert math.isclose(found, 1e-6, rel_tol=2e-2)  # the grid of scales has steps of 2.3 %


def test_many_residuals_give_their_rms():
    rng = np.random.default_rng(1)
    residuals = 3e-6 * rng.standard_normal(5000)
    found = predictive_sigma(residuals, np.zeros(5000), 1e-4, math.log(10.0), 1e-9, 1.0)
    assert math.isclose(found, math.sqrt(np.mean(residuals**2)), rel_tol=2e-2)


def test_noise_alone_proves_no_bias():
    """Residuals well inside their noise leave every scale below the noise open; far above it they exclude it."""
    noise = np.full(2, 1e-6)
    quiet = predictive_sigma(np.zeros(2), noise, 1e-7, math.log(3.0), 1e-9, 1.0)
    assert quiet < 1e-6
    assert predictive_sigma(np.array([1e-4, 1e-4]), noise, 1e-7, math.log(3.0), 1e-9, 1.0) > 3e-5


@pytest.mark.slow
@pytest.mark.parametrize(("count", "width"), [(2, math.log(7.0)), (1, math.log(2.0))])
def test_three_sigmas_hold_the_unseen_component(count, width):
    """Over scales drawn from the prior .27 % are beyond three sigmas, and some .1 % beyond four (20000 draws: +-.04 %)."""
    rng = np.random.default_rng(5)
    ratio = np.empty(20000)
    for k in range(len(ratio)):
        s = 1e-6 * math.exp(width * rng.standard_normal())
        *seen, unseen = s * rng.standard_normal(count + 1)
        ratio[k] = unseen / predictive_sigma(np.array(seen), np.full(count, 1e-15), 1e-6, width, 1e-12, 1.0)
    assert np.mean(np.abs(ratio) > 3.0) == pytest.approx(0.0027, abs=0.0012)
    assert np.mean(np.abs(ratio) > 4.0) < 0.002
    assert 0.4 < np.sqrt(np.mean(np.square(ratio))) < 1.0


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_the_usual_bias_is_that_of_the_presets(sensor):
    for name in PRESETS:
        spec = imu_spec(name)
        walk, bias = getattr(spec, f"{sensor}_random_walk"), getattr(spec, f"{sensor}_bias")
        assert math.isclose(usual(sensor, "bias", walk), bias, rel_tol=1e-9)


def test_accelerometers_that_miss_gravity_leave_level_unknown():
    """60 mg along the vertical: as much may be along the level, 3.4 deg of tilt, and no longer log shows less."""
    scenario = {"duration": "60 s", "position": {"lat": "45 deg", "lon": "10 deg"}, "motion": {"kind": "rest"}}
    record = read_scenario({"name": "rest", "imu": "consumer", **scenario}).simulate(seed=2).record
    step = record.interval if record.kind == "increments" else 1.0
    missing = 1.06 * 9.806 - np.linalg.norm(record.accel.mean(axis=0)) / step
    biased = replace(record, accel=record.accel + np.array([0.0, 0.0, missing * step]))
    answer = align(biased, Position.from_degrees(45.0, 10.0))
    assert answer.status == "not_converged"
    assert (
        1.0 <= np.degrees(np.sqrt(answer.phi_covariance[0, 0])) / np.degrees(0.06) < 2.0
    )  # wider: one draw shows a size badly
    assert "however long the log is" in answer.reasons[0]
    assert "a specification of the IMU" in answer.reasons[0]
