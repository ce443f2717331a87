"""The paper's rotary model against the integration of perturbed logs; the lever arm's velocity against the motion."""

import math

import numpy as np
import pytest

from truenorth.coarse.lever_arm import arm_velocity
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.errors.arm import arm_rows, slow_arm_rows, with_arm
from truenorth.errors.staying import BA, BG, DV, PHI, StaticModel
from truenorth.errors.sway import AxisMotion, Oscillator, with_motion, without_sway
from truenorth.estimate.staying import Prior
from truenorth.filters import kalman
from truenorth.papers.rotary.drawings import modulated
from truenorth.papers.rotary.model import RotaryLog, earth_axes
from truenorth.papers.rotary.truth import INDEXER_RATES
from truenorth.records import ImuRecord
from truenorth.simulation import Axis, Indexed, Indexer, Spin, Sway, Tone, simulate
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, integrate

PLACE = Position.from_degrees(40.0, 118.0)
INDEXER = Indexer(tuple(Axis(name, Spin(rate)) for name, rate in zip("zx", INDEXER_RATES, strict=True)))
SHIP = Sway(PLACE, -0.5, roll_tones=(Tone(0.17, 6.0, 0.4),), pitch_tones=(Tone(0.1, 5.0, 0.7),), lever_arm=(10, 30, 10))
LEVEL = Sway(PLACE, -0.5, roll_tones=(Tone(0.05, 6.0, 0.4),))


def test_modulated_biases_are_the_papers_equations_8_and_9():
    t = np.linspace(0.0, 130.0, 40)
    e = np.array([0.3, -0.7, 1.1])
    w2, w1 = INDEXER_RATES[0], INDEXER_RATES[1]  # the paper's omega_2 turns about z, omega_1 about x
    x = e[0] * np.cos(w2 * t) - e[1] * np.cos(w1 * t) * np.sin(w2 * t) + e[2] * np.sin(w1 * t) * np.sin(w2 * t)
    y = e[0] * np.sin(w2 * t) + e[1] * np.cos(w1 * t) * np.cos(w2 * t) - e[2] * np.sin(w1 * t) * np.cos(w2 * t)
    z = e[1] * np.sin(w1 * t) + e[2] * np.cos(w1 * t)
    np.testing.assert_allclose(modulated(t, e), np.stack([x, y, z], 1), atol=1e-12)


@pytest.fixture(scope="module")
def turning():
    moving = Indexed(LEVEL, INDEXER)
    return moving, simulate(moving, rate=200.0, duration=40.0).record


def rotary_system(record, C_n0_i):
    prior = Prior(np.zeros(12), np.eye(12), {})
    arm = np.zeros((41, 3))
    return RotaryLog(
        record, C_n0_i, PLACE, StaticModel(0.0, 0.0), prior, 1.0, arm_velocity=arm, base_velocity=0.05
    ).linearise()


def test_transition_against_perturbed_logs(turning):
    """Columns of the product of all Phi: a wrong start attitude and unit biases, through the real integration."""
    moving, record = turning
    C_in, C_n0_i = earth_axes(PLACE.lat).T, moving.states(np.array(0.0)).C_nb
    clean = integrate(record, 1.0)
    system = rotary_system(record, C_n0_i)
    Phi = np.eye(12)
    for step in system.Phi:
        Phi = step @ Phi
    z0, C0 = system.z[-1], C_in @ C_n0_i @ clean.C_ib[-1]

    def end(phi=(0, 0, 0), gyro=(0, 0, 0), accel=(0, 0, 0)):
        T = record.interval
        log = ImuRecord(record.time, record.gyro + T * np.array(gyro), record.accel + T * np.array(accel), "increments")
        C = dcm_from_rotation_vector(-np.array(phi)) @ C_in @ C_n0_i
        z = rotary_system(log, C_in.T @ C).z[-1]
        return z - z0, -rotation_vector_from_dcm(C @ integrate(log, 1.0).C_ib[-1] @ C0.T)

    for part, name, size in ((PHI, "phi", 1e-5), (BG, "gyro", 1e-7), (BA, "accel", 1e-3)):
        for axis in range(3):
            change = np.zeros(3)
            change[axis] = size
            dv, phi = end(**{name: change})
            column = Phi[:, part.start + axis]
            np.testing.assert_allclose(dv / size, column[DV], atol=3e-3 * np.abs(Phi[DV, part]).max())
            np.testing.assert_allclose(phi / size, column[PHI], atol=3e-3 * max(np.abs(Phi[PHI, part]).max(), 1e-9))


