"""Drives whose stops are all that is known of their speed: a zero velocity says nothing of heading."""

from functools import cache

import numpy as np
import pytest

from benchmarks.honesty.circling import drawn_start
from tests.runs import some
from truenorth.core.position import Position
from truenorth.navigation import navigate
from truenorth.navigation.stops import while_it_stands, zero_updates
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn
from truenorth.state.layout import BG, STATES
from truenorth.state.track import Track

PLACE = Position.from_degrees(48.0, 11.0)
UP = 2
MINUTES = 400.0


def drive(rng, first=0.0):
    """Blocks of a minute and more at uneven speed, with turns, and stops of twenty seconds between them."""
    legs = straight(15.0) if first == 0.0 else accelerate(0.0, 2.0, first) + straight(20.0)
    for _ in range(4):
        speed = rng.uniform(8.0, 12.0)
        legs += accelerate(speed, 2.0, 0.0)
        for _ in range(rng.integers(3, 6)):
            legs += accelerate(speed + 4.0, rng.uniform(0.5, 1.0), speed)
            legs += turn(np.radians(rng.choice([-90.0, 90.0])), np.radians(12.0))
            legs += accelerate(speed, rng.uniform(0.5, 1.0), speed + 4.0)
        legs += accelerate(0.0, 2.0, speed) + straight(20.0)
    return course(PLACE, legs, heading=rng.uniform(-3.0, 3.0), speed=first)


def stops_of(motion):
    """The stops, as they are: no road shakes this vehicle, and what the IMU finds is another test's."""
    time = np.arange(0.0, MINUTES)
    stands = np.linalg.norm(motion.states(time).v_n, axis=1) < 1e-9
    edges = np.flatnonzero(np.diff(np.concatenate([[False], stands, [False]]).astype(int))).reshape(-1, 2)
    return [(time[a], time[b - 1]) for a, b in edges if b - a > 3]


@cache
def navigated(grade, seed):
    rng, spec = np.random.default_rng(seed), imu_spec(grade)
    motion = drive(rng)
    record = simulate(motion, rate=50.0, duration=MINUTES, imu=spec, seed=seed).record
    answer = navigate(record, drawn_start(motion, spec, rng), imu=spec, zupt=stops_of(motion))
    return answer, answer.track.errors_against(Track.along(motion.states(answer.time)))


@pytest.mark.parametrize(
    ("grade", "seed"),
    some([("industrial", 3)], [(grade, seed) for grade in ("tactical", "industrial", "consumer") for seed in range(8)]),
)
def test_stops_alone_are_honest(grade, seed):
    """The velocity that has drifted by the next stop seemed to turn with heading: 18 of 60 drives were up to 42 sigmas off."""
    answer, errors = navigated(grade, seed)
    sigma = answer.track.sigma[:, :9]
    off = np.abs(errors[:, [0, 1, 2, 3, 4, 6, 7]] / sigma[:, [0, 1, 2, 3, 4, 6, 7]])
    assert answer.stops > 40
    assert answer.status == "navigated"
    assert off.max() < 4.0


def test_a_stop_leaves_heading_as_unsure_as_it_was():
    """Of industrial gyros, which do not see the earth turn: no sigma of heading is smaller than that of its start and its gyro."""
    answer, _ = navigated("industrial", 3)
    sigma = answer.track.sigma[:, UP]
    assert sigma.min() > 0.95 * sigma[0]


def test_an_even_speed_that_the_start_knows_is_no_stop():
    """16 m/s for nine seconds looked like rest to the IMU, and pulled the INS to it."""
    spec, rng = imu_spec("industrial"), np.random.default_rng(1)
    legs = straight(12.0) + accelerate(0.0, 2.0, 14.0) + straight(30.0)
    motion = course(PLACE, legs, heading=0.4, speed=14.0)
    record = simulate(motion, rate=50.0, duration=40.0, imu=spec, seed=1).record
    start = drawn_start(motion, spec, rng)
    found = zero_updates(record, "auto")
    moves = np.linalg.norm(motion.states(found[0].time).v_n, axis=1) > 1.0
    assert moves.any()
    free = navigate(record, start, imu=spec, altitude="fixed").track
    for before, after in zip(found, while_it_stands(found, free), strict=True):
        assert set(after.time) <= set(before.time)
        assert np.linalg.norm(motion.states(after.time).v_n, axis=1).max() < 0.3
    assert len(while_it_stands(found, free)[0].time) == np.count_nonzero(~moves)


def test_a_start_with_errors_in_it_has_them():
    spec, rng = imu_spec("tactical"), np.random.default_rng(2)
    motion = drive(rng, 5.0)
    start = drawn_start(motion, spec, rng)
    x = 1e-3 * rng.standard_normal(STATES)
    other = start.with_errors(x)

    def track(s):
        place = np.array([[s.lat, s.lon, s.alt]])
        return Track.of_motion(np.zeros(1), s.C_nb[None], s.v_n[None], place)

    np.testing.assert_allclose(track(other).errors_against(track(start))[0], x[:9], atol=1e-6)
    np.testing.assert_allclose(start.gyro_bias - other.gyro_bias, x[BG], atol=1e-15)
