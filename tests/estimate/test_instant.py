"""The rate at an epoch, for lever arms: exact while the body shakes, and of two noises."""

import numpy as np
import pytest

from truenorth.aiding.source import Aiding, state
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.earth import earth_rate_n, normal_gravity, radii
from truenorth.errors.model import InsModel
from truenorth.estimate import predict
from truenorth.estimate.memory import Samples
from truenorth.estimate.run import navigate_track, with_states
from truenorth.records import ImuRecord
from truenorth.state.now import NOW_LENGTH, NOW_OTHER_RATE, NOW_RATE
from truenorth.state.state import Start


@pytest.fixture
def described(monkeypatch):
    """Both rates about x at a part of sample 5, of increments (N,) at 50 Hz; by the sources of the kernels."""
    monkeypatch.setattr(predict, "_slope_weight", predict._slope_weight.py_func)

    class Plain:
        sensors = (-1, -1)

    def rates(turned, done):
        step, zeros = np.full(len(turned), 0.02), np.zeros((len(turned), 3))
        dtheta = np.column_stack([turned, turned, turned])
        now = np.zeros(NOW_LENGTH)
        samples = Samples(step, np.cumsum(step), dtheta, zeros)
        predict.describe_instant.py_func(samples, 5, done, Plain(), np.zeros(15), now)
        return now[NOW_RATE], now[NOW_OTHER_RATE]

    return rates


@pytest.mark.parametrize("done", [0.0, 0.3, 0.5, 0.8, 1.0])
def test_the_rate_of_a_body_that_shakes(described, done):
    """4 Hz at 50 Hz: to 2 % of the amplitude, where a line through four samples takes a sixth off."""
    w = 2.0 * np.pi * 4.0
    t = 0.02 * np.arange(13)
    for phase in np.linspace(0.0, np.pi, 7):
        rate, _ = described(np.diff(-np.cos(w * t + phase) / w), done)
        assert rate == pytest.approx(np.sin(w * 0.02 * (5 + done) + phase), abs=0.02)


@pytest.mark.parametrize("done", [0.0, 0.3, 0.5, 0.8, 1.0])
def test_both_rates_have_noises_of_their_own(described, done):
    """By the weight of each sample in both: their product is the covariance; a constant rate is the same in both."""
    weights = np.array([described(row, done) for row in np.eye(12)])
    rate, other = weights.T
    assert abs(rate @ other) < 1e-9 * (rate @ rate)
    assert 0.02 * np.sum(rate) == pytest.approx(1.0)
    assert 0.02 * np.sum(other) == pytest.approx(1.0)
    assert 0.02**2 * rate @ rate < 1.2
    assert 0.02**2 * other @ other < 0.55


@pytest.mark.parametrize("kind", ["velocity", "body velocity"])
def test_a_sensor_on_an_arm_moves_with_the_rate_of_its_own_time(kind):
    """A base turns to and fro about the vertical: exactly ``w x l`` half a second after the last event, not that of before."""
    dt, size, w = 0.01, 0.4, 2.0 * np.pi * 0.7  # s, rad, rad/s
    t = dt * np.arange(1501)
    psi = size * np.sin(w * t)
    C = dcm_from_euler(psi, np.zeros_like(psi), np.zeros_like(psi))
    earth, middle = earth_rate_n(0.7), 0.5 * (C[1:] + C[:-1])
    dtheta = dt * np.einsum("kji,j->ki", middle, earth) - np.diff(psi)[:, None] * [0.0, 0.0, 1.0]
    dvel = np.tile([0.0, 0.0, float(normal_gravity(0.7, 0.0)) * dt], (1500, 1))
    record = ImuRecord(t[1:], dtheta, dvel, kind="increments")
    start = Start(0.0, C[0], np.zeros(3), 0.7, 0.1, 0.0, np.zeros(3), np.zeros(3), 1e-16 * np.eye(15))
    at = np.arange(1.0, 14.0)
    arm = np.array([0.5, 3.0, 1.0])
    rate = size * w * np.cos(w * at)[:, None] * [0.0, 0.0, -1.0]
    shown = np.cross(rate, arm)
    if kind == "velocity":
        shown = np.einsum("kij,kj->ki", dcm_from_euler(size * np.sin(w * at), 0.0 * at, 0.0 * at), shown)
    source = Aiding("sensor", kind, at, shown, np.full((len(at), 3), 0.05), arm)
    track = navigate_track(record, start, InsModel(0.0, 0.0), [source], interval=0.5)
    late = 0.25 * size * w**2 * np.linalg.norm(arm[:2])  # m/s, of the mean over half a second
    assert late > 5.0 * 0.05
    assert np.abs(track.residuals[0].innovation).max() < 0.003 * late


def test_a_receiver_that_says_places_alone_is_as_late_as_its_antenna_swings():
    """A base rolls with an antenna on a mast, and its fixes of a centimetre are .03 s late: 4 cm, and the swing shows the delay."""
    dt, size, w, late = 0.01, 0.06, 2.0 * np.pi * 1.1, 0.03  # s, rad, rad/s, s
    t = dt * np.arange(6001)
    roll = size * np.sin(w * t)
    zero, lat = np.zeros_like(t), 0.7
    C = dcm_from_euler(zero, zero, roll)
    middle = dcm_from_euler(zero[1:], zero[1:], 0.5 * (roll[1:] + roll[:-1]))
    dtheta = dt * np.einsum("kji,j->ki", middle, earth_rate_n(lat)) + np.diff(roll)[:, None] * [0.0, 1.0, 0.0]
    dvel = dt * np.einsum("kji,j->ki", middle, [0.0, 0.0, float(normal_gravity(lat, 0.0))])
    record = ImuRecord(t[1:], dtheta, dvel, kind="increments")
    prior = np.concatenate([np.full(3, 1e-4), np.full(3, 0.01), np.full(3, 0.01), np.full(3, 1e-7), np.full(3, 1e-4)])
    start = Start(0.0, C[0], np.zeros(3), lat, 0.1, 0.0, np.zeros(3), np.zeros(3), np.diag(prior**2))
    at, arm, sigma = np.arange(1.0, 59.0, 0.2), np.array([0.3, 0.0, 3.0]), 0.01
    then = size * np.sin(w * (at - late))
    antenna = np.einsum("kij,j->ki", dcm_from_euler(0.0 * at, 0.0 * at, then), arm)
    antenna += sigma * np.random.default_rng(1).standard_normal(antenna.shape)
    R_M, R_N = radii(lat)
    places = np.array([lat, 0.1, 0.0]) + antenna[:, [1, 0, 2]] / [R_M, R_N * np.cos(lat), 1.0]
    source = Aiding("GNSS", "position", at, places, np.full(places.shape, sigma), arm, states=state("GNSS", "lag", 0.1))
    model = with_states(InsModel(1e-5, 1e-4), [source])
    track = navigate_track(record, start, model, [source], interval=0.2)
    where = model.layout.slice_of("GNSS lag").start
    found, known = track.sensors[-1, where], track.sigma[-1, where]
    assert known < 1e-3  # without the swing nothing shows a delay: .1 s
    assert abs(found - late) < 3.0 * known + 5e-4  # and a quarter of a radian's square of it
    innovation = track.residuals[0].innovation[50:]
    assert np.sqrt(np.mean(innovation**2)) < 1.3 * sigma