def test_a_perfect_log_leaves_nothing(turning):
    """A base that sways about its centre, without a lever arm: z is zero but for the strapdown's errors."""
    moving, record = turning
    assert np.max(np.abs(rotary_system(record, moving.states(np.array(0.0)).C_nb).z)) < 2e-5


@pytest.mark.parametrize("source", ["gyros", "nominal", "attitude"])
def test_arm_velocity_is_that_of_the_motion(source):
    """Each source against the true motion of the arm's end, at 5 m/s."""
    moving, dt = Indexed(SHIP, INDEXER), 1e-3
    t = np.linspace(1.0, 20.0, 20)
    C_i_n = earth_rotation(t[:, None] + [-dt, 0, dt], PLACE.lat)
    at = moving.states(t[:, None] + np.array([-dt, 0.0, dt]))
    C_is, C_bs = C_i_n @ at.C_nb, INDEXER.C_bs(t[:, None] + [-dt, 0, dt])
    nominal = INDEXER_RATES[1] * np.eye(3)[0] + INDEXER_RATES[0] * C_bs[:, 1, 2, :]
    found = arm_velocity(source, SHIP.lever_arm, dt, C_is, C_bs, at.w_ib_b[:, 1], nominal)
    body = SHIP.states(t)
    expected = np.einsum("kij,kjl,kl->ki", C_i_n[:, 1], body.C_nb, np.cross(body.w_ib_b, SHIP.lever_arm))
    assert np.max(np.abs(expected)) > 2.0
    np.testing.assert_allclose(found, expected, atol=2e-5)


def test_unknown_rate_source():
    with pytest.raises(UsageError, match="expected one of gyros"):
        arm_velocity("encoder", [1, 2, 3], 0.01, np.eye(3), np.eye(3), np.zeros(3))


@pytest.fixture(scope="module")
def ship():
    return simulate(SHIP, rate=100.0, duration=60.0).record


def test_rows_of_the_arm_explain_all_of_its_velocity(ship):
    """Noise-free, 33 m of arm, 5 m/s: what the true arm leaves of the mean velocity is below a tenth of a mm/s."""
    C = SHIP.states(np.array(0.0)).C_nb
    integrals = integrate(ship, 1.0)
    model = StaticModel(0.0, 0.0)
    plain = model.linearise(integrals, C, PLACE.lat, PLACE.alt, np.eye(12), np.zeros(3))
    rows = arm_rows(integrals, C, PLACE.lat)
    system = with_arm(plain, rows, np.array(SHIP.lever_arm, dtype=float))
    # The arm's velocity at the first instant is a state, which turns with the earth: smooth, and no part of this.
    rest, t = system.z, np.arange(60.0)
    rest = rest - np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyfit(t, rest, 2)).T
    assert np.max(np.abs(plain.z)) > 2.0
    assert np.max(np.abs(rest)) < 1e-4


def test_states_of_arm_and_motion(ship):
    """What stands where, and that unused states stay out of everything."""
    C = SHIP.states(np.array(0.0)).C_nb
    integrals = integrate(ship, 1.0)
    plain = StaticModel(1e-7, 1e-5).linearise(integrals, C, PLACE.lat, PLACE.alt, np.eye(12), np.zeros(3))
    system = with_arm(plain, arm_rows(integrals, C, PLACE.lat), np.zeros(3))
    system.P0[12:15, 12:15] = 4.0 * np.eye(3)
    motion = (AxisMotion(1e-3, (Oscillator(2, 0.1, 1.0, 0.1),)), AxisMotion(2e-3), AxisMotion(3e-3))
    full = with_motion(system, 1.0, motion)
    assert full.states == 39
    np.testing.assert_array_equal(full.H[:, :, :15], system.H)
    np.testing.assert_array_equal(np.diag(full.P0)[12:15], 4.0)
    assert math.sqrt(full.H[0, 0, 15:] @ full.P0[15:, 15:] @ full.H[0, 0, 15:]) == pytest.approx(0.1)
    np.testing.assert_allclose(
        (full.R - system.R)[:, [0, 1, 2], [0, 1, 2]], np.square([[1e-3, 2e-3, 3e-3]] * 60) - 1e-12
    )
    assert not full.P0[19:, 19:].any()


