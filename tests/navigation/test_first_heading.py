"""A heading that is known where the log begins is that of the start, whatever the base turns by until then."""

import itertools
import math

import numpy as np
import pytest
from scipy.stats import chi2

import truenorth as tn
from tests.runs import few_and_all, some
from truenorth.core.attitude import euler_from_dcm
from truenorth.navigation.first_heading import turn_since_first_row
from truenorth.simulation import Sway, rest, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn
from truenorth.simulation.tones import Tone

PLACE = tn.Position.from_degrees(48.0, 11.0, 500.0)
SIGMA = math.radians(0.5)


def _heading_off(start, motion):
    """What the heading of a start is off by, and its sigma, rad."""
    true = motion.states(start.time)
    off = euler_from_dcm(start.C_nb)[0] - euler_from_dcm(true.C_nb)[0]
    return math.remainder(off, 2.0 * math.pi), math.sqrt(start.P[2, 2])


@pytest.mark.parametrize(
    ("imu", "size", "period"),
    some(
        [("consumer", 2.0, 8.0), ("tactical", 10.0, 60.0)],
        [
            *itertools.product(["navigation", "tactical", "industrial"], [2.0], [8.0]),
            *itertools.product(["navigation", "industrial", "consumer"], [10.0], [60.0]),
            *itertools.product(["industrial", "consumer"], [15.0], [240.0]),
        ],
    ),
)
@few_and_all(4, few=2)
def test_a_boat_at_anchor_sheers(imu, size, period, runs):
    ratios = []
    for seed in range(runs):
        rng = np.random.default_rng([seed, int(period)])
        roll, sheer = (
            Tone(math.radians(3.0), 5.0, rng.uniform(0.0, 6.0)),
            Tone(math.radians(size), period, rng.uniform(0.0, 6.0)),
        )
        motion = Sway(PLACE, heading=1.0, roll_tones=(roll,), pitch_tones=(Tone(0.01, 4.0),), heading_tones=(sheer,))
        log = simulate(motion, rate=25.0, duration=150.0, imu=imu, seed=seed).record
        first = euler_from_dcm(motion.states(0.0).C_nb)[0]
        start = tn.known_start(log, PLACE, imu, first + SIGMA * rng.standard_normal(), SIGMA)
        off, sigma = _heading_off(start, motion)
        ratios.append(off / sigma)
        if (
            imu in ("navigation", "tactical") or period < 10.0
        ):  # the turn is known well, by the bias or by the swing itself
            assert sigma < 3.0 * SIGMA
    assert np.max(np.abs(ratios)) < 4.0
    assert np.sum(np.square(ratios)) < chi2.isf(1e-3, runs)


@pytest.mark.parametrize("imu", ["navigation", "tactical", "industrial"])
def test_a_robot_turns_in_place_before_it_leaves(imu):
    legs = [
        *straight(12.0),
        *turn(math.radians(90.0), math.radians(30.0)),
        *straight(25.0),
        *accelerate(1.5, 0.5, 0.0, 1.0),
    ]
    motion = course(PLACE, [*legs, *straight(60.0)], heading=0.5)
    log = simulate(motion, rate=100.0, duration=100.0, imu=imu, seed=3).record
    start = tn.known_start(log, PLACE, imu, 0.5 + 0.4 * SIGMA, SIGMA)
    off, sigma = _heading_off(start, motion)
    assert abs(off) < 3.0 * sigma
    assert sigma < 2.0 * SIGMA


@pytest.mark.parametrize("imu", ["navigation", "tactical", "consumer"])
@pytest.mark.parametrize("pitch", [0.02, 1.5, math.radians(90.0)])
def test_a_base_at_rest_does_not_turn(imu, pitch):
    """Nor one that stands on its forward axis, of which heading is noise."""
    log = simulate(rest(PLACE, 1.0, pitch, -0.03), rate=50.0, duration=60.0, imu=imu, seed=2).record
    assert turn_since_first_row(log, tn.align(log, PLACE, imu)) == (0.0, 0.0)
