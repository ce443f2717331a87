"""A base that rests, and turns as its log ends: a vehicle that sets off shows no bias, a table that goes on turning does."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from benchmarks.honesty.harness import direction
from tests.runs import few_and_all, some
from truenorth.alignment import align
from truenorth.core.position import Position
from truenorth.records.specs import imu_spec
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.course import Leg, course
from truenorth.simulation.scenario import read_scenario

GRADES = ("consumer", "industrial")


def drawn(grade, run):
    rng = np.random.default_rng([1906, GRADES.index(grade), run])
    return rng, Position(math.radians(rng.uniform(-60.0, 60.0)), 0.2, 100.0)


def driven(grade, run, *, first=False):
    """80 to 150 s of rest, before (or after) 1 to 5 s in which the vehicle drives off (or stops) in a bend."""
    rng, place = drawn(grade, run)
    rest, lasts = rng.uniform(80.0, 110.0 if first else 150.0), rng.uniform(1.0, 5.0)
    speed, angle = rng.uniform(0.1, 0.6) * lasts, rng.choice([-1.0, 1.0]) * rng.uniform(0.15, 0.4) * lasts
    moves = Leg(lasts + 0.01, speed=0.0 if first else speed, turn=angle, onset=0.5)
    legs, begin = ([moves, Leg(rest)], speed) if first else ([Leg(rest), moves], 0.0)
    motion = course(place, legs, heading=rng.uniform(0.0, 6.28), speed=begin)
    made = simulate(ideal_log(motion, rate=100.0, duration=rest + lasts), imu=imu_spec(grade), seed=1906, run=run)
    return motion, made.record, place


def turned(grade, run, *, first=False):
    """20 to 60 s of rest, then a table turns till the log ends, for 12 to 60 s, or the other way round; tilted and off axis."""
    rng, place = drawn(grade, run)
    still, turning, rate = rng.uniform((20.0, 12.0, 5.0), (60.0, 60.0, 30.0))
    tilt = {name: f"{rng.uniform(-3.0, 3.0):.3f} deg" for name in ("pitch", "roll")}
    length = turning + (5.0 if first else 20.0)
    last = rng.choice([-1.0, 1.0]) * rate * length
    scenario = read_scenario(
        {
            "name": "turned",
            "duration": f"{still + turning + (10.0 if first else 0.0):.1f} s",
            "position": {"lat": f"{math.degrees(place.lat):.3f} deg", "lon": "10 deg", "alt": "100 m"},
            "motion": {
                "kind": "turntable",
                "positions": [
                    {"duration": "5 s" if first else f"{still:.1f} s", "heading": "0 deg"} | tilt,
                    {"duration": "100 s", "heading": f"{last:.3f} deg"} | tilt,
                ],
                "rate": f"{rate:.2f} deg/s",
            },
            "lever_arm": [f"{v:.3f} m" for v in 0.3 * rng.random() * direction(rng)],
            "imu": grade,
        }
    )
    made = scenario.simulate(seed=1906, run=run)
    record = made.record.between(10.0, None) if first else made.record
    return made.motion, record, place


def off(answer, motion):
    """Level, in sigmas of its two axes: of the vertical, since heading is a convention."""
    up = motion.states(np.array([answer.time])).C_nb[0][2]
    return answer.C_nb[:2] @ np.cross(answer.C_nb[2], up) / np.sqrt(np.diag(answer.phi_covariance)[:2])


def honest(squares):
    """Whether squares over sigma, of two axes a run, lie below the 99.99 % quantile of their mean, and no axis is 4.5 off."""
    assert np.mean(squares) < chi2.ppf(0.9999, len(squares)) / len(squares)
    assert np.max(squares) < 4.5**2


@few_and_all(60, few=2)
@pytest.mark.parametrize("grade", GRADES)
def test_a_vehicle_that_sets_off_as_its_log_ends_does_not_spoil_level(grade, runs):
    """An answer is honest, or refused since the base moves; level of industrial IMUs was up to 36 sigmas off, unsaid."""
    squares = []
    for run in range(runs):
        motion, record, place = driven(grade, run)
        answer = align(record, place, grade)
        keys = {item.key for item in answer.evidence}
        if answer.status == "inconsistent":
            assert keys & {"base.moves", "innovations.at_end"}, answer.reasons
        else:
            squares += list(off(answer, motion) ** 2)
    assert len(squares) >= runs // 2
    honest(squares)


@few_and_all(60, few=2)
@pytest.mark.parametrize("grade", GRADES)
def test_a_vehicle_that_stops_as_its_log_begins_does_not_spoil_level(grade, runs):
    squares = []
    for run in range(runs):
        motion, record, place = driven(grade, run, first=True)
        answer = align(record, place, grade)
        if answer.status != "inconsistent":
            squares += list(off(answer, motion) ** 2)
    honest(squares)


@few_and_all(40, few=2)
@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize("grade", some(["industrial"], ["consumer"]))
def test_a_table_that_turns_at_an_end_of_its_log_shows_level_better_than_rest_does(grade, first, runs):
    squares, sigmas = [], []
    for run in range(runs):
        motion, record, place = turned(grade, run, first=first)
        answer = align(record, place, grade)
        assert answer.status == "level_only", answer.reasons
        assert not {item.key for item in answer.evidence} & {"base.sets_off", "base.stops", "innovations.at_end"}
        squares += list(off(answer, motion) ** 2)
        sigmas.append(math.sqrt(answer.phi_covariance[0, 0]))
    honest(squares)
    assert np.median(sigmas) < 0.6 * imu_spec(grade).accel_bias / 9.81
