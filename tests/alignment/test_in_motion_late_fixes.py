"""The delay of fixes alone, of a vehicle as slow as a robot: no noise of fixes passes for knowledge of it."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.alignment.in_motion import align_in_motion
from truenorth.core.position import METRES_PER_RADIAN
from truenorth.estimate.shown_late import as_it_moves, as_late_as_known, keep_link, keep_moment
from truenorth.simulation.scenario import read_scenario
from truenorth.state.now import NOW_LENGTH, NOW_PUSH

SEED = 4127  # any
DV, DP, LAG, STATES = slice(3, 6), slice(6, 9), 15, 16


def symmetric(rng):
    A = rng.standard_normal((STATES, STATES))
    return A @ A.T


def shown(velocity):
    """(3, STATES) ``dp + v dtau``."""
    H = np.zeros((3, STATES))
    H[:, DP], H[:, LAG] = np.eye(3), velocity
    return H


def test_what_fixes_have_shown_stays_when_velocity_is_corrected():
    """Variances and covariances of ``dp + v dtau``; of all else but the place they are as they were."""
    rng = np.random.default_rng(SEED)
    P, x, v = symmetric(rng), rng.standard_normal(STATES), rng.standard_normal(3)
    before, after = shown(v), shown(v - x[DV])
    carried, D = P.copy(), np.eye(STATES)
    keep_moment(LAG, x, carried)
    keep_link(LAG, x, D)
    np.testing.assert_allclose(after @ carried @ after.T, before @ P @ before.T, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(D @ P @ D.T, carried, rtol=1e-10, atol=1e-10)
    other = np.setdiff1d(np.arange(STATES), np.arange(DP.start, DP.stop))
    np.testing.assert_array_equal(carried[np.ix_(other, other)], P[np.ix_(other, other)])
    untouched = P.copy()
    keep_moment(-1, x, untouched)
    np.testing.assert_array_equal(untouched, P)


def test_an_open_loop_has_the_columns_of_what_is_known():
    """Those of ``p - tau v + a tau^2 / 2``, its errors x taken off, by differences."""
    rng = np.random.default_rng(SEED)
    v, push, lag, x, now = *rng.standard_normal((2, 3)), 0.1, rng.standard_normal(STATES), np.zeros(NOW_LENGTH)
    now[NOW_PUSH : NOW_PUSH + 3] = push

    def place(e):
        tau = lag + e[LAG]  # of a sensor's own state, true minus assumed
        return -e[DP] - tau * (v - e[DV]) + 0.5 * push * tau**2

    H = shown(v - lag * push)
    H[:, DV] = -lag * np.eye(3)
    as_it_moves(LAG, x, H)
    as_late_as_known(LAG, x, now, H)
    step = 1e-6
    for j in (*range(DV.start, DV.stop), *range(DP.start, DP.stop), LAG):
        e = np.zeros(STATES)
        e[j] = step
        np.testing.assert_allclose(-(place(x + e) - place(x - e)) / (2.0 * step), H[:, j], atol=1e-6)


def driven(seed, wander):
    """A robot of .5 to 1.6 m/s, fixes of a metre; their slow error in parts of that. Record, fixes, how late, s."""
    rng = np.random.default_rng([SEED, seed])
    legs = [{"kind": "straight", "duration": "5 s"}]
    for _ in range(14):
        legs.append({"kind": "accelerate", "to": f"{rng.uniform(0.5, 1.6)} m/s", "acceleration": "0.5 m/s^2"})
        legs.append({"kind": "straight", "duration": f"{rng.uniform(1.0, 8.0)} s"})
        angle = rng.uniform(20.0, 120.0) * rng.choice([-1.0, 1.0])
        legs.append({"kind": "turn", "angle": f"{angle} deg", "rate": f"{rng.uniform(10.0, 30.0)} deg/s"})
    late = 0.2 * rng.standard_normal()
    scenario = read_scenario(
        {
            "name": "robot",
            "duration": "150 s",
            "rate": "50 Hz",
            "position": {"lat": "45 deg", "lon": "10 deg"},
            "imu": "consumer",
            "motion": {"kind": "legs", "heading": f"{rng.uniform(0.0, 360.0)} deg", "legs": legs},
            "gnss": {"rate": "2 Hz", "position_noise": "1 m", "latency": f"{late} s"},
        }
    )
    gnss = scenario.simulate_aiding(seed=seed)["gnss"].record
    slow = np.zeros((len(gnss), 2))
    for k in range(1, len(slow)):
        slow[k] = 0.99 * slow[k - 1] + 0.14 * wander * rng.standard_normal(2)
    lat = gnss.lat + slow[:, 1] / METRES_PER_RADIAN
    lon = gnss.lon + slow[:, 0] / (METRES_PER_RADIAN * np.cos(gnss.lat))
    return scenario.simulate(seed=seed), replace(gnss, lat=lat, lon=lon, v_n=None, velocity_sigma=None), late


def off_by(seed, wander):
    """Errors of delay, level and heading over their sigmas."""
    log, gnss, late = driven(seed, wander)
    answer = align_in_motion(log.record, "consumer", gnss=gnss)
    (true,) = log.motion.states(np.array([answer.time])).C_nb
    R = true @ answer.C_nb.T
    phi = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    delay = answer.moving.delays.get("GNSS")
    of_delay = 0.0 if delay is None else (delay[0] - late) / delay[1]
    return np.append(of_delay, phi / np.sqrt(np.diag(answer.phi_covariance)))


@pytest.mark.slow
@pytest.mark.parametrize("wander", [0.0, 0.7])
def test_a_robot_shows_how_late_its_fixes_are(wander):
    off = np.array([off_by(seed, wander) for seed in range(16)])
    assert np.abs(off).max() < 4.0
    # An RMS of 16, one sigma of it 18 %: up to three of these.
    assert np.sqrt(np.mean(off[:, 0] ** 2)) < 1.0 + 3.0 * 0.18
