"""Logs of two clocks: the message names both spans and, where it is known, what to add to the aid's times."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth import DataError, Gnss, Odometer, align
from truenorth.cli.aiding_options import on_its_day
from truenorth.core.position import Position
from truenorth.records import GnssRecord, OdometerRecord
from truenorth.records.overlap import DAY, HOUR, LEAP, ROLLED, WEEK, shift_of
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight

SUNDAY = 1585440000.0  # 29 March 2020, s since 1970
SATURDAY = SUNDAY + 6 * DAY


@pytest.mark.parametrize(
    ("aid", "log", "shift"),
    [
        (SATURDAY + 75000.0, 75001.0, -SATURDAY),  # a clock of the day
        (75000.0, SATURDAY + 75001.0, SATURDAY),
        (5.0, SATURDAY + DAY - 30.0, SATURDAY + DAY),  # its log began before midnight
        (SATURDAY + 75000.0, 6 * DAY + 75000.0 + LEAP, LEAP - SUNDAY),  # of the GPS week
        (6 * DAY + 75000.0 + LEAP, SATURDAY + 75000.0, SUNDAY - LEAP),
        (SATURDAY - ROLLED, SATURDAY, ROLLED),
        (SATURDAY + 7 * HOUR, SATURDAY, -7 * HOUR),
        (SATURDAY, SATURDAY + 5.5 * HOUR, None),
        (SATURDAY + 3 * HOUR, 12.0, None),  # from where the device was switched on
        (5.0, 3000.0, None),
    ],
)
def test_what_brings_two_clocks_together(aid, log, shift):
    found = shift_of((aid, aid + 200.0), (log, log + 150.0))
    assert found == shift
    assert WEEK == 7 * DAY


@pytest.fixture(scope="module")
def drive():
    motion = course(Position.from_degrees(50.0, 10.0, 100.0), straight(30.0), heading=0.7, speed=8.0)
    record = simulate(ideal_log(motion, rate=50.0, duration=30.0), imu="tactical", seed=4).record
    time = np.arange(0.5, 30.0, 0.5)
    at = motion.states(time)
    return replace(record, time=record.time + 75000.0), GnssRecord(time + 75000.0, at.lat, at.lon, at.alt, v_n=at.v_n)


@pytest.mark.parametrize("by", [SATURDAY, -70000.0])
@pytest.mark.parametrize("place", [None, (50.0, 10.0, 100.0)])
def test_fixes_of_another_clock(drive, by, place):
    """A vehicle of 8 m/s, 1.6e9 s from its first fix: it was refused for a position sigma of no file."""
    record, gnss = drive
    with pytest.raises(DataError) as caught:
        align(record, place, "tactical", aid=Gnss(gnss.shifted(by)))
    words = [f"from {75000.5 + by:.3f} s to", "from 75000.020 s to 75030.000 s", "`record.shifted`"]
    for word in words + ([f"{-by:.0f} s added"] if by > 0.0 else []):
        assert word in str(caught.value), caught.value


@pytest.mark.parametrize("by", [SATURDAY, -70000.0])
def test_wheels_of_another_clock(drive, by):
    record, gnss = drive
    wheel = OdometerRecord(gnss.time + by, np.full(len(gnss), 4.0), "distance")
    with pytest.raises(DataError, match=r"no overlap; expected one clock"):
        align(record, (50.0, 10.0, 100.0), "tactical", aid=Odometer(wheel))


def test_a_clock_of_the_day_and_one_with_dates_are_brought_together(drive):
    """NMEA has dates, many a logger the time of day alone: whole days are no question."""
    record, gnss = drive
    (aid,) = on_its_day(record, [Gnss(gnss.shifted(SATURDAY))])
    np.testing.assert_allclose(aid.record.time, gnss.time, rtol=0.0, atol=1e-6)
    assert f"{-SATURDAY / DAY:.0f} days" in aid.record.source
    early = record.shifted(-74000.0)  # as a clock that counts from where it was switched on
    for log, aid in (
        (record, Gnss(gnss)),
        (record, Gnss(gnss.shifted(SATURDAY + 3.5 * HOUR))),
        (record, Gnss(gnss.shifted(SUNDAY))),  # the GPS week's first day: it may count from midnight, or from Sunday
        (early, Gnss(gnss.shifted(SATURDAY - 74000.0))),
    ):
        assert on_its_day(log, [aid])[0] is aid
