"""The turntable's error model against the INS itself: logs with one error each, and what the states say of them."""

import math

import numpy as np
import pytest

from truenorth.core.position import Position
from truenorth.errors.matrices import without_errors
from truenorth.errors.staying import StaticModel
from truenorth.estimate.staying import StayingLog, prior_of
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import Axis, Indexed, Indexer, rest, simulate, steps

LAT = math.radians(45.0)
PRIOR = prior_of(np.eye(6), spec=imu_spec("consumer"), arm=np.zeros(3), arm_sigma=1.0)
GYRO_MATRIX, ACCEL_MATRIX, ARM = slice(12, 21), slice(21, 30), PRIOR.groups["arm"]
STATES = len(PRIOR.mean)


@pytest.fixture(scope="module")
def ideal():
    """A table that turns by 90 deg about the vertical and over, three times in 30 s, and the attitude at the start."""
    axes = steps([(0, math.pi / 2), (1, math.pi / 2), (0, -1.0)], dwell=4.0, duration=30.0, rate=0.4)
    table = Indexed(rest(Position(LAT), 0.6, 0.01, -0.02), Indexer((Axis("z", axes[0]), Axis("x", axes[1]))))
    record = simulate(table, rate=200.0, duration=30.0).record
    return record, table.states(np.array([0.0])).C_nb[0]


def _velocity(record, C):
    """Mean velocity of each interval in n, as measured, and the system."""
    return StayingLog(record, C, Position(LAT), StaticModel(1e-7, 1e-5), PRIOR, 1.0).linearise()


@pytest.mark.parametrize("state", [6, 7, 8, 9, 10, 11, *range(12, 30)])
def test_what_a_sensors_error_does_to_the_velocity(ideal, state):
    record, C = ideal
    step = {True: 1e-6, False: 1e-5}[state < 9]
    dtheta, dvel = record.gyro.copy(), record.accel.copy()
    T = record.steps[:, None]
    if state < 12:
        (dtheta if state < 9 else dvel)[:, state % 3] += step * T[:, 0]
    else:
        part = GYRO_MATRIX if state < ACCEL_MATRIX.start else ACCEL_MATRIX
        i, j = divmod(state - part.start, 3)
        increment = dtheta if part is GYRO_MATRIX else dvel
        increment[:, i] += step * increment[:, j].copy()
    wrong = ImuRecord(record.time, dtheta, dvel, "increments")
    system, seen = _velocity(record, C), _velocity(wrong, C).z - _velocity(record, C).z
    x = np.zeros(STATES)
    x[state] = step
    expected = []
    for Phi, H in zip(system.Phi, system.H, strict=True):
        x = Phi @ x
        expected.append(H @ x)
    np.testing.assert_allclose(expected, seen, atol=2e-3 * np.abs(seen).max())


def test_an_arm_is_seen_in_the_turns(ideal):
    """An IMU off the axes moves by C r: its mean velocity is what H says of the arm."""
    record, C = ideal
    system = _velocity(record, C)
    r = np.array([0.02, -0.01, 0.03])
    axes = steps([(0, math.pi / 2), (1, math.pi / 2), (0, -1.0)], dwell=4.0, duration=30.0, rate=0.4)
    table = Indexed(rest(Position(LAT), 0.6, 0.01, -0.02), Indexer((Axis("z", axes[0]), Axis("x", axes[1]))))
    C_nb = table.states(np.arange(31.0)).C_nb
    np.testing.assert_allclose(system.H[:, :, ARM] @ r, np.diff(C_nb @ r, axis=0), atol=1e-5)


def test_errors_are_taken_off(ideal):
    record, _ = ideal
    rng = np.random.default_rng(0)
    M_g, M_a = np.eye(3) + 1e-3 * rng.standard_normal((2, 3, 3))
    bias = 1e-3 * rng.standard_normal(6)
    T = record.steps[:, None]
    wrong = ImuRecord(
        record.time, record.gyro @ M_g.T + T * bias[:3], record.accel @ M_a.T + T * bias[3:], "increments"
    )
    back = without_errors(wrong, bias, M_g - np.eye(3), M_a - np.eye(3))
    np.testing.assert_allclose(back.gyro, record.gyro, atol=1e-15)
    np.testing.assert_allclose(back.accel, record.accel, atol=1e-14)
