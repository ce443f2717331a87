"""Velocity or accelerometer form: the same answer on a still base, picked by the disturbance that the log shows."""

import math

import numpy as np
import pytest

from truenorth.alignment import align
from truenorth.alignment import procedure as steps_of_align
from truenorth.alignment.form import WHITE, pick_form
from truenorth.core.position import Position
from truenorth.errors.staying import BA, BG, DV, PHI, STATES, StaticModel, force_system, gained_velocity
from truenorth.quality.regimes import motion_summary
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import Sway, Tone, rest, simulate
from truenorth.strapdown.inertial import integrate

PLACE = Position.from_degrees(45.0, 0.0)
SPEC = imu_spec(
    {
        "gyro": {"bias": "0.01 deg/h", "random_walk": "0.001 deg/sqrt(h)"},
        "accel": {"bias": "50 ug", "random_walk": "10 ug/sqrt(Hz)"},
    }
)


def still(seed, duration=300.0):
    return simulate(rest(PLACE, 0.6), imu=SPEC, rate=10.0, duration=duration, seed=seed).record


def in_form(record, form, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(steps_of_align, "pick_form", lambda *_: (form, form))
        return align(record, PLACE, SPEC, method="kalman")


def test_both_forms_agree_on_a_still_base(monkeypatch):
    """Sigma to 1 %, and answers that differ by a twentieth of it."""
    for seed in range(8):
        velocity, force = (in_form(still(seed), form, monkeypatch) for form in ("velocity", "force"))
        np.testing.assert_allclose(force.euler_sigma, velocity.euler_sigma, rtol=0.01)
        assert np.all(np.abs(force.euler - velocity.euler) < 0.1 * velocity.euler_sigma)
        assert force.status == velocity.status == "aligned"


def test_the_accelerometer_form_tells_what_an_error_does_to_the_log():
    """Each state's gained velocity against the integrals of a log that has that error."""
    record = simulate(rest(PLACE, 0.6, 0.02, -0.01), rate=50.0, duration=30.0).record
    C = rest(PLACE, 0.6, 0.02, -0.01).states(np.array(0.0)).C_nb
    clean = integrate(record, 1.0)
    core = StaticModel(1e-7, 1e-5).linearise(clean, C, PLACE.lat, PLACE.alt, np.eye(STATES), np.ones(3))
    system = force_system(core, clean, C, PLACE.lat, PLACE.alt)
    T = record.interval
    for state, size in ((BG.start, 1e-6), (BG.start + 2, 1e-6), (BA.start, 1e-4), (BA.start + 1, 1e-4)):
        dtheta, dvel = record.gyro.copy(), record.accel.copy()
        (dtheta if state < BA.start else dvel)[:, state % 3] += size * T
        wrong = integrate(ImuRecord(record.time, dtheta, dvel, "increments"), 1.0)
        seen = force_system(core, wrong, C, PLACE.lat, PLACE.alt).z - system.z
        x, expected = np.zeros(STATES), []
        x[state] = size
        for Phi, H in zip(system.Phi, system.H, strict=True):
            x = Phi @ x
            expected.append(H @ x)
        np.testing.assert_allclose(expected, seen, atol=1e-4 * np.abs(seen).max())
    assert np.abs(system.H[:, :, DV]).max() < 1e-12
    assert np.abs(system.H[:, 0, PHI.start + 1]).min() > 9.0


@pytest.mark.slow
def test_a_still_log_is_taken_by_its_accelerometers():
    """White noise is accused once in 1000 logs: 40 logs, at most one."""
    reasons = [align(still(seed), PLACE, SPEC).method_reason for seed in range(40)]
    assert sum("accelerometer form" in reason for reason in reasons) >= 39


@pytest.mark.parametrize("amplitude", [1e-3, 1e-2])
def test_a_base_that_moves_a_little_is_taken_by_its_velocity(amplitude):
    """A millimetre per second of sway, which no second of the log shows by itself, colours the force."""
    sway = Sway(PLACE, 0.6, east_tones=(Tone(amplitude * 6.0 / (2 * math.pi), 6.0),))
    record = simulate(sway, imu=SPEC, rate=10.0, duration=300.0, seed=1).record
    answer = align(record, PLACE, SPEC, method="kalman")
    assert "velocity form" in answer.method_reason
    assert abs(answer.heading - 0.6) < 4 * answer.euler_sigma[0]


def test_a_drift_is_found_in_either_form(monkeypatch):
    """North velocity that grows to .2 m/s from half of the log on."""
    record = still(3)
    C = rest(PLACE, 0.6).states(np.array(0.0)).C_nb
    onset = record.time > 150.0
    gain = np.zeros((len(record), 3))
    gain[onset, 1] = 0.2 / np.count_nonzero(onset)
    moved = ImuRecord(record.time, record.gyro, record.accel + gain @ C, record.kind)
    for form in ("velocity", "force"):
        answer = in_form(moved, form, monkeypatch)
        assert answer.status == "inconsistent"
        assert any("drifts" in reason for reason in answer.reasons)


def test_false_alarms_of_the_colour():
    """1000 logs of white noise: at a rate of 1e-3 more than 6 have a chance of 1e-4."""
    motion = motion_summary(still(0, 60.0))
    rng = np.random.default_rng(0)
    picked = [pick_form(rng.standard_normal((200, 3)), motion)[0] for _ in range(1000)]
    assert picked.count("velocity") <= 6
    assert pytest.approx(45.3) == WHITE


def test_what_gains_is_zero_for_a_perfect_one_at_rest():
    record = simulate(rest(PLACE, 0.6), rate=50.0, duration=60.0).record
    C = rest(PLACE, 0.6).states(np.array(0.0)).C_nb
    assert np.abs(gained_velocity(integrate(record, 1.0), C, PLACE.lat, PLACE.alt)).max() < 1e-8