def test_states_that_no_oscillator_uses_change_no_bit(ship):
    """Without them a likelihood is the same, and so is what is found of all other states."""
    C = SHIP.states(np.array(0.0)).C_nb
    integrals = integrate(ship, 1.0)
    plain = StaticModel(1e-7, 1e-5).linearise(integrals, C, PLACE.lat, PLACE.alt, np.eye(12), np.zeros(3))
    system = with_arm(plain, arm_rows(integrals, C, PLACE.lat), np.zeros(3))
    motion = (AxisMotion(1e-3), AxisMotion(2e-3), AxisMotion(3e-3))
    full, short = (with_motion(system, 1.0, motion, spare=spare) for spare in (True, False))
    assert (full.states, short.states) == (39, 15)
    found, same = kalman(full), kalman(short)
    assert found.log_likelihood == same.log_likelihood
    np.testing.assert_array_equal(found.x[-1][:15], same.x[-1])
    np.testing.assert_array_equal(found.P[-1][:15, :15], same.P[-1])
    broad = (*motion[:2], AxisMotion(3e-3, (Oscillator(1, 0.2, 0.7, 1e-9),)))
    assert with_motion(system, 1.0, broad, spare=False).states == 39


def test_without_sway_an_indexer_still_turns():
    """The mean attitude of the base is left, and the indexer's modulation of it; the sway's part is a tenth or less."""
    moving = Indexed(SHIP, INDEXER)
    integrals = integrate(simulate(moving, rate=50.0, duration=120.0).record, 1.0)
    C_sb = np.swapaxes(INDEXER.C_bs(integrals.time), 1, 2)
    slow = without_sway(integrals, C_sb)
    middle = np.swapaxes(INDEXER.C_bs(integrals.time[1:] - 0.5), 1, 2)
    turned = slow.C_mean @ middle
    spread = turned - turned.mean(axis=0)
    full = integrals.C_mean @ middle
    assert np.std(spread) < 0.1 * np.std(full - full.mean(axis=0))
    assert np.std(slow.C_mean[:, 0, 0]) > 0.3


def test_the_slow_arm_has_the_swing_and_no_sea():
    """A heading that swings in 72 s, and yaws in 8 s: the rows are those of the swing; at the ends the sea leaks in."""
    time = np.arange(401.0)

    def attitude(heading):
        c, s, zero = np.cos(heading), np.sin(heading), np.zeros_like(heading)
        rows = [[c, s, zero], [-s, c, zero], [zero, zero, zero + 1.0]]
        return np.moveaxis(np.array(rows), 2, 0)

    def rows(heading):
        C_n0_b = earth_rotation(time, PLACE.lat) @ attitude(heading)
        log = InertialIntegrals(
            0.0, time, C_n0_b, *np.zeros((2, 401, 3)), *np.zeros((2, 400, 3, 3)), np.zeros((0, 3, 3))
        )
        return slow_arm_rows(log, np.eye(3), PLACE.lat)

    swing, sea = 0.014 * np.sin(2.0 * np.pi / 72.0 * time), 0.003 * np.sin(2.0 * np.pi / 8.0 * time)
    expected = np.diff(attitude(0.6 + swing)[:, :, :2], axis=0)
    assert np.max(np.abs(expected)) > 1e-3
    assert np.max(np.abs(rows(0.6 + swing) - expected)) < 2e-4  # without a cubic 1e-3: .05 m/s of an arm of 50 m
    assert np.max(np.abs(rows(0.6 + swing + sea) - expected)[20:-20]) < 5e-5
