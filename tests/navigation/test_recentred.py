"""A start whose heading is unsure is turned to where the log shows it; one that is sure, or that nothing shows, stays."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.circling import drawn_start, received
from benchmarks.honesty.driving import STRAIGHT, car, ship
from tests.runs import some
from truenorth.alignment.in_motion_passes import turn_between
from truenorth.core.attitude import dcm_from_euler
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track
from truenorth.navigation import Mounting, navigate
from truenorth.navigation.by_start import LINEAR, UP
from truenorth.navigation.recentred import WIDER, linear_within, recentred
from truenorth.records.specs import imu_spec
from truenorth.simulation import ideal_log, simulate
from truenorth.state.track import Track

DURATION, UNSURE = 300.0, math.radians(15.0)


def turned(start, angle, sigma=UNSURE):
    """The start with a heading that is off by an angle, and one sigma of it."""
    P = start.P.copy()
    P[UP], P[:, UP] = 0.0, 0.0
    P[UP, UP] = sigma**2
    return replace(start, C_nb=dcm_from_euler(angle, 0.0, 0.0) @ start.C_nb, P=P)


def sailed(seed, grade="consumer"):
    rng, spec = np.random.default_rng(seed), imu_spec(grade)
    motion = ship(rng, DURATION)
    record = simulate(ideal_log(motion, rate=25.0, duration=DURATION), imu=spec, seed=seed).record
    start = drawn_start(motion, spec, rng)
    return motion, spec, record, start, received(motion, DURATION, 1.0, rng)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [-40.0, 30.0])
def test_a_wrong_heading_is_turned_to_what_the_log_shows(angle):
    motion, spec, record, start, aid = sailed(3)
    model = InsModel.from_spec(spec)
    begun = turned(start, math.radians(angle), math.radians(25.0))

    def run(at, gated):
        used = aid.sources("free")
        track = navigate_track(record, at, model, used, interval=0.2, every=5)
        return replace(
            track, smoothing=lambda: navigate_track(record, at, model, used, interval=0.2, every=5, smooth=True)
        )

    found = recentred(run, begun)
    off = turn_between(found.C_nb, motion.states(np.array([0.0])).C_nb[0])
    sigma = math.sqrt(found.P[UP, UP])
    assert sigma < math.radians(25.0)
    assert abs(off) < 4.0 * sigma / WIDER


def test_a_sure_heading_is_not_asked_of_the_log():
    start = sailed(1)[3]
    assert recentred(lambda *_: pytest.fail("asked"), start) is start


def test_a_heading_that_the_log_does_not_show_stays():
    """The smoother leaves half of what was said: not a third."""
    start = turned(sailed(1)[3], 0.0)
    P = np.tile(0.25 * start.P, (2, 1, 1))
    zero = np.zeros((2, 3))
    still = Track(
        np.arange(2.0), np.tile(start.C_nb, (2, 1, 1)), zero, zero, np.zeros((2, 15)), P, InsModel().layout, ()
    )
    assert recentred(lambda *_: still, start) is start


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_attitude_of_a_ship_that_began_unsure_is_within_four_sigmas(seed):
    motion, spec, record, start, aid = sailed(seed)
    begun = turned(start, UNSURE * np.random.default_rng([seed, 1]).standard_normal())
    answer = navigate(record, begun, aid=aid, imu=spec, deflection=STRAIGHT)
    off = answer.track.errors_against(Track.along(motion.states(answer.time))) / answer.track.sigma[:, :9]
    assert answer.status == "navigated"
    assert np.abs(off[:, :3]).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("run", [2, 4])
def test_a_fix_that_jumps_turns_no_start(run):
    """Two fixes of positions alone, off by 50 to 1000 m: the passes without gates turned heading by 9 and 12 sigmas."""
    rng, spec = np.random.default_rng([5511, run, 8]), imu_spec("consumer")
    motion = car(rng, 200.0)
    record = simulate(ideal_log(motion, rate=25.0, duration=200.0), imu=spec, seed=5511, run=run).record
    start = turned(drawn_start(motion, spec, rng), UNSURE * rng.standard_normal())
    aid = received(motion, 200.0, 1.0, rng)
    lat, draw = aid.record.lat.copy(), np.random.default_rng([3, run])
    for row in draw.integers(5, len(lat) - 5, 2):
        lat[row] += draw.choice([-1, 1]) * 10 ** draw.uniform(1.7, 3.0) / 6.37e6
    aid = replace(aid, record=replace(aid.record, lat=lat, v_n=None, velocity_sigma=None))
    answer = navigate(record, start, aid=aid, imu=spec, altitude="free", deflection=STRAIGHT, check_clocks=False)
    assert answer.status == "navigated"
    off = answer.track.errors_against(Track.along(motion.states(answer.time))) / answer.track.sigma[:, :9]
    assert np.abs(off[-1, :3]).max() < 4.0


def with_fixes_of(aid, sigma, mounting):
    """The receiver with fixes that it says to be so good, m."""
    record = replace(aid.record, position_sigma=np.full((len(aid.record), 3), sigma))
    return {"gnss": replace(aid, record=record, mounting=mounting)}


def test_an_arm_that_is_not_known_makes_a_turn_of_the_heading_bent():
    """By the turn times what the arm is uncertain by, against what a fix is good to."""
    aid = sailed(1)[4]
    assert linear_within({}) == LINEAR
    assert linear_within(with_fixes_of(aid, 0.02, aid.mounting)) == LINEAR
    assert linear_within(with_fixes_of(aid, 0.02, Mounting(lever_arm_sigma=4.0))) == pytest.approx(0.005)
    assert linear_within(with_fixes_of(aid, 0.02, None)) == pytest.approx(0.004)
    assert linear_within(with_fixes_of(aid, 2.0, None)) == LINEAR


@pytest.mark.parametrize(("seed", "duration"), some([(2, 120.0)], [(seed, DURATION) for seed in range(6)]))
def test_fixes_of_centimetres_on_an_arm_that_is_not_said(seed, duration):
    """Heading is known to 5 deg at the start: four of these six cars were refused, heading 16 to 49 sigmas off."""
    rng, spec = np.random.default_rng([seed, 7]), imu_spec("tactical")
    motion = car(rng, duration)
    record = simulate(ideal_log(motion, rate=25.0, duration=duration), imu=spec, seed=seed).record
    begun = drawn_start(motion, spec, rng)
    aid = with_fixes_of(received(motion, duration, 1.0, rng, place=0.02), 0.02, None)["gnss"]
    start = turned(begun, math.radians(5.0) * rng.standard_normal(), math.radians(5.0))
    result = navigate(record, start, aid=aid, imu=spec)
    assert result.status == "navigated", result.reasons
    truth = motion.states(result.time)
    off = [turn_between(C, true) for C, true in zip(result.C_nb[5:], truth.C_nb[5:], strict=True)]
    assert np.abs(np.array(off) / result.track.sigma[5:, UP]).max() < 4.0
