"""Heading that no acceleration shows: starts that are one sigma off move the answer by no more than its sigma."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.circling import drawn_start, received
from tests.runs import some
from truenorth.core.position import Position
from truenorth.filters import LinearSystem, kalman
from truenorth.navigation import navigate
from truenorth.navigation.by_start import UP, Others, _shifts, start_evidence, stretch
from truenorth.records.specs import imu_spec
from truenorth.simulation import Sway, Tone, simulate
from truenorth.state.layout import BG, SLOW_GYRO
from truenorth.state.track import Track

DOCK = Position.from_degrees(40.0, 118.0)
CALM = Sway(DOCK, heading=1.0, roll_tones=(Tone(0.01, 6.0, 0.2),), heading_tones=(Tone(0.03, 17.0, 0.2),))
SWELL = Sway(DOCK, heading=1.0, roll_tones=(Tone(0.05, 6.0, 0.2),), north_tones=(Tone(0.3, 8.0, 0.2),))


def navigated(motion, grade, duration, seed):
    rng, spec = np.random.default_rng(seed), imu_spec(grade)
    log = simulate(motion, rate=25.0, duration=duration, imu=spec, seed=seed)
    answer = navigate(log.record, drawn_start(motion, spec, rng), aid=received(motion, duration, 1.0, rng), imu=spec)
    track = answer.track
    of_gyros = (track.gyro_bias[-1] - log.errors.gyro_bias) / track.bias_sigma(BG, SLOW_GYRO)[-1]
    return answer, track.errors_against(Track.along(motion.states(answer.time))) / track.sigma[:, :9], of_gyros


@pytest.mark.parametrize(
    ("motion", "grade", "duration", "seed"),
    some(
        [(CALM, "consumer", 200.0, 3)],
        [
            (motion, grade, duration, seed)
            for motion in (CALM, Sway(DOCK, heading=1.0))
            for grade, duration in (("consumer", 200.0), ("consumer", 600.0), ("industrial", 600.0))
            for seed in (1, 2, 3)
        ],
    ),
)
def test_heading_without_a_push_is_as_unsure_as_its_gyro(motion, grade, duration, seed):
    """Eight sigmas off, `navigated`, or refused for scale factors 30 times as large; the gyro's bias six to twelve."""
    answer, off, of_gyros = navigated(motion, grade, duration, seed)
    assert np.abs(off[:, UP]).max() < 4.0
    assert np.abs(of_gyros).max() < 4.0
    assert answer.status == "navigated"


@pytest.mark.parametrize("seed", some([1], [2, 3, 4]))
def test_a_swell_shows_heading_and_sigma_stays(seed):
    answer, off, _ = navigated(SWELL, "consumer", 200.0, seed)
    assert np.degrees(answer.track.sigma[-1, UP]) < 3.0
    assert np.abs(off[:, UP]).max() < 4.0
    assert not any(item.key == "heading.by_start" for item in answer.evidence)


def test_errors_of_the_start_are_independent_and_within_its_covariance():
    """``delta delta' <= P`` is ``delta' P^-1 delta = 1`` of each, and nothing of both; groups that are known stay as they are."""
    rng = np.random.default_rng(1)
    start = drawn_start(CALM, imu_spec("consumer"), rng)
    size = np.concatenate([np.sqrt(np.diag(start.P)), [1e-3, 1e-3]])
    A = rng.standard_normal((17, 17)) * size[:, None]
    correlated = replace(start, P=A @ A.T)
    shifts, of_both = _shifts(correlated)
    whole = np.vstack([shifts, np.zeros((2, 2))])
    np.testing.assert_allclose(whole.T @ np.linalg.solve(A @ A.T, whole), np.eye(2), atol=1e-6)
    np.testing.assert_allclose(shifts[UP] @ shifts[UP], of_both[0, 0])
    other = start.with_errors(shifts[:, 1])
    np.testing.assert_allclose(start.gyro_bias - other.gyro_bias, shifts[BG, 1])


def test_a_heading_that_its_gyro_alone_has_turned_is_one_error():
    start = drawn_start(CALM, imu_spec("consumer"), np.random.default_rng(1))
    for row in (300.0 * -start.C_nb[2], np.zeros(3)):  # 300 s by the gyro; known
        J = np.eye(15)
        J[UP], J[UP, BG] = 0.0, row
        shifts, of_both = _shifts(replace(start, P=J @ start.P @ J.T))
        np.testing.assert_allclose(shifts[UP] @ shifts[UP], of_both[0, 0], rtol=1e-9)
        assert np.sum(np.linalg.norm(shifts, axis=0) > 0.0) == 1


def test_a_linear_answer_is_left_as_it_is():
    """It moves by what its covariance says of the start, and no less than none of sigma is seen."""
    answer, _, _ = navigated(SWELL, "industrial", 60.0, 1)
    start = drawn_start(SWELL, imu_spec("consumer"), np.random.default_rng(1))
    evidence, growth = start_evidence(lambda _: answer.track, start, answer.track)
    assert evidence == []
    np.testing.assert_array_equal(growth, 1.0)


def test_a_linear_filter_moves_by_no_more_than_its_sigma():
    """``sum d_i d_i' <= P`` of starts that are off by ``delta_i``, ``sum delta_i delta_i' <= P0``, whatever it is measured."""
    rng = np.random.default_rng(2)
    n, count = 5, 40
    Phi = np.linalg.qr(rng.standard_normal((n, n)))[0]
    A, H = rng.standard_normal((n, n)), rng.standard_normal((1, n)) * np.array([0.0, 0.0, 1.0, 1.0, 1.0])
    system = LinearSystem(
        Phi=Phi[None],
        Q=1e-3 * np.eye(n)[None],
        H=H[None],
        R=np.array([[[0.1]]]),
        z=rng.standard_normal((count, 1)),
        x0=np.zeros(n),
        P0=A @ A.T,
    )
    usual = kalman(system, history="full")
    shifts = A @ np.linalg.qr(rng.standard_normal((n, n)))[0][:, :2]
    d = np.stack([kalman(replace(system, x0=x), history="full").x - usual.x for x in shifts.T])
    room = usual.P - np.einsum("ski,skj->kij", d, d)
    assert np.linalg.eigvalsh(room).min() > -1e-9
    assert np.sum(d[:, -1] ** 2) > 1e-6


def test_up_to_now_is_what_a_log_that_ends_now_says():
    """A running answer takes epochs one by one: its growth at each is that of the last epoch of the track until there."""
    answer, _, _ = navigated(SWELL, "industrial", 60.0, 1)
    start = drawn_start(SWELL, imu_spec("consumer"), np.random.default_rng(1))
    others, track = Others.of(start), answer.track
    sizes = np.array([1.0, 1.2, 1.6, 0.9, 0.4, 0.8, 1.4, 0.6, 0.3])[:, None]
    moved = sizes[np.arange(len(track)) // 5 % len(sizes)] * track.sigma[:, :9]
    most = 0.0
    for k in range(len(track)):
        one, until = track[k : k + 1], track[: k + 1]
        np.testing.assert_array_equal(
            others.growth(one, moved[k : k + 1], most)[-1], others.growth(until, moved[: k + 1])[-1]
        )
        most = stretch(one, moved[k : k + 1], most)
    assert others.growth(track, moved)[15:20, UP].min() > 1.0  # .9 of sigma, after 1.6
    np.testing.assert_array_equal(others.growth(track, moved)[25:30, UP], 1.0)  # .8, after .4
