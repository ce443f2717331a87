"""An error that all fixes share is in the position found: sigma has it where nobody says that there is none."""

from dataclasses import replace

import numpy as np
import pytest

from tests.navigation.test_navigate import SPEC, drive, fixes
from truenorth.aiding.aids import Gnss
from truenorth.navigation import Mounting, navigate
from truenorth.quality.absolute import accuracy_of

__all__ = ["drive"]  # the fixture of a car that turns twice


def test_fixes_that_err_together(drive):
    """By 2.4 m east, 1.2 m north, 5 m up, of a receiver that says 1.5 and 3 m: no innovation shows it, sigma has it."""
    motion, record, start = drive
    time = np.arange(1.0, 179.0)
    sound = fixes(motion, time, 0.3)
    off = np.array([2.4, 1.2, 5.0])
    shifted = replace(
        sound,
        lat=sound.lat + off[1] / 6.37e6,
        lon=sound.lon + off[0] / (6.38e6 * np.cos(sound.lat)),
        alt=sound.alt + off[2],
        position_sigma=np.tile([1.5, 1.5, 3.0], (len(time), 1)),
    )
    for mounting in (None, Mounting(lever_arm=np.zeros(3))):
        result = navigate(record, start, aid=Gnss(shifted, mounting), imu=SPEC)
        assert result.status == "navigated"
        assert np.all(result.position_sigma[-1] >= [1.5, 1.5, 3.0])
        lat, _, alt = result.position[-1]
        s = motion.states(np.array(result.time[-1]))
        miss = np.array([(lat - float(s.lat)) * 6.37e6, alt - float(s.alt)])
        assert np.abs(miss).max() > 1.0
        assert np.all(np.abs(miss) < 2.0 * result.position_sigma[-1][1:])
    # Who says that there is none is believed: the sigma of white noise.
    white = navigate(record, start, aid=Gnss(shifted, Mounting(bias_sigma=0.0)), imu=SPEC)
    assert (white.position_sigma[-1] < 1.0).all()


@pytest.mark.parametrize(("quality", "level"), [(None, 2.0), (1, 2.0), (2, 1.0), (4, 0.05), (5, 0.5)])
def test_a_receiver_that_says_nothing_is_known_by_the_kind_of_its_fixes(drive, quality, level):
    motion, _, _ = drive
    record = replace(fixes(motion, np.arange(1.0, 20.0), 0.3), position_sigma=None)
    if quality is not None:
        record = replace(record, quality=np.full(len(record), float(quality)))
    assert accuracy_of(record)[:2] == pytest.approx(level)
    assert accuracy_of(record)[2] > level
