"""A cheap IMU with GNSS whose heading nothing tells: its level is that of gravity, as uncertain as its accelerometers."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import truenorth
from tests.runs import few_and_all, some
from truenorth.alignment.in_motion_level import with_level_biases
from truenorth.alignment.in_motion_task import moving_task
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.earth import normal_gravity
from truenorth.core.position import Position
from truenorth.errors.axes import standing
from truenorth.records.specs import imu_spec
from truenorth.simulation import OdometerSpec, rest, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.gnss import GnssSpec
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.state.layout import BA, BG, DP, DV, PHI
from truenorth.state.track import Track

SPAN = 40.0
DEG = np.radians(1.0)


def way(kind, rng):
    place = Position.from_degrees(rng.uniform(-60.0, 60.0), 10.0, 100.0)
    heading, tilt = rng.uniform(0.0, 6.0), np.radians(rng.uniform(-3.0, 3.0, 2))
    if kind == "at rest":
        return rest(place, heading, *tilt)
    legs = straight(SPAN + 5.0) if kind == "straight on" else [*s_turn(60 * DEG, 8 * DEG), *straight(SPAN)]
    return course(place, legs, heading=heading, speed=rng.uniform(5.0, 20.0))


def logs(kind, run):
    motion = way(kind, np.random.default_rng([7, run]))
    record = simulate(motion, rate=50.0, duration=SPAN, seed=77, run=run, imu=imu_spec("consumer")).record
    spec = GnssSpec(position_noise=2.0, velocity_noise=0.05)
    return motion, record, simulate_sensor(motion, spec, duration=SPAN, seed=77, run=run).record


@few_and_all(12, few=1)
@pytest.mark.parametrize("kind", some(["straight on"], ["at rest"]))
def test_level_is_as_good_as_the_accelerometers(kind, runs):
    """Before: 11 sigmas off at rest and 13 straight on, six logs each. Two numbers a run; false alarms 1 in 1000."""
    total = 0.0
    for run in range(runs):
        motion, record, gnss = logs(kind, run)
        answer = truenorth.align(record, None, "consumer", aid=[truenorth.Gnss(gnss)])
        phi = -rotation_vector_from_dcm(answer.C_nb @ motion.states(np.array(answer.time)).C_nb.T)
        ratio = phi[:2] / np.sqrt(np.diag(answer.phi_covariance))[:2]
        assert answer.status == "level_only"
        assert np.abs(ratio).max() < 4.0
        total += float(ratio @ ratio)
        assert np.all(answer.accel_bias_sigma[:2] > 0.9 * imu_spec("consumer").accel_bias)  # of which nothing is known
    assert total / (2 * runs) < 1.0 + 3.1 * np.sqrt(2 / (2 * runs))


def test_a_vehicle_that_turns_keeps_what_turning_tells():
    """Its heading is known, and its biases with it: level is far better than the biases allow."""
    motion, record, gnss = logs("turning", 1)
    answer = truenorth.align(record, None, "consumer", aid=[truenorth.Gnss(gnss)])
    sigma = np.sqrt(np.diag(answer.phi_covariance))
    assert answer.status == "aligned", answer.reasons
    assert sigma[:2].max() < 0.7 * imu_spec("consumer").accel_bias / 9.8
    phi = -rotation_vector_from_dcm(answer.C_nb @ motion.states(np.array(answer.time)).C_nb.T)
    assert np.abs(phi / sigma).max() < 4.0


def test_what_biases_do_to_level_is_in_the_covariance():
    """A bias across the vertical tilts the level by itself over g, and the covariance ties both; one along it does not."""
    _, record, gnss = logs("at rest", 0)
    task = moving_task(record, "consumer", None, gnss, None, None, None, (), True, None, 0.0).with_level_biases_held()
    C = dcm_from_rotation_vector([0.02, -0.03, 1.0])
    track = track_of(C, task.model.states, task.model.layout)
    found = with_level_biases(task, track)
    P, g = found.P[0], float(normal_gravity(task.position.lat, task.position.alt))
    seen = C @ P[BA, BA] @ C.T
    np.testing.assert_allclose(P[PHI, PHI][0, 0] * g**2, seen[1, 1], rtol=1e-9)  # phi_E = -nabla_N / g
    np.testing.assert_allclose((P[PHI, BA] @ C.T)[0, 1] * g, -seen[1, 1], rtol=1e-9)
    np.testing.assert_allclose((P[PHI, BA] @ C.T)[1, 0] * g, seen[0, 0], rtol=1e-9)
    np.testing.assert_allclose(P[PHI, PHI][2], 0.0, atol=1e-18)
    np.testing.assert_allclose(seen[2], 0.0, atol=1e-15)


def test_a_tilt_turns_the_velocity_that_a_wheel_shows_and_the_way():
    """The answer that a bias tilts, its velocity along the body's axes as it was: it climbs, and so does its way."""
    record, wheel = on_wheels()
    place = Position.from_degrees(40.0, 10.0, 100.0)
    task = moving_task(record, "consumer", wheel, None, place, None, None, (), True, None, 0.0).with_level_biases_held()
    time, v_n = np.arange(3.0), np.array([[3.0, 8.0, 0.2], [6.0, 5.0, -0.1], [9.0, 1.0, 0.4]])
    C = dcm_from_rotation_vector(np.array([[0.02, -0.03, 1.0], [0.02, 0.01, 0.4], [-0.01, 0.01, 0.1]]))
    empty = track_of(C[0], task.model.states, task.model.layout)
    P = np.zeros((3, task.model.states, task.model.states))
    found = with_level_biases(task, replace(empty, time=time, C_nb=C, v_n=v_n, P=P)).P
    up = C[:, 2]  # of the body's axes, (K, 3)
    sigma = np.sqrt(task.spec.bias_variance[3:] + task.spec.acting_variance(standing()))
    g, turned, went = float(normal_gravity(place.lat, place.alt)), [], []
    for axis in np.eye(3) * sigma:
        along = C @ axis - np.einsum("ki,i->k", up, axis)[:, None] * [0.0, 0.0, 1.0]  # east, north
        tilt = np.stack([-along[:, 1], along[:, 0], 0.0 * time], axis=1) / g
        off = np.einsum("kij,kj->ki", dcm_from_rotation_vector(-1e-3 * tilt), v_n) - v_n
        turned.append(1e3 * off)
        went.append(np.array([np.trapezoid(1e3 * off[: k + 1], time[: k + 1], axis=0) for k in range(3)]))
    for part, errors in ((DV, turned), (DP, went)):
        expected = np.einsum("aki,akj->kij", errors, errors)
        np.testing.assert_allclose(found[:, part, part], expected, rtol=1e-2, atol=1e-4 * expected.max())


