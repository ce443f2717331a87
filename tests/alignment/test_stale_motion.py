"""The motion of a base is fitted about an attitude that is off by less than its sigma: what else is in it is attitude's error."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.honesty.foreign_rows import indexed, moored
from truenorth.alignment import swaying
from truenorth.errors.staying import PHI


class Counting(swaying._MotionFilter):
    """A filter that finds attitude off by so many sigmas, pass by pass, and counts the fits of the motion."""

    def __init__(self, off, fits=1):
        self.off, self.passes, self.fits, self.stale, self.motion, self.count = iter(off), 0, fits, False, (), 0

    def fit(self, residual, guesses):
        self.count += 1
        return guesses

    def filtered(self):
        end = np.zeros(PHI.stop)
        end[PHI.start] = next(self.off)
        return SimpleNamespace(end=end, P=np.eye(PHI.stop))


@pytest.mark.parametrize(
    ("off", "fits"), [([9.0, 0.5, 0.1], 1), ([9.0, 4.0, 0.5, 0.1], 2), ([9.0, 4.0, 3.0, 2.0, 0.1], 4)]
)
def test_the_motion_is_fitted_anew_as_long_as_attitude_moves(off, fits):
    found = Counting(off)
    for _ in off:
        found(SimpleNamespace(z=None))
    assert found.count == fits


def test_fits_have_an_end():
    found = Counting([9.0] * 40)
    for _ in range(40):
        found(SimpleNamespace(z=None))
    assert found.count == swaying.MOST_FITS


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3, 7])
def test_industrial_gyros_on_an_indexer_of_a_moored_ship(number):
    """Run 7 was refused for noise that its accelerometers do not have, 8 sigmas off in level."""
    outcome = indexed(moored, "industrial", 400.0)(1127, number)
    assert not outcome.refused
    assert max(np.abs(value).max() for value in outcome.ratios.values()) < 4.0
