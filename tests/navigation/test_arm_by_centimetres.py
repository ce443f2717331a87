"""Fixes of a centimetre of an antenna whose arm nobody has said: it is found together with heading, neither too surely."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.circling import drawn_start, received
from tests.runs import some
from truenorth import Gnss
from truenorth.core.position import Position
from truenorth.navigation import navigate
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn
from truenorth.state.track import Track

PLACE = Position.from_degrees(48.0, 11.0)
FIX, SECONDS = 0.02, 150.0  # m, s


def mower(rng):
    """Lanes of some metres, half a turn at the end of each."""
    legs = straight(5.0)
    for side in (1.0, -1.0, 1.0, -1.0, 1.0):
        lane = [*accelerate(1.0, 0.5, 0.0), *straight(rng.uniform(8.0, 15.0))]
        legs += [*lane, *turn(np.radians(180.0 * side), np.radians(25.0)), *accelerate(0.0, 0.5, 1.0)]
    return course(PLACE, legs, heading=rng.uniform(-3.0, 3.0))


@pytest.mark.parametrize(
    ("grade", "seed"),
    some([("industrial", 1)], [(grade, seed) for grade in ("tactical", "industrial") for seed in range(8)]),
)
def test_a_mower_whose_antenna_is_anywhere(grade, seed):
    """The product of an arm's error and heading's passed for knowledge: 6.0 sigmas, and logs that were refused."""
    rng, spec = np.random.default_rng([9, seed]), imu_spec(grade)
    motion = mower(rng)
    record = simulate(motion, rate=50.0, duration=SECONDS, imu=spec, seed=seed).record
    fixes = received(motion, SECONDS, 1.0, rng, FIX).record
    aid = Gnss(replace(fixes, position_sigma=np.full((len(fixes), 3), FIX)))
    answer = navigate(record, drawn_start(motion, spec, rng), imu=spec, aid=aid)
    off = answer.track.errors_against(Track.along(motion.states(answer.time))) / answer.track.sigma[:, :9]
    assert answer.status == "navigated"
    assert np.abs(off).max() < 5.5
    assert np.sqrt(np.mean(off[:, 2] ** 2)) < 2.5
