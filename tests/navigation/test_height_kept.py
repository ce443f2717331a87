"""How height is kept where nobody says so: free where something shows the climb, else held."""

import numpy as np
import pytest

from truenorth.aiding.aids import Gnss, Odometer, VelocityLog
from truenorth.navigation.given import kept_altitude
from truenorth.records import GnssRecord, OdometerRecord, VelocityRecord

TIME = np.arange(10.0)
LEVEL = np.tile([0.1, 4.0, np.nan], (10, 1))
CLIMBING = np.tile([0.1, 4.0, 0.3], (10, 1))


def receiver(v_n):
    absent = np.full(10, np.nan)
    return Gnss(GnssRecord(TIME, absent, absent, absent, v_n))


AIDS = {
    "a receiver of level velocities": (receiver(LEVEL), "fixed"),
    "a receiver of velocities": (receiver(CLIMBING), "free"),
    "a log of two axes": (VelocityLog(VelocityRecord(TIME, LEVEL, "body")), "fixed"),
    "a log of three axes": (VelocityLog(VelocityRecord(TIME, CLIMBING, "body")), "free"),
    "a wheel, which stays on the road": (Odometer(OdometerRecord(TIME, np.full(10, 4.0), "speed")), "free"),
}


def test_an_attitude_shows_no_climb():
    """With a log of two axes height was left free: 19 km off in half an hour."""
    log = AIDS["a log of two axes"][0]
    for key in ("attitude", "magnetometer"):
        assert kept_altitude(None, {log.key: log, key: log})[0] == "fixed"


@pytest.mark.parametrize(("aid", "wanted"), AIDS.values(), ids=AIDS)
def test_height_that_is_not_said(aid, wanted):
    altitude, said = kept_altitude(None, {aid.key: aid})
    assert altitude == wanted
    assert len(said) == 1
