"""The 16-state model with a large azimuth error: its Jacobians, and the model against the INS and the odometer themselves."""

import numpy as np
import pytest

from truenorth.alignment.azimuth_mechanisation import mechanise_interval
from truenorth.core.attitude import dcm_from_quaternion, dcm_from_rotation_vector, quaternion_from_dcm
from truenorth.errors import in_motion_azimuth as model
from truenorth.filters import NonlinearSystem, check_jacobians
from truenorth.simulation import ideal_log
from truenorth.simulation.scenario import read_scenario
from truenorth.strapdown import wander

UP = np.array([0.0, 0.0, 1.0])


def parameters(rng):
    p = np.zeros(model.PARAMETERS)
    p[model.T] = 1.0
    p[model.C_MEAN] = dcm_from_rotation_vector(rng.normal(size=3)).ravel()
    p[model.FORCE], p[model.LATE_FORCE] = rng.normal(0.0, 1.0, 3) + 9.8 * UP, rng.normal(0.0, 0.5, 3) + 4.9 * UP
    p[model.TRAVELLED], p[model.VELOCITY] = 10 * rng.normal(size=3), 10 * rng.normal(size=3)
    p[model.EARTH], p[model.CURVATURE] = [1e-6, 5.6e-5, 4.7e-5], [1.57e-7, 1e-10, 1.57e-7]
    return p


@pytest.mark.parametrize("azimuth", [0.0, 0.5, -2.0])
def test_jacobians(azimuth):
    """Against differences; and linear in all states but the azimuth, as the reduced filters need it."""
    rng = np.random.default_rng(5)
    x = np.concatenate([1e-2 * rng.normal(size=2), [azimuth], rng.normal(size=6), 1e-5 * rng.normal(size=6), [1e-3]])
    sigma = np.array([1e-2] * 3 + [1.0] * 6 + [1e-5] * 3 + [1e-3] * 3 + [3e-3])
    system = NonlinearSystem(
        model.transition,
        model.measurement,
        Q=np.eye(16)[None],
        R=np.eye(3)[None],
        z=np.zeros((1, 3)),
        x0=x,
        P0=np.diag(sigma**2),
        p=parameters(rng)[None],
        transition_jacobian=model.transition_jacobian,
        measurement_jacobian=model.measurement_jacobian,
    )
    check_jacobians(system, rng, nonlinear=[model.AZIMUTH])


def errors_between(s_hat, s):
    """phi and dv of two states in w."""
    M = dcm_from_quaternion(s[wander.ATTITUDE]) @ dcm_from_quaternion(s_hat[wander.ATTITUDE]).T
    return np.array([M[2, 1], -M[2, 0], np.arctan2(M[1, 0], M[0, 0])]), s_hat[wander.VELOCITY] - s[wander.VELOCITY]


@pytest.mark.parametrize("azimuth", np.radians([0.0, 10.0, -60.0, 120.0]))
def test_model_against_the_ins_and_the_odometer(azimuth):
    """A second of accelerating, turning and climbing, once without errors and once with all of them."""
    rng = np.random.default_rng(8)
    ring = read_scenario("odometer_ring").build_motion()
    log = ideal_log(ring, rate=100.0, duration=1.0, start=20.0)
    at = ring.states(log.edges)
    steps, which = np.full(100, 0.01), np.zeros(1, np.int64)
    way = 0.5 * 0.01 * (np.linalg.norm(at.v_n[1:], axis=1) + np.linalg.norm(at.v_n[:-1], axis=1))
    tilt, dv = 2e-3 * rng.normal(size=2), np.array([0.3, -0.2, 0.1])
    eps, nabla, scale = 1e-5 * rng.normal(size=3), 5e-3 * rng.normal(size=3), 4e-3
    x = np.concatenate([tilt, [azimuth], dv, np.zeros(3), eps, nabla, [scale]])
    s = wander.state_at(at.C_nb[0], at.v_n[0], at.lat[0], at.lon[0], at.alt[0])
    s[wander.LAST_ANGLE], s[wander.LAST_VELOCITY] = log.dtheta[0], log.dvel[0]
    s_hat = s.copy()
    C_hat = model.correction(x[None])[0].T @ at.C_nb[0]
    s_hat[wander.ATTITUDE], s_hat[wander.VELOCITY] = quaternion_from_dcm(C_hat), at.v_n[0] + dv
    p, z = np.zeros((1, model.PARAMETERS)), np.zeros((1, 3))
    none = np.zeros((1, 7))
    mechanise_interval(steps, log.dtheta[None], log.dvel[None], way[None], which, 0, 100, none, s[None], p, z)
    assert np.abs(z).max() < 1e-4  # the odometer itself: it sees the way, not its chord
    mechanise_interval(
        steps,
        log.dtheta[None] + 0.01 * eps,
        log.dvel[None] + 0.01 * nabla,
        (1.0 + scale) * way[None],
        which,
        0,
        100,
        none,
        s_hat[None],
        p,
        z,
    )
    after, seen = np.zeros(16), np.zeros(3)
    model.transition(x, p[0], after)
    model.measurement(after, p[0], seen)
    phi, velocity = errors_between(s_hat, s)
    assert np.allclose(after[model.PHI][:2], phi[:2], atol=1e-4 * np.abs(tilt).max())
    assert abs((after[2] - phi[2] + np.pi) % (2 * np.pi) - np.pi) < 5e-6  # tilts squared
    moved = np.abs(velocity - dv).max()
    assert np.allclose(after[model.DV], velocity, atol=1e-3 * moved + 1e-4)
    assert np.allclose(seen, z[0], atol=2e-4 * np.linalg.norm(p[0, model.TRAVELLED]))
    # What the odometer and the azimuth make of it is far more than that.
    assert np.linalg.norm(z) > 0.03
