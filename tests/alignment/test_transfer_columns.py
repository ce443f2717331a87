"""Columns of delay and arm: of a noisy slave they part the two no more than its motion does."""

import numpy as np
import pytest

from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_columns import _calibrated
from truenorth.core.position import Position
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight

DEG, SPEED, SPAN = np.radians(1.0), 150.0, 100.0
CONSUMER = imu_spec("consumer")


@pytest.fixture(scope="module")
def flight():
    """S-turns at a steady speed, along the forward axis."""
    legs = [*straight(20.0), *s_turn(20 * DEG, 3 * DEG), *straight(SPAN)]
    return course(Position.from_degrees(62.0, 20.0, 3000.0), legs, heading=0.6, speed=SPEED)


def aligned(flight, imu, run, **said):
    """Of a slave with the errors of an IMU, or none, against a master by velocity."""
    slave = simulate(flight, imu=imu, rate=100.0, duration=SPAN, seed=9, run=run).record
    spec = MasterSpec(latency=0.03, lever_arm=(0.5, -0.8, 0.4), velocity_noise=0.05)
    master = simulate_sensor(flight, spec, duration=SPAN, seed=9, run=run).record
    return align_transfer(slave, master, CONSUMER, matching="velocity", velocity_noise=0.05, **said).transfer


def test_calibrated_columns_claim_what_they_know():
    """Noisy columns claim the squares of their noise; calibrated ones as much as they share with the true ones, by direction."""
    rng, rows = np.random.default_rng(5), 20000
    true = rng.standard_normal((rows, 3)) @ np.diag([1.0, 0.3, 0.0]) @ np.linalg.qr(rng.standard_normal((3, 3)))[0]
    noise = np.array([0.4, 0.6, 0.5])
    seen = true + noise * rng.standard_normal((rows, 3))
    A, _ = _calibrated(seen.T @ seen, rows * noise**2)
    columns = seen @ A
    claimed, shared = columns.T @ columns / rows, columns.T @ true / rows
    assert np.allclose(claimed, shared, atol=0.02)
    assert np.max(np.abs(seen.T @ seen / rows - seen.T @ true / rows)) > 0.3
    nothing = np.linalg.svd(true, full_matrices=False)[2][-1]  # no true column is along it
    # A combination of states that shows nothing is not shown by its noise.
    assert nothing @ claimed @ nothing < 0.01 < 0.1 < nothing @ (seen.T @ seen / rows) @ nothing


@pytest.mark.slow
def test_noise_of_a_consumer_slave_parts_no_delay_from_an_arm(flight):
    """In turns at a steady speed a delay is an arm forward: sigma is that of a log of the same motion without sensor errors."""
    free = aligned(flight, None, 0)
    for run in range(2):
        found = aligned(flight, CONSUMER, run)
        # Without calibration .66 and .73 of it.
        assert 0.8 < found.delay_sigma / free.delay_sigma < 1.25
        assert 0.8 < found.lever_arm_sigma[1] / free.lever_arm_sigma[1] < 1.25
        assert found.delay_sigma * SPEED > 0.6  # m


@pytest.mark.slow
@pytest.mark.parametrize(
    "known", [{"delay": 0.03, "delay_sigma": 0.0}, {"lever_arm": (0.5, -0.8, 0.4), "lever_arm_sigma": 0.0}]
)
def test_one_of_both_may_be_known(flight, known):
    """A delay without an arm as a state, and the other way round, is found."""
    found = aligned(flight, CONSUMER, 0, **known)
    assert abs(found.delay - 0.03) <= 4.0 * found.delay_sigma < 0.01
    assert np.all(np.abs(found.lever_arm - (0.5, -0.8, 0.4)) <= 4.0 * found.lever_arm_sigma)
    assert np.all(found.lever_arm_sigma < 0.5)
