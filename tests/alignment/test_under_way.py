"""A log of a vehicle at steady speed, given as one of a base that stays: what shows it, and what nothing shows."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth.alignment import align
from truenorth.core.attitude import misalignment
from truenorth.core.position import Position
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight
from truenorth.simulation.scenario import read_scenario

PLACE = Position.from_degrees(40.0, 10.0)


def found(heading, speed):
    way = course(PLACE, straight(400.0), heading=np.radians(heading), speed=speed)
    record = simulate(way, rate=25.0, duration=300.0, imu="navigation", seed=4).record
    return align(record, PLACE, "navigation")


def keys(answer):
    return [item.key for item in answer.evidence]


def test_towards_east_the_gyros_show_it():
    """3 m/s are .1 deg/h about north: ten times the bias that the specification allows."""
    answer = found(80.0, 3.0)
    assert answer.status == "inconsistent"
    assert "rate.misses" in keys(answer)
    assert any("check that the base stays" in reason for reason in answer.reasons)


@pytest.mark.parametrize("heading", [20.0, 200.0])
def test_what_is_doubtful_is_in_sigma(heading):
    """3 m/s at 20 deg from the meridian: .035 deg/h about north, 2.5 to 5 sigmas; heading is off by ten of its former sigmas."""
    answer = found(heading, 3.0)
    off = np.degrees(answer.heading) - heading
    assert abs((off + 180.0) % 360.0 - 180.0) < 4.0 * np.degrees(answer.euler_sigma[0])
    assert "rate.doubtful" in keys(answer) or answer.status == "inconsistent"


def test_towards_north_nothing_shows_it_and_the_result_says_so():
    answer = found(0.0, 1.0)
    note = next(item for item in answer.evidence if item.key == "base.stays")
    # R w_ie cos L times sigma of heading: the speed that would turn it by so much.
    assert note.figures["speed"] == pytest.approx(
        6.36e6 * 7.292e-5 * np.cos(PLACE.lat) * answer.euler_sigma[0], rel=0.01
    )
    assert any("steady" in reason and "north or south" in reason for reason in answer.reasons)


def test_a_base_that_stays_is_not_doubted():
    """Beyond 2.5 sigmas along north or up: one sound log in forty."""
    doubted = 0
    for run in range(8):
        way = course(PLACE, straight(400.0), heading=0.3, speed=0.0)
        record = simulate(way, rate=25.0, duration=150.0, imu="navigation", seed=9, run=run).record
        answer = align(record, PLACE, "navigation")
        assert answer.status == "aligned"
        doubted += "rate.doubtful" in keys(answer)
    assert doubted <= 2


def at_sea(run):
    """A ship in a high sea, its IMU some metres from the centre: roll, pitch and yaw of four periods each, and a metre of way."""
    rng = np.random.default_rng([91, run])

    def tones(largest, unit):
        sizes = rng.uniform(0.1 * largest, largest, 4)
        return [
            {"amplitude": f"{a:.3f} {unit}", "period": f"{T:.2f} s"}
            for a, T in zip(sizes, rng.uniform(4.0, 14.0, 4), strict=True)
        ]

    motion = {"pitch": 2.0, "roll": 4.0, "heading": 1.0}, {"east": 0.6, "north": 0.6, "up": 0.4}
    return read_scenario(
        {
            "name": "high sea",
            "duration": "300 s",
            "position": {"lat": f"{rng.uniform(-60.0, 60.0):.3f} deg", "lon": "10 deg"},
            "motion": {
                "kind": "sway",
                "heading": f"{rng.uniform(0.0, 360.0):.1f} deg",
                "tones": {n: tones(a, "deg") for n, a in motion[0].items()}
                | {n: tones(a, "m") for n, a in motion[1].items()},
            },
            "lever_arm": [f"{x:.2f} m" for x in rng.uniform(-12.0, 12.0, 3)],
            "imu": "navigation",
        }
    )


@pytest.mark.slow
@few_and_all(16, few=4)
def test_a_high_sea_takes_a_ship_nowhere(runs):
    """Its velocity is more than .5 m/s, and it stays within metres: aligned, none more than four sigmas off."""
    for run in range(runs):
        scenario = at_sea(run)
        made = scenario.simulate(seed=run)
        answer = align(made.record, Position(scenario.position.lat, scenario.position.lon), "navigation")
        assert answer.status == "aligned", answer.reasons
        phi = misalignment(answer.C_nb, made.motion.states(np.array([answer.time])).C_nb[0])
        assert np.all(np.abs(phi) < 4.0 * np.sqrt(np.diag(answer.phi_covariance)))


@pytest.mark.slow
@pytest.mark.usefixtures("without_gyro_matrix")
def test_a_ship_that_manoeuvres_in_the_same_sea_does_not_stay():
    """It gathers way and stops again: tens of metres are no sway."""
    made = at_sea(0).simulate(seed=0)
    record, t = made.record, made.record.time
    speeding = 0.25 * np.sin(2.0 * np.pi * (t - t[0]) / 60.0)  # m/s^2: 2.4 m/s and 23 m, to and fro
    C_bn = np.swapaxes(made.motion.states(t).C_nb, 1, 2)
    scale = record.interval if record.kind == "increments" else 1.0
    driven = replace(record, accel=record.accel + scale * C_bn[:, :, 1] * speeding[:, None])
    answer = align(driven, Position(at_sea(0).position.lat, at_sea(0).position.lon), "navigation")
    assert answer.status == "inconsistent", answer.reasons
