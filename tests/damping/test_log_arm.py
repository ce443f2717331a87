"""A speed log that is not at the IMU: its arm is taken off, and found where nobody has said it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from benchmarks.honesty.voyage import passage
from truenorth.core.units import STANDARD_GRAVITY as G
from truenorth.damping.log_arm import at_the_imu, carried, sought
from truenorth.errors.log import LOGS, LogErrors
from truenorth.records import VelocityRecord
from truenorth.records.specs import imu_spec
from truenorth.state.mounting import Mounting

ARM = np.array([2.0, -28.0, -5.0])
GOOD = imu_spec("navigation")


@pytest.fixture(scope="module")
def ship():
    """Two hours with turns of 1 deg/s."""
    return passage(np.random.default_rng(4), 2.0)[1]


def log_at(truth, arm, frame="body", noise=0.0, seed=0):
    """Exact but for noise: the arm's velocity by differences of attitude, which the module does not take."""
    rate = np.gradient(truth.C_nb, truth.time, axis=0)
    v = truth.v_n + rate @ arm
    if frame == "body":
        v = np.einsum("kij,ki->kj", truth.C_nb, v)
    return VelocityRecord(truth.time, v + noise * np.random.default_rng(seed).standard_normal(v.shape), frame)


@pytest.mark.parametrize("frame", ["body", "navigation"])
def test_a_known_arm_is_taken_off(ship, frame):
    """To the error of the test's own differences over 4 s at the ends of turns; .49 m/s before."""
    raw, off = log_at(ship, ARM, frame), log_at(ship, np.zeros(3), frame).velocity
    found = carried(ship, raw, ARM).velocity
    assert np.abs(raw.velocity - off).max() > 0.4
    assert np.median(np.abs(found - off).max(axis=1)) < 1e-6
    assert np.abs(found - off).max() < 0.2
    record, arm = at_the_imu(ship, raw, Mounting(lever_arm=ARM), LogErrors(), GOOD)
    assert arm is None
    np.testing.assert_array_equal(record.velocity, found)


@pytest.mark.parametrize("frame", ["body", "navigation"])
@pytest.mark.parametrize("arm", [ARM * [1, 1, 0], np.zeros(3)])
def test_an_arm_is_found(ship, frame, arm):
    """Eight logs: within 3.5 of their sigmas, which are those of the scatter (chi-square of 16, 99.9 %); named if there."""
    errors = LOGS["em"] if frame == "body" else LOGS["reference"]
    ratios = []
    for seed in range(8):
        found = sought(ship, log_at(ship, arm, frame, 0.1, seed), errors, 15.0, GOOD)
        ratios.append((found.arm - arm)[:2] / found.sigma)
        assert bool(found.evidence()) == bool(arm.any())
    assert found.sigma.max() < 3.0
    assert np.abs(ratios).max() < 3.5
    assert 3.9 < np.sum(np.square(ratios)) < 39.3


def test_scale_mounting_bias_and_current_are_no_arm(ship):
    """What a log has besides, as large as its kind has it, moves the arm by less than its sigma of a metre or so."""
    log = log_at(ship, np.zeros(3), noise=0.02)
    v = log.velocity * 1.005 + [0.1, -0.1, 0.0]
    v[:, 0] += 0.005 * log.velocity[:, 1]
    current = 0.4 * np.sin(ship.time / 1500.0)[:, None] * [1.0, 0.5, 0.0]
    v += np.einsum("kij,ki->kj", ship.C_nb, current)
    found = sought(ship, VelocityRecord(ship.time, v, "body"), LOGS["em"], 15.0, GOOD)
    assert np.abs(found.arm[:2] / found.sigma).max() < 3.0
    assert found.sigma.max() < 2.0


def test_a_straight_way_shows_none():
    """Without turns the arm is what it was a priori, and nothing is named."""
    truth = passage(np.random.default_rng(5), 1.0, turns=False)[1]
    found = sought(truth, log_at(truth, ARM, noise=0.1), LOGS["em"], 15.0, GOOD)
    assert np.abs(found.arm).max() < 15.0
    assert found.sigma[1] > 5.0
    assert not found.evidence()


def test_accelerometers_off_are_no_arm(ship):
    """A bias that turns with the hull pushes the INS as it turns: of 250 ug a log at the IMU had an arm of 1.8 m, 10 sigmas."""
    poor = replace(GOOD, accel_turn_on_bias=250e-6 * G)
    ratios = []
    for seed in range(8):
        bias = np.random.default_rng([7, seed]).normal(0.0, 250e-6 * G, 3)
        pushed = cumulative_trapezoid(ship.C_nb @ bias, ship.time, axis=0, initial=0.0)
        off = replace(ship, v_n=ship.v_n + pushed * [1.0, 1.0, 0.0])
        found = sought(off, log_at(ship, np.zeros(3), noise=0.01, seed=seed), LOGS["em"], 15.0, poor)
        ratios.append(found.arm[:2] / found.sigma)
    assert np.abs(ratios).max() < 3.5
    assert np.sqrt(np.mean(np.square(ratios))) < 1.6
