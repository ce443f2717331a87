"""How fast a vehicle is when its aids begin: by fixes, as far as these are good enough to say so."""

import numpy as np
import pytest

from truenorth.alignment.in_motion_speed import first_speed
from truenorth.core.earth import radii
from truenorth.records import GnssRecord

TIME = np.arange(0.0, 20.0)
NORTH = 4.0 * TIME  # m


def fixes(sigma):
    """A receiver whose places go north by 4 m/s, and are as good as that, m."""
    lat = 0.8 + NORTH / radii(0.8)[0]
    said = None if sigma is None else np.full((len(TIME), 3), sigma)
    return GnssRecord(TIME, lat, np.full_like(TIME, 0.2), np.zeros_like(TIME), position_sigma=said)


@pytest.mark.parametrize("sigma", [None, 0.01])
def test_good_fixes_show_a_speed(sigma):
    assert first_speed(None, fixes(sigma), 0.0) == pytest.approx(4.0, abs=0.05)


def test_poor_fixes_that_say_so_show_none():
    """First fixes of a receiver that starts up move by tens of metres: a car that stood was said to drive."""
    assert first_speed(None, fixes(30.0), 0.0) == 0.0


def test_velocities_show_it_as_well_as_they_say():
    moving = np.tile([0.0, 4.0, 0.0], (len(TIME), 1))
    absent = np.full_like(TIME, np.nan)
    for sigma, shown in ((0.1, 3.7), (2.0, 0.0)):
        record = GnssRecord(TIME, absent, absent, absent, moving, velocity_sigma=np.full((len(TIME), 3), sigma))
        assert first_speed(None, record, 0.0) == pytest.approx(shown)