def test_a_gyro_bias_is_as_unsure_as_the_heading_leaves_it():
    """A heading of which nothing is known turns the earth's rate round: what is handed on to navigation is what is said."""
    record, wheel = on_wheels()
    place = Position.from_degrees(40.0, 10.0, 100.0)
    answer = truenorth.align(record, place, "industrial", aid=truenorth.Odometer(wheel))
    assert answer.status == "level_only"
    level = np.linalg.norm(answer.C_nb[:2], axis=0) > 0.7  # body axes that lie level
    handed_on = np.sqrt(np.diag(answer.moving.P)[BG])
    assert np.all(answer.gyro_bias_sigma[level] > 0.9 * handed_on[level])


@functools.cache
def on_wheels():
    """IMU and wheel of a car that turns once."""
    motion = way("turning", np.random.default_rng(3))
    record = simulate(motion, rate=50.0, duration=SPAN, seed=78, imu=imu_spec("industrial")).record
    return record, simulate_sensor(motion, OdometerSpec(rate=10.0), duration=SPAN, seed=78).record


def track_of(C, states, layout):
    nothing = np.zeros((1, 3))
    return Track(
        np.zeros(1), C[None], nothing, nothing, np.zeros((1, states)), np.zeros((1, states, states)), layout, ()
    )
