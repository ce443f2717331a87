"""The static error model against finite differences of the real integration, and its noise against Monte Carlo."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import normal_gravity
from truenorth.core.position import Position
from truenorth.errors.staying import BA, BG, DV, PHI, STATES, StaticModel, mean_velocity
from truenorth.records import ImuRecord
from truenorth.simulation import Sway, Tone, simulate
from truenorth.strapdown.inertial import gravity_velocity, integrate

LAT, ALT = np.radians(40.0), 100.0


def _turning_record(seconds: float = 20.0, rate: float = 100.0) -> tuple[ImuRecord, np.ndarray]:
    """An IMU that turns about its own centre on a base at rest, and its attitude at the start."""
    heading, pitch, roll = (Tone(0.3, 11.0, 0.4),), (Tone(0.2, 7.0, 1.0),), (Tone(0.25, 9.0, 2.0),)
    place = Position(LAT, 0.0, ALT)
    motion = Sway(place, 0.7, 0.05, -0.1, heading_tones=heading, pitch_tones=pitch, roll_tones=roll)
    return simulate(motion, rate=rate, duration=seconds).record, motion.states(0.0).C_nb


def _mean_velocity(record, interval, C_n0_i, gyro_bias, accel_bias):
    integrals = integrate(record, interval, gyro_bias, accel_bias)
    return mean_velocity(integrals, C_n0_i, LAT, ALT), integrals


@pytest.mark.parametrize(("interval", "tolerance"), [(1.0, 5e-3), (0.2, 2e-4)])
@pytest.mark.parametrize("state", range(STATES))
def test_jacobian_is_the_derivative_of_the_integration(state, interval, tolerance):
    """Carry each state through Phi and H; compare with the integrated log when that error is really made.

    Within an interval the model takes the product of force and turn as constant: its error falls with the square of the
    interval, and so does the tolerance.
    """
    record, C = _turning_record()
    zero = np.zeros(3)
    model = StaticModel(0.0, 0.0)
    base, integrals = _mean_velocity(record, interval, C, zero, zero)
    system = model.linearise(integrals, C, LAT, ALT, np.eye(STATES), np.ones(3))

    step = {0: 1e-5, 1: 1e-3, 2: 1e-6, 3: 1e-4}[state // 3]
    dx = np.zeros(STATES)
    dx[state] = step
    C_hat, gyro_bias, accel_bias = C, zero, zero
    offset = np.zeros(3)
    if state in range(*PHI.indices(STATES)):
        C_hat = dcm_from_rotation_vector(-dx[PHI]) @ C
    elif state in range(*BG.indices(STATES)):
        gyro_bias = -dx[BG]  # a log measured too high by eps is the log with -eps taken off
    elif state in range(*BA.indices(STATES)):
        accel_bias = -dx[BA]
    else:
        offset = dx[DV]
    moved, _ = _mean_velocity(record, interval, C_hat, gyro_bias, accel_bias)

    from truenorth.strapdown.inertial import earth_rotation

    middle = (integrals.time[1:] + integrals.time[:-1]) / 2
    C_n_n0 = np.swapaxes(earth_rotation(middle, LAT), 1, 2)
    expected = np.einsum("kab,kb->ka", C_n_n0, (moved - base) + offset) / step
    x = dx / step
    predicted = np.empty_like(expected)
    for k in range(len(expected)):
        x = system.Phi[k] @ x
        predicted[k] = system.H[k] @ x
    scale = np.max(np.abs(expected))
    np.testing.assert_allclose(predicted, expected, rtol=0, atol=tolerance * scale)


def test_noise_inside_an_interval():
    """Q, R and S against 4000 simulated intervals of white gyro and accelerometer noise under constant force.

    Each of 15 + 9 + 6 checked terms is a sample moment; 4.5 standard errors make a false alarm in 2e-4 of runs.
    """
    rng = np.random.default_rng(3)
    runs, rate = 4000, 200
    q_g, q_a = 3e-4, 2e-3
    force = np.array([0.0, 0.0, float(normal_gravity(np.pi / 2, ALT))])
    dt = 1.0 / rate
    w_g = q_g * np.sqrt(dt) * rng.standard_normal((runs, rate, 3))
    w_a = q_a * np.sqrt(dt) * rng.standard_normal((runs, rate, 3))
    phi = np.cumsum(w_g, axis=1)
    phi_middle = phi - 0.5 * w_g
    dv = np.cumsum(np.cross(force, phi_middle) * dt + w_a, axis=1)
    mean = dv.mean(axis=1) - 0.5 * dv[:, -1] * dt  # trapezoid
    phi_end, dv_end = phi[:, -1], dv[:, -1]
    noise = mean - dv_end + 0.5 * np.cross(force, phi_end)  # z - H x for H = [-T/2 [f x], I]

    record = ImuRecord(np.arange(1, 501) / 100, np.zeros((500, 3)), np.tile(force / 100, (500, 1)), "increments")
    integrals = integrate(record, 1.0)
    system = StaticModel(q_g, q_a).linearise(integrals, np.eye(3), np.pi / 2, ALT, np.eye(STATES), np.zeros(3))
    Q, S, R = system.Q[0], system.S[0], system.R[0]
    process = np.concatenate([phi_end, dv_end], axis=1)
    for sample, theory, a, b in (
        (process.T @ process / runs, Q[:6, :6], process, process),
        (process.T @ noise / runs, S[:6], process, noise),
        (noise.T @ noise / runs, R, noise, noise),
    ):
        error = np.sqrt((a**2).mean(0)[:, None] * (b**2).mean(0)[None, :] / runs)
        assert np.all(np.abs(sample - theory) < 4.5 * error + 0.02 * np.abs(theory))


def test_gravity_integrals_are_the_earth():
    """A still IMU at any latitude measures minus gravity; its integral in n0 cancels gravity's."""
    t = np.array([0.0, 100.0, 1000.0])
    for lat in (-1.2, 0.0, 0.7):
        from truenorth.core.earth import earth_rate_n, normal_gravity

        steps = 20000
        dt = t[-1] / steps
        w = np.asarray(earth_rate_n(lat))
        mid = (np.arange(steps) + 0.5) * dt
        C = Rotation.from_rotvec(mid[:, None] * w).as_matrix()
        total = -(C @ np.array([0, 0, float(normal_gravity(lat, ALT))])).sum(axis=0) * dt
        np.testing.assert_allclose(gravity_velocity(t, lat, ALT)[-1], total, rtol=1e-7, atol=1e-6)
