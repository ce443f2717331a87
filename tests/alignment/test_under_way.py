"""A log of a vehicle at steady speed, given as one of a base that stays: what shows it, and what nothing shows."""

import numpy as np
import pytest

from truenorth.alignment import align
from truenorth.core.position import Position
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight

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
