"""Passes that begin with biases as narrow as they were found, about what was found, and that prior taken off again."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.alignment.in_motion_hidden import HELD, _held
from truenorth.alignment.in_motion_narrow import LEAST, NARROWER, Narrowed, as_found
from truenorth.alignment.in_motion_start import Guess
from truenorth.alignment.in_motion_task import moving_task
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.position import Position
from truenorth.errors.axes import accel_axes, known_as_bias, standing
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight
from truenorth.simulation.odometer import OdometerSpec
from truenorth.state.layout import ACCEL_AXES, BA, BG, Layout
from truenorth.state.track import Track

PLACE = Position.from_degrees(40.0, 10.0, 100.0)
CONSUMER = imu_spec("consumer")
AXES = accel_axes(CONSUMER, standing())
STATES = 15 + len(AXES.sigma)


class _Rows:
    """Rows of all states of a system that stands still, and the posterior about any prior."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.wide = CONSUMER.constant_variance
        self.H = rng.standard_normal((STATES, STATES)) / np.sqrt(np.diag(self.prior(self.wide)))
        self.noise = 0.7
        self.z = self.noise * rng.standard_normal(STATES) + self.H @ (
            np.linalg.cholesky(self.prior(self.wide)) @ rng.standard_normal(STATES)
        )

    def prior(self, variance):
        P = np.diag(np.concatenate([np.full(9, 1e-8), variance, np.square(AXES.sigma)]))
        return known_as_bias(P, np.zeros(STATES), AXES, 15, None)[0]

    def posterior(self, variance, centre):
        """Mean, covariance, and minus twice the log-likelihood but for a constant."""
        P0, mean = self.prior(variance), np.concatenate([np.zeros(9), centre, np.zeros(9)])
        S = self.H @ P0 @ self.H.T + self.noise**2 * np.eye(STATES)
        gain, nu = P0 @ self.H.T @ np.linalg.inv(S), self.z - self.H @ mean
        P = P0 - gain @ self.H @ P0
        return mean + gain @ nu, 0.5 * (P + P.T), nu @ np.linalg.solve(S, nu) + np.linalg.slogdet(S)[1]


def track_of(x, P):
    """A track of one epoch whose errors (true attitude and biases less the assumed, velocity the other way) are these."""
    C = dcm_from_rotation_vector(x[:3])[None]
    sensors = np.concatenate([np.zeros(9), x[9:]])[None]
    layout = Layout((ACCEL_AXES,), (tuple(AXES.sigma),))
    return Track(np.zeros(1), C, -x[None, 3:6], np.zeros((1, 3)), sensors, P[None], layout, ())


@pytest.mark.parametrize("part", [1.0, 0.3, 0.01])
def test_the_specification_takes_the_place_of_what_was_found(part):
    """Against the dense joint Gaussian: state, covariance and likelihood, whatever the prior that a pass has begun with."""
    rows = _Rows(5)
    narrow = rows.wide * np.where(np.arange(6) % 2, 1.0, part**2)
    centre = np.sqrt(rows.wide) * np.array([0.8, -0.5, 0.3, 1.2, -0.7, 0.1])
    x, P, cost = rows.posterior(narrow, centre)
    wanted, wanted_P, wanted_cost = rows.posterior(rows.wide, np.zeros(6))
    prior = Narrowed(centre, narrow, rows.wide)
    begun, moved = track_of(x, P), track_of(wanted, wanted_P)
    found = prior.taken_off(begun)
    scale = np.sqrt(np.diag(wanted_P))
    np.testing.assert_allclose(found.P[0] / np.outer(scale, scale), wanted_P / np.outer(scale, scale), atol=1e-8)
    np.testing.assert_allclose(found.C_nb, moved.C_nb, atol=1e-7)
    np.testing.assert_allclose(found.v_n, moved.v_n, atol=1e-10)
    np.testing.assert_allclose(found.sensors[0, 9:] / scale[9:], moved.sensors[0, 9:] / scale[9:], atol=1e-7)
    assert cost + prior.misfit(begun) == pytest.approx(wanted_cost, abs=1e-6)
    assert np.abs((x - wanted) / scale).max() > 0.1  # it had something to take off


def test_no_bias_at_all_is_left_alone():
    """Of a specification without biases: nothing is divided by zero, and nothing changes."""
    rows, none = _Rows(6), np.zeros(6)
    x, P, _ = rows.posterior(none, none)
    begun = track_of(x, P)
    prior = Narrowed(none, none, none)
    np.testing.assert_allclose(prior.taken_off(begun).P, begun.P, atol=1e-15)
    assert prior.misfit(begun) == pytest.approx(0.0, abs=1e-12)


def test_what_walks_is_not_narrowed():
    """And nothing is narrower than a thousandth of the specification, nor wider."""
    *_, task = at_rest(0)
    wide = CONSUMER.constant_variance
    P = np.diag(np.concatenate([np.ones(9), wide * np.tile([1e-6, 0.25, 400.0], 2)]))
    track = Track(
        np.zeros(1), np.eye(3)[None], np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((1, 15)), P[None], Layout(), ()
    )
    part = np.array([LEAST**2, 0.25 * NARROWER**2, 1.0])
    np.testing.assert_allclose(as_found(task, track), wide * np.tile(part, 2))
    walks = task.with_spec(replace(task.spec, gyro_rate_random_walk=1e-6))
    np.testing.assert_allclose(as_found(walks, track), wide * np.concatenate([np.ones(3), part]))


def at_rest(run, span=35.0):
    """A consumer IMU that stands with its wheel; the same without errors; task."""
    motion = course(PLACE, straight(span), heading=0.7 * run, speed=0.0)
    sensed, ideal = (
        simulate(motion, rate=50.0, duration=span, seed=41, run=run, imu=imu).record for imu in (CONSUMER, None)
    )
    odometer = simulate_sensor(motion, OdometerSpec(noise=0.0), duration=span, seed=41, run=run).record
    return motion, ideal, moving_task(sensed, "consumer", odometer, None, PLACE, None, None, (), True, None, 0.0)


def known(task, guess):
    """A held pass, and sigma of its level at the end, less and more known axis, rad."""
    found = _held(task, guess).of
    return found, np.sqrt(np.linalg.eigvalsh(found.track.P[-1, :2, :2]))


@pytest.mark.parametrize("run", range(4))
@pytest.mark.parametrize("off", [-1.5, 0.0, 1.5])
def test_rest_does_not_part_a_tilt_from_a_bias(run, off):
    """The law is the sigma of a log without errors: nothing turns there. `off`: sigmas that the first pass knows no gyro z by."""
    motion, ideal, task = at_rest(run)
    start = np.asarray(motion.states(np.array(0.0)).C_nb)
    _, law = known(replace(task, record=ideal), Guess(start, 0.07, HELD))
    bias = np.array([0.0, 0.0, off * CONSUMER.gyro_bias])
    first, before = known(task, Guess(start, 0.07, HELD, gyro_bias=bias))
    sensors = first.track.sensors[-1]
    guess = Guess(first.back, 0.07, HELD, sensors[BG], sensors[BA], as_found(task, first.track))
    _, found = known(task, guess)
    assert law[0] > 0.9 * CONSUMER.accel_bias / 9.8  # it is that of the bias: nothing else is shown
    assert np.all(np.abs(found / law - 1.0) < 0.01)
    assert before[0] < 0.95 * law[0]  # the pass before, which began with biases as specified
